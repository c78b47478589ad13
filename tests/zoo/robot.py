"""What a robot records, as plain values: which topics, in which frames, of which types and encodings.

A variant is a `Robot` with what its driver does otherwise. Topics of the roles (`cameras`, `lidar`, `motion`, `found`)
are what `inspect` is expected to choose; `others` are recorded beside them and must not be chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from zoo.scene import HEIGHT, WIDTH


@dataclass(frozen=True)
class Image:
    """A topic of images. `info` is its CameraInfo's topic: "beside" it, or "" for none.

    `content` is what it shows: "color", "depth", "grey" (of any other camera) or "masks". `offset` is the place of its
    camera in the main camera's optical frame, metres; `scale` multiplies depth that is written in a unit of its own.
    """

    topic: str
    frame: str
    encoding: str = "rgb8"
    info: str = "beside"
    content: str = "color"
    size: tuple[int, int] = (WIDTH, HEIGHT)
    offset: tuple[float, float, float] = (0, 0, 0)
    model: str = "plumb_bob"
    distortion: tuple[float, ...] = ()
    late_ns: int = 0
    scale: float = 1.0
    padding: int = 0
    every: int = 1
    info_frame: str | None = None
    info_zero_k: bool = False
    info_size: tuple[int, int] | None = None
    info_once: bool = False
    info_zero_size: bool = False


@dataclass(frozen=True)
class Camera:
    """A colour camera and its depth. `body` is the frame of its housing, "" for none: between base and optical frame.

    `id` is what `inspect` calls it beside others; `yaw_deg` turns it on the robot, away from the suitcase.
    """

    color: Image
    depth: Image | None = None
    body: str = ""
    yaw_deg: float = 0.0
    id: str = ""


@dataclass(frozen=True)
class Cloud:
    """A LiDAR's topic. `fields` are names and numpy types of a point after x, y, z ("_" are bytes unused).

    `time` is how a point says its time: a unit of seconds since the sweep's begin ("s", "ms", "us", "ns"), "absolute"
    (s), "absolute_ns", "until_end" (negative seconds, the stamp is that of the end), or "" for none. `msgtype` is
    PointCloud2, or Livox's CustomMsg.
    """

    topic: str
    frame: str
    fields: tuple[tuple[str, str], ...] = ()
    time: str = ""
    msgtype: str = "sensor_msgs/msg/PointCloud2"
    xyz: str = "f4"
    clock_s: float = 0.0
    organized: bool = False
    big_endian: bool = False


@dataclass(frozen=True)
class Motion:
    """How the motion is recorded: `kind` is "odometry", "pose", "pose_covariance", "transform", or "tf" alone."""

    topic: str = "/odom"
    kind: str = "odometry"
    frame: str = "odom"
    child: str = "base_link"
    tf: bool = False
    offset: tuple[float, float, float] = (0, 0, 0)


@dataclass(frozen=True)
class Found:
    """A topic of detections of the main camera. `label` is what is written; `late_ns` is later than the image."""

    topic: str = "/detections"
    msgtype: str = "vision_msgs/msg/Detection2DArray"
    label: str = "suitcase"
    frame: str | None = None
    late_ns: int = 0


DARKNET = Found("/darknet_ros/bounding_boxes", "darknet_ros_msgs/msg/BoundingBoxes", late_ns=60_000_000)
"""What stands in for vision_msgs in ROS 1 bags, whose labels are numbers there."""


@dataclass(frozen=True)
class Imu:
    """An IMU's topic; `unit` is metres a second squared of its readings' unit."""

    topic: str
    frame: str
    unit: float = 1.0


@dataclass(frozen=True)
class Other:
    """A topic of a type that is not read; its messages hold nothing."""

    topic: str
    msgtype: str


@dataclass(frozen=True)
class Robot:
    """All that is recorded.

    `base` is the frame under which TF places the sensors, if `static`; with `mountings_move` on /tf, again and again.
    `namespace` stands before /tf and /tf_static; `links` are frames that are one, parent to child; `shift_ns` is added
    to all stamps.
    """

    cameras: tuple[Camera, ...]
    motion: Motion | None = Motion()
    lidar: Cloud | None = None
    imu: Imu | None = None
    found: Found | None = Found()
    others: tuple[Image | Cloud | Motion | Imu | Found | Other, ...] = ()
    base: str = "base_link"
    namespace: str = ""
    static: bool = True
    links: Mapping[str, str] = field(default_factory=dict)
    mountings_move: bool = False
    shift_ns: int = 0


@dataclass(frozen=True)
class Variant:
    """One recording of the zoo and what becomes of it.

    `options` are those of `inspect` and `build`, as typed; `refused` is the line that both end with ("{path}" stands
    for the file, " ..." for an end that is left open), and "" for a map. `notes` are parts of warnings that must be
    there; `roles` are what is expected besides what `robot` says, role to topic ("" for none). `damage` changes the
    file that was written; `write` writes what has no place in a `Robot`, `writer` are options of `ZooBag`. `source`
    documents what the driver does.
    """

    name: str
    robot: Robot
    source: str
    suffix: str = ".mcap"
    options: tuple[str, ...] = ()
    refused: str = ""
    notes: tuple[str, ...] = ()
    roles: Mapping[str, str] = field(default_factory=dict)
    damage: Callable[[Path], Path] | None = None
    writer: Mapping[str, object] = field(default_factory=dict)
    write: Callable[[Path], None] | None = None
    tolerance_m: float = 0.12

    def __post_init__(self) -> None:
        if self.suffix == ".bag" and self.robot.found == Found():
            object.__setattr__(self, "robot", replace(self.robot, found=DARKNET))
