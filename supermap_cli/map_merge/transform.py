"""Transforms what another map stores into this map's frame and time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping.belief import ViewpointHistory
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.restoring import restore_object
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, StateRecord, TemporalEdge, Visit

_AZIMUTHS, _AZIMUTH_DEG = 24, 15
"""Azimuth cells of a full turn and the width of one, as in `belief.Viewpoint.cell`."""


@dataclass(frozen=True)
class MapTransform:
    """`T_map_other` (4, 4) between two level frames; `shift_ns` is added to the other map's stamps."""

    T_map_other: FloatArray
    shift_ns: int

    @cached_property
    def yaw(self) -> float:
        """Rotation of the other frame about the map's z axis, radians."""
        return float(np.arctan2(self.T_map_other[1, 0], self.T_map_other[0, 0]))

    def time(self, stamp_ns: int) -> int:
        """A stamp in the map's time."""
        return stamp_ns + self.shift_ns

    def optional_time(self, stamp_ns: int | None) -> int | None:
        """As `time`; `None` stays `None`."""
        return None if stamp_ns is None else stamp_ns + self.shift_ns

    def points(self, points_other: FloatArray) -> FloatArray:
        """Points (n, 3) in the map frame."""
        return transform_points(self.T_map_other, points_other)

    def point(self, point_other: FloatArray) -> FloatArray:
        """One point (3,) in the map frame."""
        return self.points(point_other[None]).reshape(3)

    def box(self, box_other: Box3D) -> Box3D:
        """An upright box; its yaw lies in [-pi/2, pi/2)."""
        yaw = (box_other.yaw + self.yaw + np.pi / 2) % np.pi - np.pi / 2
        return Box3D(self.point(box_other.center), box_other.size, float(yaw))

    def keyframe(self, record: KeyframeRecord) -> KeyframeRecord:
        """A keyframe with its poses and stamp transformed."""
        return replace(
            record,
            stamp_ns=self.time(record.stamp_ns),
            T_map_base=self.T_map_other @ record.T_map_base,
            T_map_camera=self.T_map_other @ record.T_map_camera,
        )

    def state(self, record: StateRecord) -> StateRecord:
        """A state with its place and stamps transformed."""
        return replace(
            record,
            first_seen_ns=self.time(record.first_seen_ns),
            last_seen_ns=self.time(record.last_seen_ns),
            gone_ns=self.optional_time(record.gone_ns),
            empty_before_ns=self.optional_time(record.empty_before_ns),
            centroid_map=self.point(record.centroid_map),
            box=self.box(record.box),
        )

    def visit(self, record: Visit) -> Visit:
        """A visit with its stamps transformed."""
        return replace(
            record,
            first_support_ns=self.optional_time(record.first_support_ns),
            last_support_ns=self.optional_time(record.last_support_ns),
        )

    def edge(self, record: TemporalEdge) -> TemporalEdge:
        """A temporal edge with its stamps transformed; it keeps the other map's object numbers."""
        return replace(
            record,
            not_before_ns=self.optional_time(record.not_before_ns),
            not_after_ns=self.time(record.not_after_ns),
        )

    def map_object(self, instance: InstanceRecord, number: int) -> MapObject:
        """An object as it was at the end of the other map, under a number of this one."""
        restored = restore_object(instance)
        restored.number, restored.seen_apart = number, {}
        restored.voxels = restored.voxels.carried(self.T_map_other)
        cells = restored.existence.viewpoints.cells
        rotated = ViewpointHistory({self._rotated_cell(name): cell for name, cell in cells.items()})
        restored.existence.viewpoints = rotated
        restored.first_seen_ns = self.time(restored.first_seen_ns)
        restored.last_seen_ns = self.time(restored.last_seen_ns)
        restored.status = replace(restored.status, gone_ns=self.optional_time(restored.gone_ns))
        restored.state.first_seen_ns = self.time(restored.state.first_seen_ns)
        restored.state.empty_before_ns = self.optional_time(restored.state.empty_before_ns)
        restored.voxels_changed()
        return restored

    def _rotated_cell(self, name: str) -> str:
        """A viewpoint cell "azimuth,elevation,distance" (`belief.Viewpoint.cell`), maybe with a detector, rotated
        by `yaw`.
        """
        azimuth, elevation, distance = name.split(",")
        turned = int(azimuth) + round(np.degrees(self.yaw) / _AZIMUTH_DEG)
        return f"{(turned + _AZIMUTHS // 2) % _AZIMUTHS - _AZIMUTHS // 2},{elevation},{distance}"
