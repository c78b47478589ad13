"""Camera models from `sensor_msgs/CameraInfo` (REP-104): distortion, region of interest, binning, rectification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import Camera, EquirectangularCamera, FisheyeCamera, PinholeCamera
from supermap_cli.recordings.messages import CalibrationMessage

MODELS = ("plumb_bob", "rational_polynomial", "equidistant", "equirectangular")
"""Distortion models to name in errors (sensor_msgs/distortion_models.h; "equirectangular" is this program's own)."""

_PERSPECTIVE = {"plumb_bob": 5, "rational_polynomial": 8, "radtan": 5, "pinhole": 5, "none": 0, "": 5}
"""Perspective distortion models and how many coefficients each has (sensor_msgs/CameraInfo, D)."""
_FISHEYE = {"equidistant", "fisheye", "kannala_brandt", "kannala_brandt4"}
"""Names of the fisheye model with four coefficients (Kannala and Brandt 2006, as in OpenCV's fisheye module)."""
_ASPECT_TOLERANCE = 0.01
"""Share by which the scales of width and height may differ: rounding to whole pixels, at 100 pixels and more."""


def camera_from_calibration(
    calibration: CalibrationMessage, image_size: tuple[int, int], rectified: bool = False
) -> Camera:
    """The camera of images of `image_size` (width, height); `rectified` images follow P and have no distortion.

    Where K is zero and P is not, P counts, as in ROS's `image_geometry`: drivers of rectified images fill it alone.
    K is that of the full image: the region of interest moves the principal point, then binning divides all of it, as in
    ROS's `image_geometry`; an image that is still of another size (a scaled stream) scales it once more, if its
    aspect is the same. Raises `CalibrationError`; the caller adds the topic.
    """
    model = calibration.model.strip().lower()
    if model == "equirectangular":
        return panorama_camera(image_size)
    only_p = not has_intrinsics(calibration.K)
    rectified = rectified or only_p
    matrix = calibration.P[:, :3] if only_p or (rectified and calibration.P[0, 0] > 0) else calibration.K
    fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    if not has_intrinsics(matrix):
        raise CalibrationError(
            "the camera is not calibrated (K is zero)", cure="calibrate it, or name a calibrated topic with --topic"
        )
    x, y, width, height = calibration.roi
    width, height = width or calibration.width, height or calibration.height
    across, down = calibration.binning
    fx, fy, cx, cy = fx / across, fy / down, (cx - x) / across, (cy - y) / down
    scale_u, scale_v = _scale((width // across, height // down), image_size)
    fx, fy, cx, cy = fx * scale_u, fy * scale_v, (cx + 0.5) * scale_u - 0.5, (cy + 0.5) * scale_v - 0.5
    intrinsics = PinholeCamera(*image_size, fx, fy, cx, cy)
    distortion = () if rectified or not np.isfinite(calibration.D).all() else calibration.D
    if model in _FISHEYE:
        return FisheyeCamera(*image_size, fx, fy, cx, cy, _distortion(distortion, 4) if any(distortion) else ())
    if not any(distortion):
        return intrinsics
    if model not in _PERSPECTIVE:
        raise CalibrationError(
            f"unknown distortion model {calibration.model!r}",
            cure=f"rectify the images, or give one of {', '.join(MODELS)}",
        )
    length = 8 if len(distortion) > 5 else _PERSPECTIVE[model]
    return replace(intrinsics, distortion=_distortion(distortion, length))


def panorama_camera(image_size: tuple[int, int]) -> EquirectangularCamera:
    """The camera of full panoramas of `image_size` (width, height), which are twice as wide as high: 360 by 180
    degrees. Raises `CalibrationError` for another shape; the caller adds the topic.
    """
    width, height = image_size
    if abs(width / (2 * height) - 1) > _ASPECT_TOLERANCE:
        raise CalibrationError(
            f"an image of {width} x {height} pixels is no full panorama: one of 360 x 180 degrees is twice as wide as "
            "high",
            cure="leave out --camera equirectangular, name the images' camera_info with --topic camera_info=/..., or "
            "record the panorama whole",
        )
    return EquirectangularCamera(width, height)


def is_calibrated(calibration: CalibrationMessage) -> bool:
    """Whether a camera_info says anything: it is zero until a driver has read the calibration."""
    panorama = calibration.model.strip().lower() == "equirectangular"
    return panorama or has_intrinsics(calibration.K) or has_intrinsics(calibration.P[:, :3])


def has_intrinsics(matrix: FloatArray) -> bool:
    """Whether the focal lengths of a camera matrix (3, 3) are positive, and it is finite."""
    return bool(np.isfinite(matrix).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0)


def _distortion(values: tuple[float, ...], length: int) -> tuple[float, ...]:
    if any(values[length:]):
        raise CalibrationError(
            f"a distortion of {len(values)} values, of which only {length} are understood", cure="rectify the images"
        )
    return (*values[:length], *(0.0,) * (length - len(values)))


def _scale(calibrated: tuple[int, int], images: tuple[int, int]) -> tuple[float, float]:
    """How much larger the images are than what was calibrated; (0, 0) stands for an unknown size."""
    if 0 in calibrated:
        return 1.0, 1.0
    scale_u, scale_v = images[0] / calibrated[0], images[1] / calibrated[1]
    if abs(scale_u / scale_v - 1) > _ASPECT_TOLERANCE:
        raise CalibrationError(
            f"the calibration is for {calibrated[0]} x {calibrated[1]} pixels, the image has {images[0]} x {images[1]}",
            cure="name the camera_info that belongs to the image with --topic camera_info=/...",
        )
    return scale_u, scale_v
