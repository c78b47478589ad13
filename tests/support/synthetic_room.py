"""A furnished room, rendered: the test suite's synthetic world. Writes small ROS 2 recordings with ground truth.

    PYTHONPATH=tests python -m support.synthetic_room visit1.mcap --seed 1
    PYTHONPATH=tests python -m support.synthetic_room visit2.mcap --seed 2 --visit 2

The world frame is level, x and y from the room's centre, z = 0 on the floor. The robot drives around the table and
looks inwards. `rgbd` gives colour, depth and a level `odom`; `lidar` gives colour, a spinning LiDAR with per-point
times and motion distortion and an IMU, and no odometry. Both carry recorded detections with masks.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.types.sensing import Sweep
from support.room_messages import RoomBag

Rig = Literal["rgbd", "lidar"]
DAY_NS = 86_400_000_000_000
START_NS = 1_700_000_000_000_000_000

WIDTH, HEIGHT, FOCAL = 320, 240, 260.0
SIN_15, COS_15 = np.sin(np.radians(15)), np.cos(np.radians(15))
T_BASE_CAMERA = make_transform([[0, -SIN_15, COS_15], [-1, 0, 0], [0, -COS_15, -SIN_15]], [0.1, 0, 1.2])
T_BASE_LIDAR = make_transform(np.eye(3), [0, 0, 1.35])
LIDAR_RATE_HZ, LIDAR_BEAMS_DEG, LIDAR_COLUMNS = 10.0, np.linspace(-30, 16, 32), 720
ROOM = (6.0, 5.0, 2.6)


@dataclass(frozen=True)
class Thing:
    """One object and where it stands: `at` is (x, y, z) of its foot's centre in the world, `yaw` radians."""

    name: str
    label: str
    shape: str
    at: tuple[float, float, float]
    yaw: float = 0.0


THINGS = (
    Thing("table", "dining table", "table", (0, 0, 0)),
    Thing("chair-1", "chair", "chair", (-0.45, -0.75, 0), np.pi),
    Thing("chair-2", "chair", "chair", (0.45, -0.75, 0), np.pi),
    Thing("chair-3", "chair", "chair", (-0.45, 0.75, 0), 0.0),
    Thing("chair-4", "chair", "chair", (1.15, 0.05, 0), -np.pi / 2),
    Thing("cup-1", "cup", "cup", (-0.3, 0.1, 0.74)),
    Thing("cup-2", "cup", "cup", (0.4, -0.15, 0.74)),
    Thing("tv", "tv", "tv", (0.3, 2.46, 1.05)),
    Thing("plant", "potted plant", "plant", (-2.6, -2.1, 0)),
)
SPARE = (
    Thing("suitcase", "suitcase", "suitcase", (2.5, 1.9, 0), 0.4),
    Thing("chair-5", "chair", "chair", (-2.4, 1.9, 0), 0.6),
)
COLOURS = {
    "table": (150, 100, 60), "chair": (40, 90, 160), "cup": (220, 60, 50), "tv": (25, 25, 30),
    "plant": (50, 140, 60), "suitcase": (200, 170, 40),
}  # fmt: skip
ROOM_COLOUR = (205, 200, 190)
GONE = frozenset({"cup-2"})
CHANGED = {"chair-3": (-2.3, 1.6, 0.5), "suitcase": (2.5, 1.9, 0.4)}
ALSO_LIKE = {"chair": "couch", "cup": "vase", "tv": "laptop", "dining table": "bench"}


@dataclass(frozen=True)
class TrueObject:
    """Ground truth of one object in the world frame; `frames_seen` counts images with at least 60 of its pixels."""

    name: str
    label: str
    box: Box3D
    frames_seen: int = 0

    @property
    def centroid(self) -> np.ndarray:
        """Centre of the box."""
        return self.box.center


