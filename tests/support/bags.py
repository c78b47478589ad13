"""Small whole recordings for tests, with what the test needs left out or bent.

    write_recording(tmp_path / "run.mcap", frames=5, without={"depth"})     # or "run.bag", "run.db3"

Topics: /camera/color/image_raw, /camera/color/camera_info, /camera/depth/image_raw, /camera/depth/camera_info, /odom,
/tf, /tf_static, /detections, /masks; 10 Hz from START_NS; frame i looks at a wall 2 m away from x = i/10 m. Message by
message: `bag_writer.BagWriter`, which is `bags.BagWriter` too.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from supermap_cli.geometry.se3 import make_transform
from support.bag_writer import BagWriter, compressed_depth_png

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 100_000_000
WIDTH, HEIGHT, FOCAL = 64, 48, 60.0
WALL_M = 2.0
T_BASE_OPTICAL = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.1, 0, 0.5])


def stamp(index: int) -> int:
    """The stamp of frame `index`."""
    return START_NS + index * PERIOD_NS


def color_image(index: int) -> np.ndarray:
    """The recording's colour image, (h, w, 3) uint8: a colour that tells frames apart, a red square in the middle."""
    rgb = np.full((HEIGHT, WIDTH, 3), (index % 200, 100, 50), np.uint8)
    rgb[16:32, 24:40] = (200, 0, 0)
    return rgb


def depth_image() -> np.ndarray:
    """The recording's depth image, (h, w) uint16 mm: a wall, and a box 0.5 m before it in the middle."""
    depth = np.full((HEIGHT, WIDTH), round(WALL_M * 1000), np.uint16)
    depth[16:32, 24:40] = round((WALL_M - 0.5) * 1000)
    return depth


def pose_at(index: int) -> np.ndarray:
    """`T_odom_base` of frame `index`: 10 cm along x a frame."""
    return make_transform(np.eye(3), [index / 10, 0, 0])


