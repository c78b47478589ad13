"""The simulated robots: which sensors they carry, where, and how good these are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.types.sensing import MAIN_CAMERA

RIGS: dict[str, str] = {
    "rgbd": "one RGB-D camera, 640 x 480 pixels, 69 degrees wide",
    "small-rgbd": "one RGB-D camera, 400 x 300 pixels, 69 degrees wide, that detects in every image, at 5 Hz",
    "panorama": "a 360-degree camera above a Livox Mid-360",
    "three-cameras": "three such RGB-D cameras on one trigger: ahead and 75 degrees to the left and to the right",
    "front-camera": "of these three the one that looks ahead, alone",
    "left-camera": "of these three the left one, alone",
    "right-camera": "of these three the right one, alone",
}
"""What each rig is, by name."""

SIDE_CAMERA_YAW_DEG = 75.0
"""How far a side camera is turned from straight ahead: its view (69 degrees) begins 6 degrees beside that of the front
camera, as on robots that spread three cameras over their front half.
"""


@dataclass(frozen=True)
class DepthSensor:
    """A depth camera on the colour camera's pixels.

    Noise grows with the square of the depth, sigma = `noise_per_m` z^2 (structured light and stereo; Khoshelham and
    Elberink 2012 give 1.4 to 2.9 mm at 1 m for Kinect v1); nothing is returned nearer than `nearest_m`, farther than
    `farthest_m`, where the surface is more slanted than `steepest_deg`, or, mostly, beside depth edges.

    Within `edge_px` pixels of an edge the share `edge_holes` returns nothing and `edge_mixed` a mean of both surfaces;
    where the edges `flicker`, whole patches of the others return one surface or the other, drawn anew in every image.
    `noise_m` is noise that does not grow (time of flight), and `noise_px` how wide a patch of equal noise is (0: each
    pixel has its own). `multipath_share` of the depth is added, in patches, where light came over a second surface.
    `blind_patches` leaves patches without return, few where there is texture, many on far surfaces that have none.
    """

    noise_per_m: float = 0.0015
    nearest_m: float = 0.3
    farthest_m: float = 8.0
    steepest_deg: float = 82.0
    edge_px: int = 1
    lost_share: float = 0.005
    edge_holes: float = 0.7
    edge_mixed: float = 0.08
    flicker: bool = False
    noise_m: float = 0.0
    noise_px: int = 0
    multipath_share: float = 0.0
    blind_patches: bool = False


@dataclass(frozen=True)
class Lidar:
    """A Livox-Mid-360-like LiDAR: a pattern that does not repeat, 360 degrees round, -7 to 52 degrees up; or, with
    `rings`, a scanner that turns so many beams, evenly apart from the lowest to the highest elevation, once a scan.
    """

    points_per_scan: int = 20_000
    rate_hz: float = 10.0
    lowest_deg: float = -7.0
    highest_deg: float = 52.0
    noise_m: float = 0.02
    nearest_m: float = 0.1
    farthest_m: float = 40.0
    rings: int = 0


@dataclass(frozen=True)
class Imu:
    """Gravity and motion in the base frame with white noise (per sample) and constant biases (drawn once)."""

    rate_hz: float = 100.0
    gyro_noise: float = 0.002
    gyro_bias: float = 0.002
    accelerometer_noise: float = 0.02
    accelerometer_bias: float = 0.03


@dataclass(frozen=True)
class OdometryDrift:
    """How the robot's own odometry leaves the truth: a scale error and random walks over the way it went.

    `position` metres and `yaw_deg` degrees are the standard deviations of the walks after one metre; `per_turn_deg`
    is that of the heading after one full turn; `scale` that of the constant scale error; `jitter_m` and `jitter_deg`
    are white noise of single poses.

    `share` scales all but the jitter so that the last pose is off by this share of the way. `turned_deg_per_m` is a
    constant heading error, to the left or to the right. Once, `jump_m` aside, the pose jumps and turns by `jump_deg`.
    """

    rate_hz: float = 20.0
    position: float = 0.006
    yaw_deg: float = 0.08
    per_turn_deg: float = 0.25
    scale: float = 0.002
    jitter_m: float = 0.001
    jitter_deg: float = 0.0
    share: float = 0.0
    turned_deg_per_m: float = 0.0
    jump_m: float = 0.0
    jump_deg: float = 0.0


@dataclass(frozen=True)
class SimulatedCamera:
    """A camera of a rig, and the names under which its driver publishes.

    `T_base_camera` (4, 4) is the mounting of the optical frame `frame_id`. `color_namespace` and `depth_namespace` hold
    an image topic and a camera_info each (`None`: no depth camera); the detector of its images publishes to
    `detections_topic`, and their masks below it.
    """

    camera_id: str
    model: PinholeCamera | EquirectangularCamera
    T_base_camera: FloatArray
    frame_id: str
    color_namespace: str
    depth_namespace: str | None
    detections_topic: str


@dataclass(frozen=True)
class SimulatedRig:
    """A robot. `T_base_*` place the sensors in the base (x forward, z up, origin on the floor).

    All cameras expose at once, at `image_rate_hz`, and give their images one stamp, as cameras do that share a hardware
    trigger and a clock; the detector gets every `detection_every`-th image of each. `depth` is the depth sensor of all,
    and takes its images `depth_delay_s` after those in colour. A rig that a person carries turns about a point
    `carried_m` above the floor; `None`: it drives.
    """

    name: str
    cameras: tuple[SimulatedCamera, ...]
    image_rate_hz: float
    detection_every: int
    depth: DepthSensor | None
    lidar: Lidar | None
    T_base_lidar: FloatArray | None
    imu: Imu | None
    T_base_imu: FloatArray
    drift: OdometryDrift
    depth_delay_s: float = 0.0
    carried_m: float | None = None

    def camera(self, camera_id: str) -> SimulatedCamera:
        """The camera of an id."""
        return next(camera for camera in self.cameras if camera.camera_id == camera_id)


def make_rig(name: str) -> SimulatedRig:
    """The rig of a name. Raises `SimulationError` for an unknown one."""
    if name not in _MAKERS:
        raise SimulationError(f"there is no rig {name!r}", cure=f"choose one of {', '.join(RIGS)}")
    return _MAKERS[name]()


def rgbd_rig() -> SimulatedRig:
    """A 640x480 RGB-D camera (69 degrees wide), 1.1 m up, tilted down by 12 degrees; detections at 5 Hz."""
    return _rgbd_rig("rgbd", {MAIN_CAMERA: 0.0})


def small_rgbd_rig() -> SimulatedRig:
    """As `rgbd_rig`, with 400x300 pixels and every image detected, at 5 Hz: the usual rig of the scenario `room`, whose
    many worlds are to be simulated in a short time.
    """
    rig = rgbd_rig()
    camera = replace(rig.cameras[0], model=PinholeCamera(400, 300, 290.625, 290.625, 199.5, 149.5))
    return replace(rig, name="small-rgbd", cameras=(camera,), image_rate_hz=5.0, detection_every=1)


def three_camera_rig() -> SimulatedRig:
    """Three RGB-D cameras as that of `rgbd_rig`, "front", "left" and "right", on a circle about the base's axis."""
    return _rgbd_rig("three-cameras", _THREE_YAWS_DEG)