@dataclass(frozen=True)
class Drive:
    """The robot's way: one round about the table in `seconds`, from the angle `phase`."""

    seconds: float
    phase: float = 0.0

    def T_world_base(self, time_s: float) -> np.ndarray:
        """The base's true pose (4, 4)."""
        angle = self.phase + 0.95 * 2 * np.pi * time_s / self.seconds
        x, y = 2.25 * np.cos(angle), 1.8 * np.sin(angle)
        yaw = np.arctan2(-y, -x) + 0.3 * np.sin(3 * angle)
        c, s = np.cos(yaw), np.sin(yaw)
        return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, 0])


@dataclass(frozen=True)
class RoomTruth:
    """What a recording was made of. `T_world_odom` places its odom frame (for the LiDAR rig: the first base)."""

    objects: tuple[TrueObject, ...]
    drive: Drive
    start_ns: int
    T_world_odom: np.ndarray = field(default_factory=lambda: np.eye(4))

    def T_odom_base(self, stamp_ns: int) -> np.ndarray:
        """The base's true pose in the odom frame."""
        return inverse(self.T_world_odom) @ self.drive.T_world_base((stamp_ns - self.start_ns) / 1e9)


class Room:
    """The room and its things as a scene of triangles that rays can be cast into."""

    def __init__(self, things: tuple[Thing, ...]) -> None:
        self._o3d = load_open3d()
        self._scene = self._o3d.t.geometry.RaycastingScene()
        self.things = things
        self.boxes = []
        shell = self._box(ROOM[0], ROOM[1], ROOM[2], 0, 0, 0)
        self._add(shell)
        for thing in things:
            mesh = self._mesh(thing.shape)
            low, high = mesh.get_min_bound(), mesh.get_max_bound()
            c, s = np.cos(thing.yaw), np.sin(thing.yaw)
            T_world_thing = make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], thing.at)
            center = T_world_thing[:3, :3] @ ((low + high) / 2) + T_world_thing[:3, 3]
            self.boxes.append(Box3D(center, high - low, thing.yaw))
            self._add(mesh.transform(T_world_thing))
        self._palette = np.array([ROOM_COLOUR, *(COLOURS[thing.shape] for thing in things)], float)

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rays (n, 3) -> distance in lengths of the direction (n,), thing hit (n,) 0 = room, colour (n, 3) uint8."""
        rays = self._o3d.core.Tensor(np.concatenate([origins, directions], axis=1).astype(np.float32))
        hit = self._scene.cast_rays(rays)
        distance, thing = hit["t_hit"].numpy(), hit["geometry_ids"].numpy().astype(np.int64)
        thing[~np.isfinite(distance)] = 0
        shade = 0.55 + 0.45 * np.abs(hit["primitive_normals"].numpy() @ np.array([0.36, 0.48, 0.8]))
        place = origins + np.where(np.isfinite(distance), distance, 0)[:, None] * directions
        shade *= np.where((np.floor(place * 2 + 1e-3).astype(int).sum(axis=1) % 2 == 0) & (thing == 0), 0.9, 1.0)
        return distance, thing, np.clip(self._palette[thing] * shade[:, None], 0, 255).astype(np.uint8)

    def _add(self, mesh: Any) -> None:
        self._scene.add_triangles(self._o3d.t.geometry.TriangleMesh.from_legacy(mesh))

    def _box(self, dx: float, dy: float, dz: float, x: float, y: float, z: float) -> Any:
        """A box whose foot's centre is (x, y, z)."""
        return self._o3d.geometry.TriangleMesh.create_box(dx, dy, dz).translate([x - dx / 2, y - dy / 2, z])

    def _round(self, radius: float, height: float, z: float) -> Any:
        return self._o3d.geometry.TriangleMesh.create_cylinder(radius, height, 24, 1).translate([0, 0, z + height / 2])

    def _legs(self, dx: float, dy: float, height: float, thick: float) -> Any:
        mesh = self._o3d.geometry.TriangleMesh()
        for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            mesh += self._box(thick, thick, height, x * (dx - thick) / 2, y * (dy - thick) / 2, 0)
        return mesh

    def _mesh(self, shape: str) -> Any:
        """A thing's mesh, its foot at the origin; a chair's back stands at +y."""
        match shape:
            case "table":
                return self._legs(1.7, 0.9, 0.7, 0.06) + self._box(1.7, 0.9, 0.04, 0, 0, 0.7)
            case "chair":
                seat = self._legs(0.42, 0.42, 0.43, 0.04) + self._box(0.42, 0.42, 0.04, 0, 0, 0.43)
                return seat + self._box(0.42, 0.04, 0.45, 0, 0.19, 0.47)
            case "cup":
                return self._round(0.045, 0.11, 0)
            case "tv":
                return self._box(1.1, 0.07, 0.64, 0, 0, 0)
            case "suitcase":
                return self._box(0.5, 0.25, 0.7, 0, 0, 0)
            case "plant":
                foliage = self._o3d.geometry.TriangleMesh.create_sphere(0.3, 12)
                return self._round(0.17, 0.35, 0) + foliage.translate([0, 0, 0.62])
        raise ValueError(f"no such shape: {shape}")


