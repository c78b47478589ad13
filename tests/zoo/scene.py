"""The world of all zoo recordings: a suitcase in a small room, seen by a robot that drives past it.

The odom frame is the world's: x forward, y left, z up, z = 0 on the floor. Everything is ray-cast with numpy and kept,
so that a hundred recordings cost one rendering.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from supermap_cli.geometry.se3 import make_transform

LABEL, CLASS_NUMBER = "suitcase", 28
"""What stands in the room, and its number in COCO's list of 80 classes."""

CENTER, SIZE = np.array([1.6, 0.0, 0.45]), np.array([0.5, 0.6, 0.9])
"""Middle and edges of the suitcase, metres."""

SEEN = CENTER - [SIZE[0] / 2, 0.0, 0.0]
"""Middle of the side that is seen: only that is mapped."""

ROOM_LOW, ROOM_HIGH = np.array([-2.0, -2.2, 0.0]), np.array([3.0, 2.2, 2.4])
"""Inner corners of the room, metres."""

WIDTH, HEIGHT, FOCAL = 64, 48, 50.0
"""Pixels of the colour images, and focal length in pixels."""

START_NS, RATE_HZ, FRAMES = 1_700_000_000_000_000_000, 3.0, 7
"""Stamp of the first image, images a second, images of a recording."""

T_BASE_BODY = make_transform(np.eye(3), [0.1, 0.0, 0.8])
"""Where the camera's housing sits on the base: x forward, as camera_link."""

T_BODY_OPTICAL = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
"""The optical axes in the housing's (REP-103)."""

T_BASE_LIDAR = make_transform(np.eye(3), [0.0, 0.0, 1.1])
SWEEP_S, BEAMS, COLUMNS = 0.1, 24, 180
"""Seconds of a LiDAR's revolution, its beams and the columns of one revolution."""

K = (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
_COLORS = np.array([[205, 200, 190], [190, 60, 40]])


def stamp(index: float) -> int:
    """The stamp of image `index`, ns."""
    return START_NS + round(index / RATE_HZ * 1e9)


@cache
def T_world_base(index: float) -> np.ndarray:
    """(4, 4): past the suitcase at 0.45 m/s, always looking at it."""
    x, y = -0.3, -0.45 + 0.15 * index
    yaw = np.arctan2(CENTER[1] - y, CENTER[0] - x)
    c, s = np.cos(yaw), np.sin(yaw)
    return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, 0])


def _cast(origins: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance along each ray (n,), and what it hits (n,): 0 the room, 1 the suitcase."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / rays
        distance = np.fmax((ROOM_LOW - origins) * inverse, (ROOM_HIGH - origins) * inverse).min(axis=1)
        one, other = (CENTER - SIZE / 2 - origins) * inverse, (CENTER + SIZE / 2 - origins) * inverse
        near, far = np.fmin(one, other).max(axis=1), np.fmax(one, other).min(axis=1)
    hit = (near < far) & (near > 0.05) & (near < distance)
    return np.where(hit, near, distance), hit.astype(int)


@cache
def render(
    index: float,
    offset: tuple[float, float, float] = (0, 0, 0),
    size: tuple[int, int] = (WIDTH, HEIGHT),
    *,
    fisheye: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a camera sees in image `index`: depth (h, w) metres, suitcase (h, w) bool, rgb (h, w, 3) uint8.

    `offset` is its place in the main camera's optical frame, metres; another `size` has the same field of view. A
    `fisheye` is equidistant without further distortion.
    """
    T = T_world_base(index) @ T_BASE_BODY @ T_BODY_OPTICAL @ make_transform(np.eye(3), offset)
    fx, fy, cx, cy = intrinsics(size)
    v, u = np.mgrid[0 : size[1], 0 : size[0]].reshape(2, -1).astype(float)
    x, y = (u - cx) / fx, (v - cy) / fy
    stretch = np.tan(np.hypot(x, y)) / np.hypot(x, y) if fisheye else 1.0
    rays = np.column_stack([x * stretch, y * stretch, np.ones(u.size)]) @ T[:3, :3].T
    depth, thing = _cast(T[:3, 3], rays)
    places = T[:3, 3] + rays * depth[:, None]
    shade = np.where(np.floor(places * 5 + 1e-3).astype(int).sum(axis=1) % 2, 1.0, 0.7)
    rgb = np.clip(_COLORS[thing] * shade[:, None], 0, 255).astype(np.uint8)
    shape = (size[1], size[0])
    return depth.reshape(shape), thing.reshape(shape).astype(bool), rgb.reshape(*shape, 3)


def intrinsics(size: tuple[int, int]) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a camera of that many pixels, in pixels."""
    return FOCAL * size[0] / WIDTH, FOCAL * size[1] / HEIGHT, (size[0] - 1) / 2, (size[1] - 1) / 2


def box_xyxy(index: float) -> tuple[float, float, float, float]:
    """The detection of the suitcase in image `index`, pixels."""
    seen = render(index)[1]
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return float(columns[0]), float(rows[0]), float(columns[-1] + 1), float(rows[-1] + 1)


@cache
def scan(index: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A revolution that begins at image `index`: points (n, 3) in the LiDAR's moving frame, seconds since its begin
    (n,), rings (n,).
    """
    columns = np.arange(COLUMNS)
    offsets_s = SWEEP_S * columns / COLUMNS
    elevation = np.radians(np.linspace(-32, 16, BEAMS))
    azimuth = -2 * np.pi * columns[:, None] / COLUMNS
    beams = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.broadcast_to(np.sin(elevation), (COLUMNS, BEAMS)),
        ],
        axis=-1,
    )
    T = np.array([T_world_base(index + each * RATE_HZ) @ T_BASE_LIDAR for each in offsets_s])
    rays = np.einsum("cij,cbj->cbi", T[:, :3, :3], beams).reshape(-1, 3)
    distance, _ = _cast(np.repeat(T[:, :3, 3], BEAMS, axis=0), rays)
    points = beams.reshape(-1, 3) * distance[:, None]
    return points, np.repeat(offsets_s, BEAMS), np.tile(np.arange(BEAMS), COLUMNS)
