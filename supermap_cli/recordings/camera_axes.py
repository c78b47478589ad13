"""Camera frames in the body's axes (x forward) where optical ones (z forward) are meant, as simulators publish them.

Such a frame stands upright in TF, so that as an optical one it would look at the ceiling. Where depth and poses are
recorded, the images decide: seen from two places, the same surfaces must lie in the same place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.images import decode_depth
from supermap_cli.recordings.messages import read_image
from supermap_cli.recordings.mounting import BODY_OPTICAL
from supermap_cli.recordings.storage import Storage
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.transforms import TransformTree

_UPRIGHT, _RATHER_UPRIGHT = np.cos(np.deg2rad(50.0)), np.cos(np.deg2rad(80.0))
"""Cosines to the base's z axis from which a frame's z axis points up: cameras look no steeper than the first; where
the images agree the second is enough.
"""

_OPTICAL_RAD = np.deg2rad(15.0)
"""A frame below that is turned from the body's axes to optical ones up to this much is its optical frame."""

_VIEWS, _WINDOW_NS = 10, 1_000_000_000
"""Depth images that are compared, spread over the recording, and ns at each in which one is looked for."""

_GRID_PX = 12
"""Pixels between the points of a depth image that are compared with the others."""

_CLOSE_M, _CLOSE_SHARE = 0.05, 0.03
"""m, and share of the depth, up to which a point lies on the surface that another image shows."""

_LEAST_POINTS, _LEAST_DIFFERENCE = 300, 0.15
"""Points seen from two places, and the difference of the shares that agree, from which the images decide."""

PoseAt = Callable[[int], FloatArray | None]
"""`T_odom_base` (4, 4) at a stamp; `None` where it is not known."""


@dataclass(frozen=True)
class Views:
    """Depth images (m) with the poses of the base, and the camera that took them."""

    camera: Camera
    depths: Sequence[Float32Array]
    poses: Sequence[FloatArray]


def is_upright(tree: TransformTree, base: str, frame: str, *, rather: bool = False) -> bool:
    """Whether a frame's z axis points up (`rather` up), where an optical frame's points forward."""
    T = placed(tree, base, frame)
    return T is not None and bool(T[2, 2] > (_RATHER_UPRIGHT if rather else _UPRIGHT))


def placed(tree: TransformTree, base: str, frame: str) -> FloatArray | None:
    """`T_base_frame`, at any time if it moves."""
    if not tree.connects(base, frame):
        return None
    down_base, down_frame = tree.path(base, frame)
    stamps = [edge.samples[0][0] for edge in (*down_base, *down_frame) if edge.samples and not edge.static]
    return tree.lookup(base, frame, max(stamps, default=0))


def optical_below(tree: TransformTree, frame: str) -> str | None:
    """The optical frame that TF has under a body's one, if there is one alone."""
    found = []
    for child in tree.children_of(frame):
        T = tree.lookup(frame, child, 0) if tree.is_static(frame, child) else None
        if T is not None and _turn_rad(T, BODY_OPTICAL) < _OPTICAL_RAD:
            found.append(child)
    optical = [child for child in found if "optical" in child] or found
    return optical[0] if len(optical) == 1 else None


def _turn_rad(a: FloatArray, b: FloatArray) -> float:
    return float(np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2, -1, 1)))


def views(storage: Storage, decoder: Decoder, depth: Topic, camera: Camera, pose_at: PoseAt) -> Views:
    """Depth images spread over the recording whose pose is known."""
    depths, poses = [], []
    for start_ns in np.linspace(storage.start_ns, storage.end_ns, _VIEWS, endpoint=False).astype(np.int64).tolist():
        for raw in storage.messages([depth.name], start_ns, start_ns + _WINDOW_NS):
            try:
                image = decoder.read_strictly(raw, read_image)
                pose = pose_at(image.stamp_ns)
                pixels = None
                if pose is not None:
                    pixels = decode_depth(image, decoder.limits) * np.float32(depth.depth_scale)
            except (RecordingError, ValueError):
                continue
            if pose is not None and pixels is not None and pixels.shape == (camera.height, camera.width):
                depths.append(pixels)
                poses.append(pose)
                break
    return Views(camera, depths, poses)


def images_say_turned(seen: Views, T_base_camera: FloatArray) -> bool | None:
    """Whether the surfaces in the images agree better if the frame is the body's; `None` where they do not tell."""
    given, turned = (_agreement(seen, T) for T in (T_base_camera, T_base_camera @ BODY_OPTICAL))
    if given is None or turned is None or abs(turned - given) < _LEAST_DIFFERENCE:
        return None
    return turned > given


def _agreement(seen: Views, T_base_camera: FloatArray) -> float | None:
    """The share of points of each image that lie on the surfaces of the next; `None` for too few."""
    close = compared = 0
    T_odom_camera = [pose @ T_base_camera for pose in seen.poses]
    for a, b in _neighbours(len(seen.depths)):
        T_b_a = inverse(T_odom_camera[b]) @ T_odom_camera[a]
        points = transform_points(T_b_a, _points(seen.camera, seen.depths[a]))
        pixels, on_image = seen.camera.project(points)
        columns, rows = np.rint(pixels[on_image]).astype(int).T
        expected_m = seen.camera.depth_of(points[on_image])
        measured_m = seen.depths[b][rows.clip(0, seen.camera.height - 1), columns.clip(0, seen.camera.width - 1)]
        close += int((np.abs(measured_m - expected_m) < _CLOSE_M + _CLOSE_SHARE * measured_m).sum())
        compared += len(points)
    return close / compared if compared >= _LEAST_POINTS else None


def _neighbours(count: int) -> Iterator[tuple[int, int]]:
    for step in (1, 2, 3):
        yield from ((at, at + step) for at in range(count - step))


def _points(camera: Camera, depth_m: Float32Array) -> FloatArray:
    """(n, 3) points of a grid of pixels with depth, in the camera's frame."""
    rows, columns = np.mgrid[_GRID_PX // 2 : camera.height : _GRID_PX, _GRID_PX // 2 : camera.width : _GRID_PX]
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    z = depth_m[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    return camera.back_project(pixels[z > 0].astype(np.float64), z[z > 0])