def write_room_recording(  # one knob a line: each is a property of the world or of the rig
    path: Path,
    *,
    seed: int = 0,
    seconds: float = 12.0,
    rate_hz: float = 5.0,
    rig: Rig = "rgbd",
    without: frozenset[str] = frozenset(),
    changes: Mapping[str, tuple[float, float, float]] | None = None,
    phase: float = 0.0,
    T_world_odom: np.ndarray | None = None,
    start_ns: int = START_NS,
    noise: float = 1.0,
) -> RoomTruth:
    """Write an `.mcap` and return its ground truth.

    `without` names things to leave out; `changes` maps names (also of the spare things: "suitcase", "chair-5") to
    (x, y, yaw) where they stand instead. `noise` scales the noise of depth, LiDAR (2 cm) and detections; 0 = none.
    """
    room = Room(furnish(without, changes))
    drive = Drive(seconds, phase)
    rng = np.random.default_rng(seed)
    if rig == "lidar":
        T_world_odom = drive.T_world_base(0.0)
    truth = RoomTruth((), drive, start_ns, np.eye(4) if T_world_odom is None else T_world_odom)
    seen = np.zeros(len(room.things), int)
    with RoomBag(path) as bag:
        bag.write_static_transform("base_link", "camera_optical_frame", T_BASE_CAMERA, start_ns)
        if rig == "lidar":
            bag.write_static_transform("base_link", "lidar", T_BASE_LIDAR, start_ns)
            bag.write_static_transform("base_link", "imu", np.eye(4), start_ns)
        for time_s, kind in _schedule(seconds, rate_hz, rig):
            stamp_ns = start_ns + round(time_s * 1e9)
            if kind == "odom":
                bag.write_pose(stamp_ns, truth.T_odom_base(stamp_ns))
            elif kind == "imu":
                bag.write_imu(stamp_ns, *_imu(drive, time_s))
            elif kind == "lidar":
                bag.write_points(stamp_ns, *_scan(room, drive, time_s, rng, 0.02 * noise))
            else:
                seen += _write_image(bag, room, drive, time_s, stamp_ns, rig, rng, noise)
    objects = (
        TrueObject(thing.name, thing.label, box, int(frames))
        for thing, box, frames in zip(room.things, room.boxes, seen, strict=True)
    )
    return replace(truth, objects=tuple(objects))


