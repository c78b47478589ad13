"""A keyframe: an image, its depth, and the camera's pose in the map."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.geometry.arrays import Float32Array, FloatArray, UInt8Array, check_shape
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import check_transform
from supermap_cli.types.sensing import MAIN_CAMERA


@dataclass(frozen=True)
class Keyframe:
    """An image with depth and pose.

    `rgb` (h, w, 3) uint8; `depth_m` (h, w) float32 in the measure of `Camera.depth_of`, 0 = no return;
    `T_map_camera` and `T_map_base` at the image's stamp. `returns_camera` (n, 3) are the LiDAR's returns that the depth
    was rendered from, in the optical frame; `None` where the depth is a camera's own. `camera_id` names the camera.
    """

    stamp_ns: int
    rgb: UInt8Array
    depth_m: Float32Array
    camera: Camera
    T_map_camera: FloatArray
    T_map_base: FloatArray
    returns_camera: FloatArray | None = None
    camera_id: str = MAIN_CAMERA

    def __post_init__(self) -> None:
        check_shape("rgb", self.rgb, (self.camera.height, self.camera.width, 3))
        check_shape("depth_m", self.depth_m, (self.camera.height, self.camera.width))
        if self.returns_camera is not None:
            check_shape("returns_camera", self.returns_camera, (None, 3))
        check_transform("T_map_camera", self.T_map_camera)
        check_transform("T_map_base", self.T_map_base)
