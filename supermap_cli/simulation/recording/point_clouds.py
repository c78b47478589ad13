"""Scans as the drivers of LiDARs write them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from supermap_cli.simulation.rigs import Lidar
from supermap_cli.simulation.sensors.lidar_sensor import LidarScan

_LIVOX_POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "tag", "line", "timestamp"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "u1", "u1", "<f8"],
        "offsets": [0, 4, 8, 12, 16, 17, 18],
        "itemsize": 26,
    }
)
_LIVOX_LINES = 4  # laser lines of a Mid-360
_RING_POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 18],
        "itemsize": 22,
    }
)


@dataclass(frozen=True)
class LidarNames:
    """Under which names a LiDAR publishes, and the layout `point` of its clouds."""

    topic: str
    frame_id: str
    point: np.dtype[np.void]

    @classmethod
    def of(cls, lidar: Lidar | None) -> LidarNames:
        """A Livox's, or those of a scanner with rings."""
        if lidar is not None and lidar.rings:
            return cls("/velodyne_points", "velodyne", _RING_POINT)
        return cls("/livox/lidar", "livox_frame", _LIVOX_POINT)

    def cloud(self, stamp_ns: int, scan: LidarScan) -> NDArray[np.void]:
        """(n,) the points of the scan that starts at `stamp_ns`."""
        cloud = np.zeros(len(scan.points_lidar), self.point)
        cloud["x"], cloud["y"], cloud["z"] = scan.points_lidar.T
        cloud["intensity"] = scan.intensity
        if self.point is _RING_POINT:
            cloud["ring"], cloud["time"] = scan.ring, (scan.stamps_ns - stamp_ns) / 1e9
        else:
            cloud["timestamp"], cloud["line"] = scan.stamps_ns, np.arange(len(cloud)) % _LIVOX_LINES
        return cloud