def room_sweeps(seconds: float, *, seed: int = 0, noise_m: float = 0.02) -> tuple[list[Sweep], RoomTruth]:
    """The LiDAR rig's sweeps as values, without a recording, and the truth of its drive."""
    room, drive, rng = Room(furnish()), Drive(seconds), np.random.default_rng(seed)
    sweeps = []
    for k in range(int(seconds * LIDAR_RATE_HZ) - 1):
        points, offsets_s = _scan(room, drive, k / LIDAR_RATE_HZ, rng, noise_m)
        stamp_ns = START_NS + round(k / LIDAR_RATE_HZ * 1e9)
        stamps_ns = stamp_ns + np.round(offsets_s * 1e9).astype(np.int64)
        sweeps.append(Sweep(stamp_ns, "lidar", points, stamps_ns, T_BASE_LIDAR))
    return sweeps, RoomTruth((), drive, START_NS, drive.T_world_base(0.0))


def furnish(
    without: frozenset[str] = frozenset(), changes: Mapping[str, tuple[float, float, float]] | None = None
) -> tuple[Thing, ...]:
    """The things in the room, less some, others moved or added, as for `write_room_recording`."""
    changes = changes or {}
    placed = [thing for thing in THINGS if thing.name not in without]
    placed += [thing for thing in SPARE if thing.name in changes]
    moved = ((thing, changes.get(thing.name, (*thing.at[:2], thing.yaw))) for thing in placed)
    return tuple(replace(thing, at=(x, y, thing.at[2]), yaw=yaw) for thing, (x, y, yaw) in moved)


def _schedule(seconds: float, rate_hz: float, rig: Rig) -> Iterator[tuple[float, str]]:
    """What is measured when, in order of time."""
    rates = {"image": rate_hz, "odom": 4 * rate_hz} if rig == "rgbd" else {"image": rate_hz, "imu": 50.0}
    events = [(k / rate, kind) for kind, rate in rates.items() for k in range(int(seconds * rate))]
    if rig == "lidar":
        events += [(k / LIDAR_RATE_HZ, "lidar") for k in range(int(seconds * LIDAR_RATE_HZ) - 1)]
    return iter(sorted(events))


