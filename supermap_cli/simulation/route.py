"""The robot's way through the world: smooth, differentiable, and known exactly at every time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.simulation.sway import Sway


@dataclass(frozen=True)
class Route:
    """The base's planar motion as knots of a C2 spline: `times_s` (k,) from 0, `knots_xy` (k, 2), `knots_yaw` (k,)
    radians, unwrapped. The base stays level, z = 0 on the floor, but for its `sway` where it is carried; `start_ns` is
    the sensor time of `times_s[0]`.
    """

    start_ns: int
    times_s: FloatArray
    knots_xy: FloatArray
    knots_yaw: FloatArray
    sway: Sway | None = None

    def __post_init__(self) -> None:
        check_shape("times_s", self.times_s, (None,))
        check_shape("knots_xy", self.knots_xy, (len(self.times_s), 2))
        check_shape("knots_yaw", self.knots_yaw, (len(self.times_s),))

    @property
    def end_ns(self) -> int:
        """The sensor time of the last knot."""
        return self.start_ns + round(float(self.times_s[-1]) * 1e9)

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline  # noqa: PLC0415 - keeps start-up light

        knots = np.column_stack([self.knots_xy, self.knots_yaw])
        return CubicSpline(self.times_s, knots, bc_type="clamped")

    def derivative(self, stamps_ns: IntArray, order: int = 0) -> FloatArray:
        """(n, 3) x, y, yaw or their time derivatives of an order up to 2, in metres, radians and seconds; no sway."""
        found: FloatArray = self._spline((np.asarray(stamps_ns) - self.start_ns) / 1e9, order)
        return found

    def T_world_base(self, stamps_ns: IntArray) -> FloatArray:
        """True poses (n, 4, 4)."""
        x, y, yaw = self.derivative(stamps_ns).T
        T = np.tile(np.eye(4), (len(x), 1, 1))
        T[:, 0, 0] = T[:, 1, 1] = np.cos(yaw)
        T[:, 1, 0] = np.sin(yaw)
        T[:, 0, 1] = -T[:, 1, 0]
        T[:, 0, 3], T[:, 1, 3] = x, y
        return T if self.sway is None else T @ self.T_level_base(stamps_ns)

    def T_level_base(self, stamps_ns: IntArray) -> FloatArray:
        """(n, 4, 4) the base in the level frame under it: where the sway takes it."""
        if self.sway is None:
            return np.tile(np.eye(4), (len(stamps_ns), 1, 1))
        return self.sway.T_level_base((np.asarray(stamps_ns) - self.start_ns) / 1e9)
