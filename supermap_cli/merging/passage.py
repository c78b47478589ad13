"""From the other memory's frame and time into the map's."""

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


@dataclass(frozen=True)
class Passage:
    """`T_map_other` (4, 4), both frames level, and how much later than the other memory has it something is here."""

    T_map_other: FloatArray
    shift_ns: int

    @cached_property
    def yaw(self) -> float:
        """How far the other frame is turned in the map, radians."""
        return float(np.arctan2(self.T_map_other[1, 0], self.T_map_other[0, 0]))

    def time(self, stamp_ns: int) -> int:
        """A time."""
        return stamp_ns + self.shift_ns

    def maybe_time(self, stamp_ns: int | None) -> int | None:
        """A time, if there is one."""
        return None if stamp_ns is None else stamp_ns + self.shift_ns

    def points(self, points_other: FloatArray) -> FloatArray:
        """Points (n, 3)."""
        return transform_points(self.T_map_other, points_other)

    def point(self, point_other: FloatArray) -> FloatArray:
        """One point (3,)."""
        return self.points(point_other[None]).reshape(3)

    def box(self, box_other: Box3D) -> Box3D:
        """An upright box."""
        yaw = (box_other.yaw + self.yaw + np.pi / 2) % np.pi - np.pi / 2
        return Box3D(self.point(box_other.center), box_other.size, float(yaw))

    def keyframe(self, record: KeyframeRecord) -> KeyframeRecord:
        """A keyframe."""
        return replace(
            record,
            stamp_ns=self.time(record.stamp_ns),
            T_map_base=self.T_map_other @ record.T_map_base,
            T_map_camera=self.T_map_other @ record.T_map_camera,
        )

    def state(self, record: StateRecord) -> StateRecord:
        """A state."""
        return replace(
            record,
            first_seen_ns=self.time(record.first_seen_ns),
            last_seen_ns=self.time(record.last_seen_ns),
            gone_ns=self.maybe_time(record.gone_ns),
            empty_before_ns=self.maybe_time(record.empty_before_ns),
            centroid_map=self.point(record.centroid_map),
            box=self.box(record.box),
        )

    def visit(self, record: Visit) -> Visit:
        """How often it was looked at."""
        return replace(
            record,
            first_support_ns=self.maybe_time(record.first_support_ns),
            last_support_ns=self.maybe_time(record.last_support_ns),
        )

    def edge(self, record: TemporalEdge) -> TemporalEdge:
        """What happened, but between the same objects."""
        return replace(
            record,
            not_before_ns=self.maybe_time(record.not_before_ns),
            not_after_ns=self.time(record.not_after_ns),
        )

    def thing(self, instance: InstanceRecord, number: int) -> MapObject:
        """An object as it was at the end, under another number."""
        carried = restore_object(instance)
        carried.number = number
        carried.voxels = carried.voxels.carried(self.T_map_other)
        cells = carried.existence.viewpoints.cells
        carried.existence.viewpoints = ViewpointHistory({self._view(name): cell for name, cell in cells.items()})
        carried.first_seen_ns, carried.last_seen_ns = self.time(carried.first_seen_ns), self.time(carried.last_seen_ns)
        carried.status = replace(carried.status, gone_ns=self.maybe_time(carried.gone_ns))
        carried.state.first_seen_ns = self.time(carried.state.first_seen_ns)
        carried.state.empty_before_ns = self.maybe_time(carried.state.empty_before_ns)
        carried.voxels_changed()
        return carried

    def _view(self, name: str) -> str:
        """A cell of viewpoints, "azimuth,elevation,distance" (`belief.Viewpoint.cell`), turned."""
        azimuth, elevation, distance = name.split(",")
        turned = int(azimuth) + round(np.degrees(self.yaw) / _AZIMUTH_DEG)
        return f"{(turned + _AZIMUTHS // 2) % _AZIMUTHS - _AZIMUTHS // 2},{elevation},{distance}"
