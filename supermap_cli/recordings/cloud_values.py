"""What point clouds hold, looked at over the length of a recording: their unit of length, and whether they hold points.

ROS gives points in metres (REP-103, sensor_msgs/PointCloud2). Drivers of depth cameras pass millimetres on, and compact
formats hold whole numbers: of millimetres in 32 bits, of centimetres in 16 (Livox SDK 2, cartesian coordinates of high
and of low resolution).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.pointclouds import NoCoordinatesError, PointsMessage, read_points
from supermap_cli.recordings.storage import RawMessage

_LOOKED_AT = 3
"""Clouds that are looked at, spread over those that were sampled: 10 ms each at 100,000 points."""

_FARTHEST_MEDIAN_M = 250.0
"""Metres that half of a LiDAR's returns never exceed: automotive ones reach that far for single returns. As millimetres
it is nearer than any LiDAR begins.
"""

_FARTHEST_M = 100.0
"""Metres within which nearly all returns of a robot's LiDAR lie, to tell centimetres from millimetres."""

_MM, _CM = 1e-3, 1e-2


@dataclass(frozen=True)
class CloudValues:
    """`scale` is what coordinates are multiplied by to be metres; `doubt` what is to be said of them, if anything;
    `fault` why it holds no places at all; clouds that are damaged or too large are left out one by one when they are
    read.
    """

    scale: float = 1.0
    doubt: str | None = None
    fault: RecordingError | None = None


def cloud_values(raws: Sequence[RawMessage], decoder: Decoder) -> CloudValues:
    """What the sampled clouds of one topic hold."""
    chosen = np.unique(np.linspace(0, len(raws) - 1, min(_LOOKED_AT, len(raws))).astype(int))
    clouds: list[PointsMessage] = []
    fault: RecordingError | None = None
    for index in chosen:
        try:
            clouds.append(read_points(raws[index], decoder))
        except RecordingError as error:
            fault = error if isinstance(error.__cause__, NoCoordinatesError) else None
    if not clouds:
        return CloudValues(fault=fault)
    filled = [cloud for cloud in clouds if len(cloud.points)]
    if not filled:
        return CloudValues(doubt=f"none of the {len(clouds)} clouds looked at holds a point")
    ranges = np.concatenate([np.linalg.norm(cloud.points, axis=1) for cloud in filled])
    scale, unit = _unit(ranges, filled[0].integer_bytes)
    if scale == 1.0:
        return CloudValues()
    kind = "whole numbers" if filled[0].integer_bytes else "floats"
    median_m = float(np.median(ranges)) * scale
    return CloudValues(
        scale,
        f"its points are {kind} in {unit}, as their ranges tell ({median_m:.2f} m in the median): they are brought to "
        "metres",
    )


def _unit(ranges: FloatArray, integer_bytes: int) -> tuple[float, str]:
    """The unit of ranges (n,) by how large they are, and by the bytes of their whole numbers (0 for floats)."""
    if not integer_bytes:
        return (_MM, "millimetres") if np.median(ranges) > _FARTHEST_MEDIAN_M else (1.0, "metres")
    if integer_bytes <= 2 and np.percentile(ranges, 95) * _CM <= _FARTHEST_M:
        return _CM, "centimetres"
    return _MM, "millimetres"