def render(room: Room, T_world_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the camera sees: depth (h, w) metres, the thing in each pixel (h, w), 0 = room, and rgb (h, w, 3) uint8."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].reshape(2, -1).astype(float)
    rays = np.column_stack([(u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL, np.ones(u.size)])
    origins = np.tile(T_world_camera[:3, 3], (u.size, 1))
    depth, thing, rgb = room.cast(origins, rays @ T_world_camera[:3, :3].T)
    depth = np.where(np.isfinite(depth), depth, 0)
    return depth.reshape(HEIGHT, WIDTH), thing.reshape(HEIGHT, WIDTH), rgb.reshape(HEIGHT, WIDTH, 3)


def noisy_depth(depth_m: np.ndarray, rng: np.random.Generator, noise: float = 1.0) -> np.ndarray:
    """Noise that grows with the square of the depth (6 mm at 2 m), and missing returns."""
    noisy = depth_m + rng.normal(0, 0.0015 * noise, depth_m.shape) * depth_m**2
    noisy[rng.random(depth_m.shape) < 0.02 * noise] = 0
    return noisy


def _write_image(
    bag: RoomBag,
    room: Room,
    drive: Drive,
    time_s: float,
    stamp_ns: int,
    rig: Rig,
    rng: np.random.Generator,
    noise: float,
) -> np.ndarray:
    """One image with depth, detections and masks; returns which things it shows."""
    depth_m, ids, rgb = render(room, drive.T_world_base(time_s) @ T_BASE_CAMERA)
    bag.write_camera_info(stamp_ns, WIDTH, HEIGHT, FOCAL)
    bag.write_colour(stamp_ns, rgb)
    if rig == "rgbd":
        bag.write_depth(stamp_ns, noisy_depth(depth_m, rng, noise))
    pixels = np.bincount(ids.ravel(), minlength=len(room.things) + 1)[1:]
    shown = pixels >= 60
    found = [k for k in np.flatnonzero(shown) if rng.random() >= 0.08 * noise]
    masks = [_eroded(ids == k + 1, int(rng.random() < 0.5 * noise)) for k in found]
    labels = [room.things[k].label for k in found]
    scores = [float(np.clip(0.85 + 0.07 * noise * rng.normal(), 0.3, 0.99)) for _ in found]
    bag.write_detections(stamp_ns, labels, [ALSO_LIKE.get(label) for label in labels], scores, masks)
    return shown


def _eroded(mask: np.ndarray, pixels: int) -> np.ndarray:
    for _ in range(pixels):
        inner = mask.copy()
        inner[1:] &= mask[:-1]
        inner[:-1] &= mask[1:]
        inner[:, 1:] &= mask[:, :-1]
        inner[:, :-1] &= mask[:, 1:]
        mask = inner if inner.sum() >= 20 else mask
    return mask


def _scan(
    room: Room, drive: Drive, time_s: float, rng: np.random.Generator, noise_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """One revolution: points (n, 3) in the LiDAR's frame, each as seen from its own pose, and offsets (n,) seconds."""
    elevation = np.radians(LIDAR_BEAMS_DEG)[None, :]
    columns = np.arange(LIDAR_COLUMNS)
    azimuth = -2 * np.pi * columns[:, None] / LIDAR_COLUMNS
    flat = np.cos(elevation)
    height = np.broadcast_to(np.sin(elevation), (LIDAR_COLUMNS, len(LIDAR_BEAMS_DEG)))
    beams = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), height], axis=-1)
    offsets_s = columns / LIDAR_COLUMNS / LIDAR_RATE_HZ
    T_world_lidar = np.array([drive.T_world_base(time_s + offset_s) @ T_BASE_LIDAR for offset_s in offsets_s])
    origins = np.broadcast_to(T_world_lidar[:, None, :3, 3], beams.shape)
    directions = np.einsum("cij,cbj->cbi", T_world_lidar[:, :3, :3], beams)
    distance, _, _ = room.cast(origins.reshape(-1, 3), directions.reshape(-1, 3))
    hit = np.isfinite(distance)
    distance = distance[hit] + rng.normal(0, noise_m, int(hit.sum()))
    return beams.reshape(-1, 3)[hit] * distance[:, None], np.repeat(offsets_s, len(LIDAR_BEAMS_DEG))[hit]


def _imu(drive: Drive, time_s: float, step_s: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Angular rate and specific force in the base frame, by central differences of the true motion."""
    before, here, after = (drive.T_world_base(time_s + k * step_s) for k in (-1, 0, 1))
    acceleration = (before[:3, 3] - 2 * here[:3, 3] + after[:3, 3]) / step_s**2
    turn = before[:3, :3].T @ after[:3, :3]
    rate = np.array([0, 0, np.arctan2(turn[1, 0], turn[0, 0]) / (2 * step_s)])
    return rate, here[:3, :3].T @ (acceleration + np.array([0, 0, 9.81]))


def write_visit(path: Path, visit: int, *, seed: int = 0, rig: Rig = "rgbd", seconds: float = 12.0) -> RoomTruth:
    """Two visits a day apart: in the second cup-2 is gone, chair-3 stands elsewhere, and a suitcase has come."""
    if visit == 1:
        return write_room_recording(path, seed=seed, rig=rig, seconds=seconds)
    start_ns = START_NS + (visit - 1) * DAY_NS
    return write_room_recording(
        path, seed=seed, rig=rig, seconds=seconds, phase=2.0, start_ns=start_ns, without=GONE, changes=CHANGED
    )


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--visit", type=int, choices=(1, 2), default=1)
    parser.add_argument("--rig", choices=("rgbd", "lidar"), default="rgbd")
    parser.add_argument("--seconds", type=float, default=12.0)
    chosen = parser.parse_args()
    write_visit(chosen.path, chosen.visit, seed=chosen.seed, rig=chosen.rig, seconds=chosen.seconds)


if __name__ == "__main__":
    main()
