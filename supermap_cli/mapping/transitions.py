"""Transitions of an object's status as they are carried out: states closed and opened, temporal edges written.

The paper keeps one map; here every state that ends stays known, so that the map can be asked about any time (4D).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.mapping.changes import PendingChanges, instance_record, open_state
from supermap_cli.mapping.displacement import Displacement
from supermap_cli.mapping.duplicates import merge_evidence
from supermap_cli.mapping.objects import DisplacementEvidence, MapObject, ObjectMap, OpenState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.memory import Observation, TemporalEdge, TemporalKind


@dataclass
class Transitions:
    """Carries out what `lifecycle`, `duplicates` and `relocation` decide.

    `touched` collects the objects that a keyframe has changed.
    """

    objects: ObjectMap
    changes: PendingChanges = field(default_factory=PendingChanges)
    touched: set[int] = field(default_factory=set)

    def mark_changed(self, changed: MapObject) -> None:
        """The object must be written again, and its relations looked at."""
        self.changes.dirty.add(changed.number)
        self.touched.add(changed.number)

    def add_observation(self, observation: Observation) -> None:
        """Keep an observation: at once if its object is confirmed, else with the object until it is."""
        obj = self.objects[observation.object_number]
        if obj.confirmed:
            self.changes.observations.append(observation)
        else:
            obj.pending.append(observation)

    def confirm(self, obj: MapObject) -> None:
        """A confirmed object enters the memory; it appeared if its place had been seen empty before."""
        obj.set_status(stored=True)
        self._flush(obj)
        state = obj.state
        if state.empty_before_ns is not None:
            self._add_edge("appeared", obj, None, (state.empty_before_ns, state.first_seen_ns))

    def mark_absent(self, obj: MapObject, gone_ns: int) -> None:
        """An object was seen to be gone, the first time at `gone_ns`, or since it was last seen."""
        gone_ns = max(gone_ns, obj.last_seen_ns + 1)
        obj.mark_absent(gone_ns)
        if obj.confirmed:
            self.changes.closed_states.append(open_state(obj, gone_ns))
            self._add_edge("disappeared", obj, obj.state.index, (obj.last_seen_ns, gone_ns))
            self.mark_changed(obj)

    def reactivate(self, obj: MapObject, stamp_ns: int) -> None:
        """An object that was gone stands in its old place again; its cloud starts anew."""
        before, gone_ns = obj.state.index, obj.gone_ns
        obj.mark_present()
        obj.state = OpenState(before + 1, stamp_ns, gone_ns)
        obj.best_crop = 0.0
        self._restart_cloud(obj)
        if obj.confirmed:
            self._add_edge("reappeared", obj, before, (gone_ns, stamp_ns))

    def displace(self, obj: MapObject, to: Displacement, since_ns: int) -> None:
        """An object stands beside its old place since `since_ns`, or is moving: its cloud comes along where it is
        known how far, else it starts anew.
        """
        if obj.confirmed and not obj.is_moving:
            distance_m = float(np.linalg.norm(to.centroid_map - obj.shape.centroid))
            before, last_ns = obj.state.index, obj.last_seen_ns
            self.changes.closed_states.append(open_state(obj, since_ns))
            obj.state = OpenState(before + 1, since_ns, last_ns)
            obj.best_crop = 0.0
            self._add_edge("moved", obj, before, (last_ns, since_ns), distance_m)
        if to.shift_m is None:
            self._restart_cloud(obj)
        else:
            obj.voxels = obj.voxels.moved(to.shift_m)
            obj.voxels_changed()
        obj.displacement = DisplacementEvidence()

    def relocate(self, old: MapObject, found: MapObject) -> None:
        """`old`, which was gone, is what was `found` elsewhere; a stored `found` becomes part of it."""
        origin, before, gone_ns, left_ns = old.shape.box, old.state.index, old.gone_ns, old.last_seen_ns
        if gone_ns is None or gone_ns > found.state.first_seen_ns:
            gone_ns = found.state.first_seen_ns
            self.changes.closed_states.append(open_state(old, gone_ns))
        old.voxels = found.voxels
        old.mark_present()
        old.displacement.interrupt()
        old.displacement.shift_m = None
        old.labels.absorb(found.labels)
        old.existence, old.relief = found.existence, found.relief
        old.last_seen_ns, old.track_ids = found.last_seen_ns, found.track_ids
        old.state = OpenState(before + 1, found.state.first_seen_ns, found.state.empty_before_ns)
        old.observations += found.observations
        for detector, looks in found.found_by.items():
            old.add_look(detector, looks)
        old.motion, old.best_crop = found.motion, found.best_crop
        old.voxels_changed()
        if found.status.stored:
            self._retire(found, old, old.state.first_seen_ns)
        old.pending = [replace(observation, object_number=old.number) for observation in found.pending]
        self.objects.remove(found.number)
        self._flush(old)
        distance_m = displacement_m(origin, old.shape.box)
        self._add_edge("moved", old, before, (left_ns, old.state.first_seen_ns), distance_m)

    def link_candidate(self, old: MapObject, found: MapObject, probability: float) -> None:
        """`found` may be `old`, but the evidence does not single it out: both stay."""
        bounds_ns = (old.last_seen_ns, found.state.first_seen_ns)
        self._link("candidate", (old.number, old.state.index), found, bounds_ns, probability=probability)

    def merge(self, kept: MapObject, joined: MapObject, stamp_ns: int) -> None:
        """Two objects turned out to be one."""
        if joined.status.stored:
            self._retire(joined, kept, stamp_ns)
        joined.pending = [replace(observation, object_number=kept.number) for observation in joined.pending]
        merge_evidence(kept, joined)
        if kept.confirmed:
            self._flush(kept)
        self.objects.remove(joined.number)
        self.touched.discard(joined.number)

    def split(self, whole: MapObject, part: MapObject) -> None:
        """Two things were one object up to now; `part` goes on as an object of its own, which nobody saw come."""
        self.mark_changed(whole)
        self.mark_changed(part)
        bounds_ns = (whole.first_seen_ns, part.first_seen_ns)
        self._link("split", (whole.number, whole.state.index), part, bounds_ns)

    def _retire(self, retired: MapObject, into: MapObject, stamp_ns: int) -> None:
        """A stored object is part of another one from now on."""
        self.changes.closed_states.append(open_state(retired))
        self.changes.merged.append(instance_record(retired, merged_into=into.number))
        self._link("merged", (retired.number, retired.state.index), into, (retired.first_seen_ns, stamp_ns))

    def set_demoted(self, obj: MapObject, *, demoted: bool) -> None:
        """A confirmed object is believed in no more, or again."""
        obj.set_status(demoted=demoted)
        self.mark_changed(obj)

    def _flush(self, confirmed: MapObject) -> None:
        self.changes.observations += confirmed.pending
        confirmed.pending = []
        self.mark_changed(confirmed)

    @staticmethod
    def _restart_cloud(moved: MapObject) -> None:
        moved.voxels = VoxelMap(moved.parameters.voxel_map.finest_voxel_m)
        moved.voxels_changed()

    def _add_edge(
        self,
        kind: TemporalKind,
        obj: MapObject,
        from_state: int | None,
        bounds_ns: tuple[int | None, int],
        distance_m: float | None = None,
    ) -> None:
        self._link(kind, (obj.number, from_state), obj, bounds_ns, distance_m=distance_m)

    def _link(
        self,
        kind: TemporalKind,
        source: tuple[int, int | None],
        target: MapObject,
        bounds_ns: tuple[int | None, int],
        *,
        probability: float = 1.0,
        distance_m: float | None = None,
    ) -> None:
        """Write an edge from a (number, state) to an object's present state, within [not before, not after]."""
        edge = TemporalEdge(
            kind, *source, target.number, target.state.index, *bounds_ns, probability=probability, distance_m=distance_m
        )
        self.changes.temporal_edges.append(edge)
