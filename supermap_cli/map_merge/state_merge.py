"""Merges the states of the other map's objects into this map's objects, or adds them as new ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.map_merge.displacement import DisplacementHypothesis
from supermap_cli.map_merge.matching import ImportedObject
from supermap_cli.mapping.changes import instance_record, open_state
from supermap_cli.mapping.duplicates import merge_evidence
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.lifecycle import is_demoted
from supermap_cli.mapping.objects import MapObject, ObjectMap, OpenState
from supermap_cli.mapping.relocation import Relocation, relocations
from supermap_cli.types.memory import InstanceRecord, StateRecord, TemporalEdge, TemporalKind

MatchKind = Literal["in place", "back in place", "moved", "part", "new"]
"""An object of this map in its place, one that had gone and is back there, one that was relocated, a part of one, or
none of them.
"""


@dataclass(frozen=True)
class ObjectMatch:
    """Which object of this map (`number`) an object of the other map (`other`) is.

    `candidates` are those that it may be, with their probability, where the evidence does not single one out; `into` is
    the object that it is a part of.
    """

    other: int
    number: int
    kind: MatchKind
    distance_m: float | None = None
    candidates: tuple[tuple[int, float], ...] = ()
    into: int | None = None


@dataclass
class StateMerge:
    """Merges objects one after the other, and collects the rows to be written.

    `objects` are this map's after the other map's depth images were compared with them (`DepthConsistency`);
    `present_before` are those that were present at the end of this map. `numbers` and `state_offsets` map the other
    map's numbers and the indices of its states. `state_ends_ns` says when the state ended that was open at the end of
    this map.
    """

    objects: ObjectMap
    present_before: frozenset[int]
    free_space: FreeSpaceMemory
    numbers: dict[int, int] = field(default_factory=dict)
    state_offsets: dict[int, int] = field(default_factory=dict)
    states: list[StateRecord] = field(default_factory=list)
    edges: list[TemporalEdge] = field(default_factory=list)
    matches: dict[int, ObjectMatch] = field(default_factory=dict)
    changed: set[int] = field(default_factory=set)
    merged: list[InstanceRecord] = field(default_factory=list)
    state_ends_ns: dict[int, int] = field(default_factory=dict)

    def merge_in_place(
        self, known: MapObject, other: ImportedObject, displacement: DisplacementHypothesis | None
    ) -> None:
        """Merge an object that was matched in its place, or pushed aside a little."""
        arrival = other.states[0]
        if known.number not in self.present_before:
            empty_ns = _latest(known.gone_ns, arrival.empty_before_ns)
            self._add_event("reappeared", known, (empty_ns, arrival.first_seen_ns))
            self._append_states(known, other, "back in place", empty_ns)
        elif arrival.empty_before_ns is not None:
            gone_ns = _earliest(known.gone_ns, arrival.empty_before_ns)
            self._set_gone(known, gone_ns)
            self._add_event("reappeared", known, (arrival.empty_before_ns, arrival.first_seen_ns))
            self._append_states(known, other, "back in place", arrival.empty_before_ns)
        elif displacement is not None and displacement.is_accepted:
            since_ns = _earliest(displacement.since_ns, arrival.first_seen_ns)
            self._close_state(known, since_ns)
            self._move(known, other, (known.last_seen_ns, arrival.first_seen_ns), known.last_seen_ns)
        else:
            self._continue_state(known, other)

    def merge_part(self, whole: MapObject, other: ImportedObject) -> None:
        """Add an object that is a part of one of this map, and merge it into that."""
        if not (whole.present and other.last.present and len(other.states) == 1):
            return
        number = self._assign_new_number(other, "part", into=whole.number)
        self._add_states(other.last, other, 0)
        self.merged.append(instance_record(other.last, merged_into=whole.number))
        bounds_ns = (other.states[0].first_seen_ns, max(whole.last_seen_ns, other.last.last_seen_ns))
        self._add_edge("merged", (number, 0), (whole.number, whole.state.index), bounds_ns)
        merge_evidence(whole, other.last)
        self._update_state(whole)

    def close_unmatched(self) -> None:
        """End the states of unmatched objects that the other map saw to be gone, and demote those it did not detect."""
        matched = {match.into or match.number for match in self.matches.values()}
        for known in list(self.objects):
            if known.number in matched:
                continue
            if known.number in self.present_before and not known.present and known.gone_ns is not None:
                self._set_gone(known, known.gone_ns)
            if known.present and not known.demoted and is_demoted(known):
                known.set_status(demoted=True)
                self.changed.add(known.number)

    def merge_elsewhere(self, others: Sequence[ImportedObject]) -> None:
        """Match the remaining objects with absent ones of this map where the evidence singles one out; add the rest."""
        for other in others:
            self._look_up_free_space(other)
        matchable = {other.first.number: other for other in others if other.is_matchable}
        gone = [obj for obj in self.objects if not obj.present and not obj.is_dynamic]
        present = [obj for obj in self.objects if obj.present and not obj.is_dynamic]
        matches = relocations(gone, [other.first for other in matchable.values()], present)
        for relocation in matches:
            if relocation.certain:
                self._relocate(self.objects[relocation.gone], matchable[relocation.found])
        for other in others:
            if other.number not in self.numbers:
                self._add_new(other, [found for found in matches if found.found == other.first.number])
        self.merged += [
            instance_record(other.last, merged_into=self.numbers[other.record.merged_into])
            for other in others
            if other.record.merged_into is not None
        ]

    def import_temporal_edges(self, edges: Sequence[TemporalEdge]) -> None:
        """Add the other map's temporal edges, given in this map's time, but for appearances of objects known here."""
        for edge in edges:
            known = self.matches[edge.to_number].kind not in {"new", "part"}
            if edge.kind == "appeared" and edge.to_state == 0 and known:
                continue
            self.edges.append(
                replace(
                    edge,
                    from_number=self.numbers[edge.from_number],
                    from_state=self._state_index(edge.from_number, edge.from_state),
                    to_number=self.numbers[edge.to_number],
                    to_state=self._state_index(edge.to_number, edge.to_state),
                )
            )

    def instances(self) -> list[InstanceRecord]:
        """All instances that are new or changed."""
        return [instance_record(self.objects[number]) for number in sorted(self.changed)] + self.merged

    # One object

    def _continue_state(self, known: MapObject, other: ImportedObject) -> None:
        """The object never left its place: its open state continues with the other map's first one."""
        before, index = known.state, known.state.index
        has_one_state = len(other.states) == 1
        self._merge_estimates(known, other, replace_geometry=not has_one_state)
        arrival = other.states[0]
        state = replace(
            open_state(known, arrival.gone_ns),
            index=index,
            first_seen_ns=before.first_seen_ns,
            last_seen_ns=arrival.last_seen_ns,
            empty_before_ns=before.empty_before_ns,
        )
        self.states.append(
            state if has_one_state else replace(state, centroid_map=arrival.centroid_map, box=arrival.box)
        )
        self._add_states(known, other, index, from_state=1)
        if has_one_state:
            known.state = before
        self._record_match(known, other, index, "in place")
        if arrival.gone_ns is not None or not has_one_state:
            self.state_ends_ns[known.number] = arrival.gone_ns or other.states[1].first_seen_ns

    def _append_states(
        self,
        known: MapObject,
        other: ImportedObject,
        kind: MatchKind,
        empty_ns: int | None,
        moved_m: float | None = None,
    ) -> None:
        """All of the other map's states follow those of this map; the first begins after `empty_ns`."""
        offset = known.state.index + 1
        self._merge_estimates(known, other, replace_geometry=True)
        states = [replace(other.states[0], empty_before_ns=empty_ns), *other.states[1:]]
        self._add_states(known, replace(other, states=tuple(states)), offset)
        if len(states) == 1:
            known.state.empty_before_ns = empty_ns
        self._record_match(known, other, offset, kind, moved_m)

    def _move(
        self, known: MapObject, other: ImportedObject, bounds_ns: tuple[int | None, int], empty_ns: int | None
    ) -> None:
        """The object moved to its first place in the other map."""
        distance_m = displacement_m(known.shape.box, other.first.shape.box)
        self._add_event("moved", known, bounds_ns, distance_m)
        self._append_states(known, other, "moved", empty_ns, distance_m)

    def _relocate(self, known: MapObject, found: ImportedObject) -> None:
        """An absent object of this map was found elsewhere (as `transitions.take_over` in a build)."""
        arrival = found.first.state
        if known.gone_ns is None or known.gone_ns > arrival.first_seen_ns:
            self._close_state(known, arrival.first_seen_ns)
        self._move(known, found, (known.last_seen_ns, arrival.first_seen_ns), arrival.empty_before_ns)

    def _add_new(self, other: ImportedObject, candidates: Sequence[Relocation]) -> None:
        """Add an object that this map did not know."""
        identities = tuple((candidate.gone, candidate.probability) for candidate in candidates)
        number = self._assign_new_number(other, "new", identities)
        self._add_states(other.last, other, 0, empty_before_ns=other.first.state.empty_before_ns)
        if other.record.merged_into is not None:
            return
        if len(other.states) == 1:
            other.last.state.empty_before_ns = other.first.state.empty_before_ns
        self.objects.add(other.last)
        self.changed.add(number)
        arrival = other.first.state
        if arrival.empty_before_ns is not None and other.states[0].empty_before_ns is None:
            self._add_edge("appeared", (number, None), (number, 0), (arrival.empty_before_ns, arrival.first_seen_ns))
        for candidate in candidates:
            gone = self.objects[candidate.gone]
            bounds_ns = (gone.last_seen_ns, arrival.first_seen_ns)
            source = (gone.number, gone.state.index)
            self._add_edge("candidate", source, (number, 0), bounds_ns, probability=candidate.probability)

    def _assign_new_number(
        self,
        other: ImportedObject,
        kind: MatchKind,
        candidates: tuple[tuple[int, float], ...] = (),
        into: int | None = None,
    ) -> int:
        """Give it the next free number; its states keep their indices."""
        number = self.objects.new_number()
        other.last.number = number
        self.numbers[other.number], self.state_offsets[other.number] = number, 0
        self.matches[other.number] = ObjectMatch(other.number, number, kind, None, candidates, into)
        return number

    def _look_up_free_space(self, other: ImportedObject) -> None:
        """Fill in when this map saw the object's first place empty, where the other map did not see it empty."""
        arrival, shape = other.first.state, other.first.shape
        if arrival.empty_before_ns is None and other.record.merged_into is None:
            voxel_m = other.first.voxels.voxel_m
            arrival.empty_before_ns = self.free_space.last_seen_empty(shape.points, voxel_m, arrival.first_seen_ns)

    # Shared steps

    def _merge_estimates(self, known: MapObject, other: ImportedObject, *, replace_geometry: bool) -> None:
        """Fuse labels, existence and geometry; `replace_geometry` where the object's last place is another one."""
        last = other.last
        merge_evidence(known, last)
        if replace_geometry:
            known.voxels, known.existence = last.voxels, last.existence
        known.status = replace(last.status, demoted=False)
        known.clear_negative_evidence()
        known.best_crop = max(known.best_crop, last.best_crop)
        known.voxels_changed()

    def _record_match(
        self, known: MapObject, other: ImportedObject, offset: int, kind: MatchKind, moved_m: float | None = None
    ) -> None:
        """Record number and state offset; the open state is the other map's last one, unless this map's continued."""
        last = other.last.state
        if kind != "in place" or len(other.states) > 1:
            empty_ns = known.state.empty_before_ns if len(other.states) == 1 else last.empty_before_ns
            known.state = OpenState(offset + last.index, last.first_seen_ns, empty_ns)
        self.numbers[other.number], self.state_offsets[other.number] = known.number, offset
        self.matches[other.number] = ObjectMatch(other.number, known.number, kind, moved_m)
        self.changed.add(known.number)

    def _add_states(
        self,
        obj: MapObject,
        other: ImportedObject,
        offset: int,
        *,
        from_state: int = 0,
        empty_before_ns: int | None = None,
    ) -> None:
        for state in other.states[from_state:]:
            empty_ns = state.empty_before_ns
            if state.index == 0 and empty_ns is None:
                empty_ns = empty_before_ns
            self.states.append(
                replace(state, object_number=obj.number, index=offset + state.index, empty_before_ns=empty_ns)
            )

    def _set_gone(self, known: MapObject, gone_ns: int) -> None:
        """The object was seen to be gone."""
        self._close_state(known, gone_ns)
        known.mark_absent(gone_ns)
        self._add_event("disappeared", known, (known.last_seen_ns, gone_ns))

    def _update_state(self, known: MapObject) -> None:
        """Write the open state again: more is known of it."""
        self.states.append(open_state(known))
        self.changed.add(known.number)

    def _close_state(self, known: MapObject, gone_ns: int) -> None:
        self.states.append(open_state(known, gone_ns))
        self.state_ends_ns[known.number] = gone_ns
        self.changed.add(known.number)

    def _state_index(self, other: int, state: int | None) -> int | None:
        return None if state is None else state + self.state_offsets[other]

    def _add_event(
        self,
        kind: TemporalKind,
        obj: MapObject,
        bounds_ns: tuple[int | None, int],
        distance_m: float | None = None,
    ) -> None:
        """A temporal edge from the open state: to itself where it disappeared, else to the state after it."""
        index = obj.state.index
        to = index if kind == "disappeared" else index + 1
        self._add_edge(kind, (obj.number, index), (obj.number, to), bounds_ns, distance_m=distance_m)

    def _add_edge(
        self,
        kind: TemporalKind,
        source: tuple[int, int | None],
        target: tuple[int, int],
        bounds_ns: tuple[int | None, int],
        *,
        probability: float = 1.0,
        distance_m: float | None = None,
    ) -> None:
        self.edges.append(TemporalEdge(kind, *source, *target, *bounds_ns, probability, distance_m))


def _latest(*times_ns: int | None) -> int | None:
    return max((time_ns for time_ns in times_ns if time_ns is not None), default=None)


def _earliest(first_ns: int | None, second_ns: int) -> int:
    return second_ns if first_ns is None else min(first_ns, second_ns)
