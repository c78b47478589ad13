"""The turns in an object's life as they are carried out: states closed and opened, temporal edges written."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.mapping.changes import Changes, instance_record, open_state
from supermap_cli.mapping.lifecycle import join
from supermap_cli.mapping.objects import MapObject, ObjectMap, OpenState
from supermap_cli.mapping.voxel_map import FINEST_VOXEL_M, VoxelMap
from supermap_cli.types.memory import Observation, TemporalEdge, TemporalKind

SAME_SHIFT_M = 0.1
"""Two images that show a thing shifted by this much more or less agree."""


@dataclass(frozen=True)
class Whereabouts:
    """Where an image shows an object that is not in its place: its middle (3,), the shift (3,) if it is known, and how
    much the image says so (`shifting.agreement`).
    """

    centroid_map: FloatArray
    shift_m: FloatArray | None
    gain: float

    def agrees_with(self, shift_m: FloatArray) -> bool:
        """Whether another image that shows it shifted by (3,) metres means the same place."""
        return self.shift_m is None or float(np.linalg.norm(self.shift_m - shift_m)) < SAME_SHIFT_M


@dataclass
class Transitions:
    """Carries out what `lifecycle` decides. `touched` collects the objects that a keyframe has changed."""

    objects: ObjectMap
    changes: Changes = field(default_factory=Changes)
    touched: set[int] = field(default_factory=set)

    def mark_changed(self, changed: MapObject) -> None:
        """The object must be written again, and its relations looked at."""
        self.changes.dirty.add(changed.number)
        self.touched.add(changed.number)

    def add_observation(self, observation: Observation) -> None:
        """Keep an observation: at once if its object is confirmed, else with the object until it is."""
        of = self.objects[observation.object_number]
        if of.confirmed:
            self.changes.observations.append(observation)
        else:
            of.pending.append(observation)

    def confirm(self, confirmed: MapObject) -> None:
        """A tentative object enters the map; it appeared if its place had been seen empty before."""
        confirmed.entered = True
        self._flush(confirmed)
        state = confirmed.state
        if state.empty_before_ns is not None:
            self._note("appeared", confirmed, None, (state.empty_before_ns, state.first_seen_ns))

    def mark_absent(self, gone: MapObject, gone_ns: int) -> None:
        """An object was seen to be gone, the first time at `gone_ns`, or since it was last seen."""
        gone_ns = max(gone_ns, gone.last_seen_ns + 1)
        gone.present, gone.gone_ns, gone.track_id = False, gone_ns, -1
        if gone.confirmed:
            self.changes.closed_states.append(open_state(gone, gone_ns))
            self._note("disappeared", gone, gone.state.index, (gone.last_seen_ns, gone_ns))
            self.mark_changed(gone)

    def reactivate(self, back: MapObject, stamp_ns: int) -> None:
        """An object that was gone stands in its old place again; its cloud starts anew."""
        before, gone_ns = back.state.index, back.gone_ns
        back.present, back.gone_ns = True, None
        back.in_place()
        back.state = OpenState(before + 1, stamp_ns, gone_ns)
        back.best_crop = 0.0
        self._restart_cloud(back)
        if back.confirmed:
            self._note("reappeared", back, before, (gone_ns, stamp_ns))

    def displace(self, moved: MapObject, to: Whereabouts, since_ns: int) -> None:
        """An object stands beside its old place since `since_ns`, or is on the move: its cloud comes along where it is
        known how far, else it starts anew.
        """
        if moved.confirmed and not moved.on_the_move:
            distance_m = float(np.linalg.norm(to.centroid_map - moved.shape.centroid))
            before, last_ns = moved.state.index, moved.last_seen_ns
            self.changes.closed_states.append(open_state(moved, since_ns))
            moved.state = OpenState(before + 1, since_ns, last_ns)
            moved.best_crop = 0.0
            self._note("moved", moved, before, (last_ns, since_ns), distance_m)
        if to.shift_m is None:
            self._restart_cloud(moved)
        else:
            moved.voxels = moved.voxels.moved(to.shift_m)
            moved.touched()
        moved.shifted_looks, moved.shifted_to, moved.shifted_gain = 0, None, 0.0

    def relocate(self, old: MapObject, found: MapObject) -> None:
        """`old`, which was gone, is what was `found` elsewhere; a stored `found` becomes part of it."""
        origin, before, gone_ns, left_ns = old.shape.box, old.state.index, old.gone_ns, old.last_seen_ns
        if gone_ns is None or gone_ns > found.state.first_seen_ns:
            gone_ns = found.state.first_seen_ns
            self.changes.closed_states.append(open_state(old, gone_ns))
        old.voxels, old.present, old.gone_ns = found.voxels, True, None
        old.in_place()
        old.shifted_looks, old.shifted_to = 0, None
        old.labels.absorb(found.labels)
        old.viewpoints = found.viewpoints
        old.existence, old.last_seen_ns, old.track_id = found.existence, found.last_seen_ns, found.track_id
        old.state = OpenState(before + 1, found.state.first_seen_ns, found.state.empty_before_ns)
        old.observations += found.observations
        old.motion, old.best_crop = found.motion, found.best_crop
        old.touched()
        if found.entered:
            self._retire(found, old, old.state.first_seen_ns)
        old.pending = [replace(each, object_number=old.number) for each in found.pending]
        self.objects.remove(found.number)
        self._flush(old)
        distance_m = displacement_m(origin, old.shape.box)
        self._note("moved", old, before, (left_ns, old.state.first_seen_ns), distance_m)

    def link_candidate(self, old: MapObject, found: MapObject, probability: float) -> None:
        """`found` may be `old`, but the evidence does not single it out: both stay."""
        bounds_ns = (old.last_seen_ns, found.state.first_seen_ns)
        self._link("candidate", (old.number, old.state.index), found, bounds_ns, probability=probability)

    def merge(self, kept: MapObject, joined: MapObject, stamp_ns: int) -> None:
        """Two objects turned out to be one."""
        if joined.entered:
            self._retire(joined, kept, stamp_ns)
        joined.pending = [replace(each, object_number=kept.number) for each in joined.pending]
        join(kept, joined)
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
        obj.doubted = demoted
        self.mark_changed(obj)

    def _flush(self, confirmed: MapObject) -> None:
        self.changes.observations += confirmed.pending
        confirmed.pending = []
        self.mark_changed(confirmed)

    @staticmethod
    def _restart_cloud(moved: MapObject) -> None:
        moved.voxels = VoxelMap(FINEST_VOXEL_M)
        moved.touched()

    def _note(
        self,
        kind: TemporalKind,
        of: MapObject,
        from_state: int | None,
        bounds_ns: tuple[int | None, int],
        distance_m: float | None = None,
    ) -> None:
        self._link(kind, (of.number, from_state), of, bounds_ns, distance_m=distance_m)

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