def panorama_rig() -> SimulatedRig:
    """The paper's rig: a 360-degree panorama above a Livox Mid-360, on a small robot; detections at 5 Hz."""
    camera = SimulatedCamera(
        camera_id=MAIN_CAMERA,
        model=EquirectangularCamera(1440, 720),
        T_base_camera=make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, 0.95]),
        frame_id="panorama_optical_frame",
        color_namespace="/panorama",
        depth_namespace=None,
        detections_topic="/detections",
    )
    return SimulatedRig(
        name="panorama",
        cameras=(camera,),
        image_rate_hz=5.0,
        detection_every=1,
        depth=None,
        lidar=Lidar(),
        T_base_lidar=make_transform(np.eye(3), [0.08, 0.0, 0.75]),
        imu=Imu(),
        T_base_imu=make_transform(np.eye(3), [0.08, 0.0, 0.75]),
        drift=OdometryDrift(),
    )


_THREE_YAWS_DEG = {"front": 0.0, "left": SIDE_CAMERA_YAW_DEG, "right": -SIDE_CAMERA_YAW_DEG}


def _rgbd_rig(name: str, yaws_deg: Mapping[str, float]) -> SimulatedRig:
    """A robot with RGB-D cameras turned by some angles from straight ahead, by `camera_id`."""
    return SimulatedRig(
        name=name,
        cameras=tuple(_rgbd_camera(camera_id, yaw_deg) for camera_id, yaw_deg in yaws_deg.items()),
        image_rate_hz=10.0,
        detection_every=2,
        depth=DepthSensor(),
        lidar=None,
        T_base_lidar=None,
        imu=Imu(),
        T_base_imu=make_transform(np.eye(3), [0.0, 0.0, 0.3]),
        drift=OdometryDrift(),
    )


def _rgbd_camera(camera_id: str, yaw_deg: float) -> SimulatedCamera:
    """An RGB-D camera 0.12 m from the base's axis, named as realsense2_camera does: by its own name where there are
    several.
    """
    sin, cos = np.sin(np.radians(12)), np.cos(np.radians(12))
    T_base_camera = make_transform([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]], [0.12, 0.0, 1.1])
    name = "camera" if camera_id == MAIN_CAMERA else f"camera_{camera_id}"
    return SimulatedCamera(
        camera_id=camera_id,
        model=PinholeCamera(640, 480, 465.0, 465.0, 319.5, 239.5),
        T_base_camera=_turned_left(yaw_deg) @ T_base_camera if yaw_deg else T_base_camera,
        frame_id=f"{name}_color_optical_frame",
        color_namespace=f"/{name}/color",
        depth_namespace=f"/{name}/aligned_depth_to_color",
        detections_topic="/detections" if camera_id == MAIN_CAMERA else f"/{name}/detections",
    )


def _turned_left(yaw_deg: float) -> FloatArray:
    """A turn (4, 4) about the base's vertical axis."""
    sin, cos = np.sin(np.radians(yaw_deg)), np.cos(np.radians(yaw_deg))
    return make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [0.0, 0.0, 0.0])


def _one_of_three(camera_id: str) -> Callable[[], SimulatedRig]:
    return lambda: _rgbd_rig(f"{camera_id}-camera", {camera_id: _THREE_YAWS_DEG[camera_id]})


_MAKERS: Mapping[str, Callable[[], SimulatedRig]] = {
    "rgbd": rgbd_rig,
    "small-rgbd": small_rgbd_rig,
    "panorama": panorama_rig,
    "three-cameras": three_camera_rig,
    "front-camera": _one_of_three("front"),
    "left-camera": _one_of_three("left"),
    "right-camera": _one_of_three("right"),
}