def write_recording(
    path: Path,
    *,
    frames: int = 5,
    without: Collection[str] = (),
    depth_encoding: str = "16UC1",
    color_encoding: str = "rgb8",
    lidar: bool = False,
    label: str = "box",
    broken_poses: Collection[int] = (),
    writer: Callable[..., BagWriter] = BagWriter,
    **options: Any,
) -> Path:
    """Write one small recording, 10 Hz. Returns `path`.

    `without` any of "color", "depth", "camera_info", "odom", "tf", "tf_static", "detections", "masks". `lidar` adds
    /points, a grid on a wall with per-point times. `broken_poses` are frames whose pose is NaN. `writer` makes another
    writer than `BagWriter`, of its own options.
    """
    size, K = (WIDTH, HEIGHT), (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    frame_id = "camera_optical_frame"
    wanted = {"color", "depth", "camera_info", "odom", "tf", "tf_static", "detections", "masks"} - set(without)
    with writer(path, **options) as bag:
        if "tf_static" in wanted:
            bag.transform(START_NS, "base_link", frame_id, T_BASE_OPTICAL, static=True)
            bag.transform(START_NS, "base_link", "lidar", make_transform(np.eye(3), [0, 0, 0.6]), static=True)
        for index in range(frames):
            at = stamp(index)
            T = pose_at(index)
            if "tf" in wanted:
                bag.transform(at, "odom", "base_link", T)
            if "odom" in wanted:
                broken = make_transform(np.eye(3), [np.nan, 0, 0])
                bag.odometry("/odom", at, broken if index in broken_poses else T)
            if "camera_info" in wanted:
                bag.camera_info("/camera/color/camera_info", at, frame_id, size, K)
                if "depth" in wanted:
                    bag.camera_info("/camera/depth/camera_info", at, frame_id, size, K)
            if "color" in wanted:
                _write_color(bag, at, index, frame_id, color_encoding)
            if "depth" in wanted:
                _write_depth(bag, at, frame_id, depth_encoding)
            if "detections" in wanted:
                name = "7" if path.suffix == ".bag" or options.get("old_vision") else label
                bag.detections("/detections", at, frame_id, [([(name, 0.9)], (24, 16, 40, 32))])
            if "masks" in wanted:
                numbers = np.zeros((HEIGHT, WIDTH), np.uint16)
                numbers[16:32, 24:40] = 1
                bag.image("/masks", at, frame_id, numbers, "16UC1")
            if lidar:
                bag.points("/points", at, "lidar", wall_points(index))
    return path


def write_images(
    bag: BagWriter,
    index: int,
    *,
    prefix: str = "/camera",
    frame_id: str = "camera_optical_frame",
    detections: bool = False,
    late_ns: int = 0,
) -> None:
    """Colour and depth of frame `index` with their calibrations, and what a detector found in them.

    They are recorded `late_ns` after their stamps.
    """
    at, size, K = stamp(index), (WIDTH, HEIGHT), (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    log_ns = at + late_ns
    bag.camera_info(f"{prefix}/color/camera_info", at, frame_id, size, K, log_ns=log_ns)
    bag.image(f"{prefix}/color/image_raw", at, frame_id, color_image(index), "rgb8", log_ns=log_ns)
    bag.camera_info(f"{prefix}/depth/camera_info", at, frame_id, size, K, log_ns=log_ns)
    bag.image(f"{prefix}/depth/image_raw", at, frame_id, depth_image(), "16UC1", log_ns=log_ns)
    if detections:
        bag.detections("/detections", at, frame_id, [([("box", 0.9)], (24, 16, 40, 32))], log_ns=log_ns)


def write_rig(
    path: Path,
    cameras: Mapping[str, float] | Sequence[str],
    *,
    frames: int = 5,
    without: Collection[str] = (),
    late_ns: Mapping[str, int] | None = None,
    baseline_m: float = 0.0,
    lidar: bool = False,
    depth: str = "aligned_depth_to_color",
) -> Path:
    """A robot with several RGB-D cameras: `cameras` maps the prefix of each ("/camera_front") to its yaw in degrees, or
    lists the prefixes, for yaws of 0, 60, 120... degrees.

    Each has PREFIX/color/image_raw, PREFIX/color/camera_info, PREFIX/DEPTH/image_raw, PREFIX/detections and
    PREFIX/masks in the frame `camera_frame(PREFIX)`; `without` names topics and frames that are left out; stamps of a
    camera are `late_ns` later; neighbours stand `baseline_m` apart. The label of a detection is the prefix's.
    """
    size, K = (WIDTH, HEIGHT), (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    yaws = cameras if isinstance(cameras, Mapping) else {prefix: 60.0 * i for i, prefix in enumerate(cameras)}
    numbers = np.zeros((HEIGHT, WIDTH), np.uint16)
    numbers[16:32, 24:40] = 1
    with BagWriter(path) as bag:
        if lidar:
            bag.transform(START_NS, "base_link", "lidar", make_transform(np.eye(3), [0, 0, 0.6]), static=True)
        for place, (prefix, yaw_deg) in enumerate(yaws.items()):
            if camera_frame(prefix) not in without:
                c, s = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
                turn = make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [0, place * baseline_m, 0])
                bag.transform(START_NS, "base_link", camera_frame(prefix), turn @ T_BASE_OPTICAL, static=True)
        for index in range(frames):
            bag.odometry("/odom", stamp(index), pose_at(index))
            if lidar:
                bag.points("/points", stamp(index), "lidar", wall_points(index))
            for prefix in yaws:
                at, frame = stamp(index) + (late_ns or {}).get(prefix, 0), camera_frame(prefix)
                if (topic := f"{prefix}/color/camera_info") not in without:
                    bag.camera_info(topic, at, frame, size, K)
                if (topic := f"{prefix}/color/image_raw") not in without:
                    bag.image(topic, at, frame, rig_image(prefix, index), "rgb8")
                if (topic := f"{prefix}/{depth}/image_raw") not in without:
                    bag.image(topic, at, frame, depth_image(), "16UC1")
                if (topic := f"{prefix}/detections") not in without:
                    bag.detections(topic, at, frame, [([(prefix, 0.9)], (24, 16, 40, 32))])
                if (topic := f"{prefix}/masks") not in without:
                    bag.image(topic, at, frame, numbers, "16UC1")
    return path


def camera_frame(prefix: str) -> str:
    """The optical frame of the camera of a rig whose topics start with `prefix`."""
    return f"{prefix.strip('/').replace('/', '_')}_optical_frame"


def rig_image(prefix: str, index: int) -> np.ndarray:
    """Frame `index` of a rig's camera: `color_image` with a green that tells cameras apart."""
    rgb = color_image(index)
    rgb[..., 1] = sum(prefix.encode()) % 256
    return rgb


def wall_points(index: int) -> np.ndarray:
    """A LiDAR sweep of 0.1 s onto the wall from frame `index` on, in the LiDAR's moving frame, 1 m/s along x."""
    y, z = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1.5, 1.5, 61))
    records = np.zeros(y.size, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("time", "<f4")]))
    records["time"] = np.linspace(0, 0.1, y.size, endpoint=False)
    records["x"] = WALL_M + 0.1 + 0.4 - index / 10 - records["time"]
    records["y"], records["z"] = y.ravel(), z.ravel()
    return records


def _write_color(bag: BagWriter, at: int, index: int, frame_id: str, encoding: str) -> None:
    rgb = color_image(index)
    if encoding in {"jpeg", "png"}:
        data = cv2.imencode(f".{encoding}", rgb[..., ::-1])[1].tobytes()
        bag.compressed("/camera/color/image_raw/compressed", at, frame_id, data, encoding)
        return
    pixels = rgb[..., ::-1] if encoding == "bgr8" else rgb
    bag.image("/camera/color/image_raw", at, frame_id, pixels, encoding)


def _write_depth(bag: BagWriter, at: int, frame_id: str, encoding: str) -> None:
    depth = depth_image()
    if encoding == "compressedDepth":
        form = "16UC1; compressedDepth png"
        bag.compressed("/camera/depth/image_raw/compressedDepth", at, frame_id, compressed_depth_png(depth), form)
    elif encoding == "32FC1":
        bag.image("/camera/depth/image_raw", at, frame_id, (depth / 1000).astype(np.float32), encoding)
    else:
        bag.image("/camera/depth/image_raw", at, frame_id, depth, encoding)


def cut_file(source: Path, target: Path, share: float) -> Path:
    """The first part of a file, as a crash leaves it."""
    with contextlib.closing(source.open("rb")) as file:
        target.write_bytes(file.read(int(source.stat().st_size * share)))
    return target
