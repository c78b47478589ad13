"""Camera models behind one interface. Pixels (u, v), optical frame z forward, x right, y down (REP-103).

Pixel centres have integer coordinates: the image covers u in [-0.5, width - 0.5). Distortion follows OpenCV, whose
models ROS's `sensor_msgs/CameraInfo` names "plumb_bob", "rational_polynomial" and "equidistant".
"""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, fields
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.polynomial import Polynomial

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray

_CURE = "publish the calibration that the camera's driver gives, or name another camera_info topic"
_STORED_CURE = "run `supermap db check`"

_MIN_DEPTH_M = 1e-6
"""Metres: points nearer than this, or behind the camera, are not projected."""
_NEWTON_STEPS, _NEWTON_TOLERANCE = 20, 1e-10
"""Undistortion: at most so many steps of Newton's method, until a step is smaller (normalised image coordinates)."""
_MAX_TAN = math.tan(math.radians(89.5))
"""Tangent of the widest angle to the axis that a pinhole can have."""


class Camera(Protocol):
    """A calibrated camera: `project` and `back_project` are inverse to each other where a pixel is valid."""

    @property
    def width(self) -> int:
        """Pixels across."""
        ...

    @property
    def height(self) -> int:
        """Pixels down."""
        ...

    @property
    def full_turn(self) -> bool:
        """Whether the image goes all the way round: its left border is its right one."""
        ...

    def __hash__(self) -> int: ...

    def project(self, points_camera: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(n, 3) points in the optical frame -> ((n, 2) pixels u, v; (n,) which of them fall on the image)."""
        ...

    def depth_of(self, points_camera: FloatArray) -> FloatArray:
        """(n,) depth of (n, 3) points in this camera's measure: z for perspective cameras, range for panoramas."""
        ...

    def back_project(self, pixels_uv: FloatArray, depth_m: FloatArray) -> FloatArray:
        """(n, 2) pixels and (n,) depths in the measure of `depth_of` -> (n, 3) points in the optical frame."""
        ...

    def rays(self) -> Float32Array:
        """(height, width, 3) float32 such that point = ray * depth; NaN where a pixel sees nothing."""
        ...

    def valid_mask(self) -> BoolArray:
        """(height, width) which pixels see the world (inside a fisheye's circle, say)."""
        ...

    def widest_angle(self) -> float:
        """No point farther than this from the optical axis, in radians, falls on the image."""
        ...

    def focal_px(self) -> float:
        """Pixels per radian at the image's centre: how large an object of a given size looks."""
        ...


class _PixelRays(ABC):
    """What every model offers besides: the rays of all its pixels, computed once.

    `rays()` is (height, width, 3) float32 such that point = ray * depth; NaN where a pixel sees nothing. `valid_mask()`
    follows from it.
    """

    width: int
    height: int

    @property
    def full_turn(self) -> bool:
        """See `Camera.full_turn`."""
        return False

    @abstractmethod
    def back_project(self, pixels_uv: FloatArray, depth_m: FloatArray) -> FloatArray:
        """See `Camera.back_project`; NaN for pixels that see nothing."""

    @cached_property
    def _rays(self) -> Float32Array:
        u, v = np.meshgrid(np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64))
        pixels = np.column_stack([u.ravel(), v.ravel()])
        rays = self.back_project(pixels, np.ones(len(pixels))).astype(np.float32).reshape(self.height, self.width, 3)
        rays.flags.writeable = False
        return rays

    @cached_property
    def _valid(self) -> BoolArray:
        valid: BoolArray = np.isfinite(self._rays[..., 2])
        valid.flags.writeable = False
        return valid

    def rays(self) -> Float32Array:
        """(height, width, 3) float32, point = ray * depth; NaN outside `valid_mask`. Read only, computed once."""
        return self._rays

    def valid_mask(self) -> BoolArray:
        """(height, width) which pixels see the world. Read only, computed once."""
        return self._valid

    @cached_property
    def _widest_angle(self) -> float:
        u, v = np.arange(self.width + 1) - 0.5, np.arange(self.height + 1) - 0.5
        across, down = np.ones_like(u), np.ones_like(v)
        sides = [
            *(np.column_stack([u, across * edge]) for edge in (v[0], v[-1])),
            *(np.column_stack([down * edge, v]) for edge in (u[0], u[-1])),
        ]
        border = np.concatenate(sides)
        rays = self.back_project(border, np.ones(len(border)))
        if not np.isfinite(rays).all():
            return math.pi
        cosine = float((rays[:, 2] / np.linalg.norm(rays, axis=1)).min())
        return min(math.acos(max(cosine, -1.0)) + math.radians(1), math.pi)

    def widest_angle(self) -> float:
        """See `Camera.widest_angle`: that of the border and a degree; any, if the border sees nothing."""
        return self._widest_angle

    def _on_image(self, u: FloatArray, v: FloatArray) -> BoolArray:
        return (u >= -0.5) & (u < self.width - 0.5) & (v >= -0.5) & (v < self.height - 0.5)


def _smallest_positive_root(polynomial: Polynomial) -> float:
    roots = polynomial.trim().roots()
    real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))].real
    positive = real[real > 1e-12]
    return float(positive.min()) if len(positive) else math.inf


@dataclass(frozen=True)
class PinholeCamera(_PixelRays):
    """A perspective camera; focal lengths and principal point in pixels.

    `distortion` is () for none, (k1, k2, p1, p2[, k3]) for plumb_bob or (k1, k2, p1, p2, k3, k4, k5, k6) for
    rational_polynomial (OpenCV's order). Depth is z.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        _check_intrinsics(self.width, self.height, (self.fx, self.fy, self.cx, self.cy, *self.distortion))
        if len(self.distortion) not in {0, 4, 5, 8}:
            what = f"a pinhole camera has 0, 4, 5 or 8 distortion values, not {len(self.distortion)}"
            raise CalibrationError(what, cure=_CURE)

    @cached_property
    def _coefficients(self) -> tuple[float, ...] | None:
        """All eight values of the rational model; `None` when there is no distortion at all."""
        if not any(self.distortion):
            return None
        return self.distortion + (0.0,) * (8 - len(self.distortion))

    @cached_property
    def _largest_r2(self) -> float:
        """Where the radial polynomial folds back: the first r^2 at which d(r f(r^2))/dr = 0 or f has a pole."""
        if self._coefficients is None:
            return math.inf
        k1, k2, _, _, k3, k4, k5, k6 = self._coefficients
        numerator, denominator = Polynomial([1, k1, k2, k3]), Polynomial([1, k4, k5, k6])
        s = Polynomial([0, 1])
        slope = numerator * denominator + 2 * s * (numerator.deriv() * denominator - numerator * denominator.deriv())
        return min(_smallest_positive_root(slope), _smallest_positive_root(denominator))

    def _distort(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self._coefficients is None:
            return x, y
        k1, k2, p1, p2, k3, k4, k5, k6 = self._coefficients
        s = x * x + y * y
        radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
        return (
            x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x),
            y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y,
        )

    def project(self, points_camera: FloatArray) -> tuple[FloatArray, BoolArray]:
        """See `Camera.project`; points behind the camera or beyond the distortion's fold are not on the image."""
        x, y, z = points_camera[:, 0], points_camera[:, 1], points_camera[:, 2]
        seen = z > _MIN_DEPTH_M
        depth = np.where(seen, z, 1.0)
        x, y = x / depth, y / depth
        if self._coefficients is not None:
            seen &= x * x + y * y < self._largest_r2
            x, y = self._distort(np.where(seen, x, 0.0), np.where(seen, y, 0.0))
        u, v = self.fx * x + self.cx, self.fy * y + self.cy
        return np.column_stack([u, v]), seen & self._on_image(u, v)

    def depth_of(self, points_camera: FloatArray) -> FloatArray:
        """The z coordinate."""
        return points_camera[:, 2]

    def back_project(self, pixels_uv: FloatArray, depth_m: FloatArray) -> FloatArray:
        """See `Camera.back_project`; NaN where no ray falls on the pixel (beyond the distortion's fold)."""
        x, y = (pixels_uv[:, 0] - self.cx) / self.fx, (pixels_uv[:, 1] - self.cy) / self.fy
        if self._coefficients is not None:
            x, y = self._undistort(x, y)
            depth_m = np.where(np.isfinite(x), depth_m, np.nan)
        return np.column_stack([x * depth_m, y * depth_m, depth_m])

    def _undistort(self, x_distorted: FloatArray, y_distorted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Invert `_distort` by Newton's method with a numerical 2x2 Jacobian; NaN where it finds no ray."""
        x, y = x_distorted.copy(), y_distorted.copy()
        step = 1e-6
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                dx, dy = self._distort(x, y)
                error_x, error_y = dx - x_distorted, dy - y_distorted
                if not (np.hypot(error_x, error_y) > _NEWTON_TOLERANCE).any():
                    break
                ax, ay = self._distort(x + step, y)
                bx, by = self._distort(x, y + step)
                j00, j10, j01, j11 = (ax - dx) / step, (ay - dy) / step, (bx - dx) / step, (by - dy) / step
                det = j00 * j11 - j01 * j10
                x -= np.clip((j11 * error_x - j01 * error_y) / det, -0.5, 0.5)
                y -= np.clip((j00 * error_y - j10 * error_x) / det, -0.5, 0.5)
            dx, dy = self._distort(x, y)
            found = (np.hypot(dx - x_distorted, dy - y_distorted) < 1e-6) & (x * x + y * y < self._largest_r2)
        return np.where(found, x, np.nan), np.where(found, y, np.nan)

    def focal_px(self) -> float:
        """The mean of fx and fy."""
        return (self.fx + self.fy) / 2


@dataclass(frozen=True)
class FisheyeCamera(_PixelRays):
    """An equidistant (Kannala-Brandt) fisheye, OpenCV's `cv2.fisheye`:
    theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).

    `distortion` is () or (k1, k2, k3, k4). Depth is z, so only rays less than 89.5 degrees off the axis are used.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        _check_intrinsics(self.width, self.height, (self.fx, self.fy, self.cx, self.cy, *self.distortion))
        if len(self.distortion) not in {0, 4}:
            what = f"an equidistant camera has 0 or 4 distortion values, not {len(self.distortion)}"
            raise CalibrationError(what, cure=_CURE)

    @cached_property
    def _largest_theta(self) -> float:
        """The smaller of 89.5 degrees and where the polynomial folds back."""
        if not self.distortion:
            return math.atan(_MAX_TAN)
        k1, k2, k3, k4 = self.distortion
        fold = _smallest_positive_root(Polynomial([1, 3 * k1, 5 * k2, 7 * k3, 9 * k4]))
        return min(math.sqrt(fold), math.atan(_MAX_TAN))

    def _distorted(self, theta: FloatArray) -> FloatArray:
        k1, k2, k3, k4 = self.distortion or (0.0, 0.0, 0.0, 0.0)
        s = theta * theta
        return theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))

    def project(self, points_camera: FloatArray) -> tuple[FloatArray, BoolArray]:
        """See `Camera.project`; points beyond the polynomial's fold or 89.5 degrees are not on the image."""
        x, y, z = points_camera[:, 0], points_camera[:, 1], points_camera[:, 2]
        r = np.hypot(x, y)
        theta = np.arctan2(r, z)
        seen = (theta < self._largest_theta) & (z > _MIN_DEPTH_M)
        scale = np.where(r > 1e-12, self._distorted(np.where(seen, theta, 0.0)) / np.where(r > 1e-12, r, 1.0), 0.0)
        u, v = self.fx * x * scale + self.cx, self.fy * y * scale + self.cy
        return np.column_stack([u, v]), seen & self._on_image(u, v)

    def depth_of(self, points_camera: FloatArray) -> FloatArray:
        """The z coordinate."""
        return points_camera[:, 2]

    def back_project(self, pixels_uv: FloatArray, depth_m: FloatArray) -> FloatArray:
        """See `Camera.back_project`; NaN outside the fisheye's circle."""
        a, b = (pixels_uv[:, 0] - self.cx) / self.fx, (pixels_uv[:, 1] - self.cy) / self.fy
        theta_d = np.hypot(a, b)
        theta = self._undistorted(theta_d)
        with np.errstate(invalid="ignore"):
            scale = np.where(theta_d > 1e-12, np.tan(theta) / np.where(theta_d > 1e-12, theta_d, 1.0), 1.0)
        seen = np.where(np.isfinite(scale), 1.0, np.nan)
        return np.column_stack([a * scale * depth_m, b * scale * depth_m, depth_m * seen])

    def _undistorted(self, theta_d: FloatArray) -> FloatArray:
        """Invert the polynomial on its rising part by bisection, exact to 1e-12 rad; NaN beyond it."""
        low, high = np.zeros_like(theta_d), np.full_like(theta_d, self._largest_theta)
        inside = theta_d < self._distorted(high)
        if not self.distortion:
            return np.where(inside, theta_d, np.nan)
        for _ in range(42):
            middle = (low + high) / 2
            above = self._distorted(middle) > theta_d
            high, low = np.where(above, middle, high), np.where(above, low, middle)
        return np.where(inside, (low + high) / 2, np.nan)

    def focal_px(self) -> float:
        """The mean of fx and fy."""
        return (self.fx + self.fy) / 2


@dataclass(frozen=True)
class EquirectangularCamera(_PixelRays):
    """A full panorama, 360 x 180 degrees: u grows with the longitude atan2(x, z), v with the latitude towards +y.

    The optical axis (z) is at the image's centre. Depth is the range.
    """

    width: int
    height: int

    def __post_init__(self) -> None:
        _check_intrinsics(self.width, self.height, (1.0, 1.0))

    @property
    def full_turn(self) -> bool:
        """It is a full panorama."""
        return True

    def project(self, points_camera: FloatArray) -> tuple[FloatArray, BoolArray]:
        """See `Camera.project`; every point but the centre itself is seen."""
        x, y, z = points_camera[:, 0], points_camera[:, 1], points_camera[:, 2]
        u = (np.arctan2(x, z) / (2 * np.pi) + 0.5) * self.width - 0.5
        v = (np.arctan2(y, np.hypot(x, z)) / np.pi + 0.5) * self.height - 0.5
        u = np.where(u >= self.width - 0.5, u - self.width, u)
        v = np.clip(v, -0.5, np.nextafter(self.height - 0.5, 0))
        return np.column_stack([u, v]), self.depth_of(points_camera) > _MIN_DEPTH_M

    def depth_of(self, points_camera: FloatArray) -> FloatArray:
        """The range."""
        ranges: FloatArray = np.sqrt(np.einsum("ij,ij->i", points_camera, points_camera))
        return ranges

    def back_project(self, pixels_uv: FloatArray, depth_m: FloatArray) -> FloatArray:
        """See `Camera.back_project`."""
        longitude = ((pixels_uv[:, 0] + 0.5) / self.width - 0.5) * 2 * np.pi
        latitude = ((pixels_uv[:, 1] + 0.5) / self.height - 0.5) * np.pi
        horizontal = np.cos(latitude) * depth_m
        return np.column_stack(
            [np.sin(longitude) * horizontal, np.sin(latitude) * depth_m, np.cos(longitude) * horizontal]
        )

    def focal_px(self) -> float:
        """Pixels per radian along the equator."""
        return self.width / (2 * np.pi)


def _check_intrinsics(width: int, height: int, values: tuple[float, ...]) -> None:
    if width <= 0 or height <= 0:
        raise CalibrationError(f"a camera needs a positive image size, not {width} x {height}", cure=_CURE)
    if not np.isfinite(values).all() or values[0] <= 0 or values[1] <= 0:
        raise CalibrationError(
            f"camera intrinsics make no sense: {list(values)}", cure="calibrate the camera, fx and fy must be positive"
        )


_MODELS: dict[str, type[PinholeCamera | FisheyeCamera | EquirectangularCamera]] = {
    "pinhole": PinholeCamera,
    "fisheye": FisheyeCamera,
    "equirectangular": EquirectangularCamera,
}


def camera_to_json(camera: Camera) -> str:
    """One line of JSON: "model" and the model's own parameters. Raises `TypeError` for a foreign camera class."""
    for name, model in _MODELS.items():
        if isinstance(camera, model):
            return json.dumps({"model": name, **asdict(camera)})
    raise TypeError(f"no JSON form for a {type(camera).__name__}")


@lru_cache(maxsize=64)
def camera_from_json(text: str) -> Camera:
    """The camera of `camera_to_json`, the same one for the same text. Raises `CalibrationError` if the text is none."""
    try:
        values = json.loads(text)
        model = _MODELS[values.pop("model")]
        known = {attribute.name for attribute in fields(model)}
        if not known >= values.keys():
            raise CalibrationError(f"unknown camera parameters: {sorted(values.keys() - known)}", cure=_STORED_CURE)
        if "distortion" in values:
            values["distortion"] = tuple(map(float, values["distortion"]))
        return model(**values)
    except (json.JSONDecodeError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise CalibrationError(f"not a camera's JSON form: {error}", cure=_STORED_CURE) from error
