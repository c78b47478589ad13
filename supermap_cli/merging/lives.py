"""How the lives of the other memory's objects go on those of the map, or beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.mapping import lifecycle
from supermap_cli.mapping.changes import instance_record, open_state
from supermap_cli.mapping.duplicates import merge_evidence
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.objects import MapObject, ObjectMap, OpenState
from supermap_cli.mapping.relocation import Relocation, relocations
from supermap_cli.merging.laying_aside import LaidAside
from supermap_cli.merging.meeting import Met
from supermap_cli.types.memory import InstanceRecord, StateRecord, TemporalEdge, TemporalKind

How = Literal["in place", "back in place", "moved", "part", "new"]
"""A thing of the map in its place, one that had gone and is back there, one that stands elsewhere now, a part of one,
or none of them.
"""


@dataclass(frozen=True)
class Joined:
    """What object of the map an object of the other memory is, by their numbers. `candidates` are those that it may be,
    with their probability, where the evidence does not single one out; `into` is what it is a part of.
    """

    other: int
    number: int
    how: How
    distance_m: float | None = None
    candidates: tuple[tuple[int, float], ...] = ()
    into: int | None = None


@dataclass
class Lives:
    """Joins objects, one after the other, and collects what is to be written.

    `objects` are the map's, as the other memory's images leave them (`Witness`), `stood` those of them that stood at
    the map's own end. `numbers` and `offsets` map the other memory's numbers, and the indices of its states.
    """

    objects: ObjectMap
    stood: frozenset[int]
    free_space: FreeSpaceMemory
    numbers: dict[int, int] = field(default_factory=dict)
    offsets: dict[int, int] = field(default_factory=dict)
    states: list[StateRecord] = field(default_factory=list)
    edges: list[TemporalEdge] = field(default_factory=list)
    joined: dict[int, Joined] = field(default_factory=dict)
    changed: set[int] = field(default_factory=set)
    merged: list[InstanceRecord] = field(default_factory=list)
    ends_ns: dict[int, int] = field(default_factory=dict)

    def meet_in_place(self, known: MapObject, other: Met, aside: LaidAside | None) -> None:
        """A thing of the other memory is one of the map in the place where that stood, or pushed aside a little."""
        came = other.states[0]
        if known.number not in self.stood:
            empty_ns = _latest(known.gone_ns, came.empty_before_ns)
            self._note("reappeared", known, (empty_ns, came.first_seen_ns))
            self._go_on(known, other, "back in place", empty_ns)
        elif came.empty_before_ns is not None:
            gone_ns = _earliest(known.gone_ns, came.empty_before_ns)
            self._leave(known, gone_ns)
            self._note("reappeared", known, (came.empty_before_ns, came.first_seen_ns))
            self._go_on(known, other, "back in place", came.empty_before_ns)
        elif aside is not None and aside.is_sure:
            since_ns = _earliest(aside.since_ns, came.first_seen_ns)
            self._close(known, since_ns)
            self._move(known, other, (known.last_seen_ns, came.first_seen_ns), known.last_seen_ns)
        else:
            self._stay(known, other)

    def take_for_part(self, whole: MapObject, other: Met) -> None:
        """A thing of the other memory is a part of one of the map: it enters, and is merged into that."""
        if not (whole.present and other.last.present and len(other.states) == 1):
            return
        number = self._number(other, "part", into=whole.number)
        self._add_states(other.last, other, 0)
        self.merged.append(instance_record(other.last, merged_into=whole.number))
        bounds_ns = (other.states[0].first_seen_ns, max(whole.last_seen_ns, other.last.last_seen_ns))
        self._link("merged", (number, 0), (whole.number, whole.state.index), bounds_ns)
        merge_evidence(whole, other.last)
        self._extend(whole)

    def leave_unmet(self) -> None:
        """What the other memory saw to be gone, of all that it does not know in its place, has gone."""
        met = {each.into or each.number for each in self.joined.values()}
        for known in list(self.objects):
            if known.number in met:
                continue
            if known.number in self.stood and not known.present and known.gone_ns is not None:
                self._leave(known, known.gone_ns)
            doubted = known.existence.log_odds <= lifecycle.DEFAULT.demote_log_odds
            if known.present and doubted and not known.demoted:
                known.set_status(demoted=True)
                self.changed.add(known.number)

    def find_elsewhere(self, others: Sequence[Met]) -> None:
        """Things that the map did not have in that place: those of its own that have gone, where the evidence singles
        them out, else new ones.
        """
        for each in others:
            self._ask_whether_it_came(each)
        things = {each.first.number: each for each in others if each.is_thing}
        gone = [each for each in self.objects if not each.present and not each.is_dynamic]
        standing = [each for each in self.objects if each.present and not each.is_dynamic]
        matches = relocations(gone, [each.first for each in things.values()], standing)
        for match in (each for each in matches if each.certain):
            self._take_over(self.objects[match.gone], things[match.found])
        for each in others:
            if each.number not in self.numbers:
                self._enter(each, [match for match in matches if match.found == each.first.number])
        self.merged += [
            instance_record(each.last, merged_into=self.numbers[each.record.merged_into])
            for each in others
            if each.record.merged_into is not None
        ]

    def bring_edges(self, edges: Sequence[TemporalEdge]) -> None:
        """The other memory's temporal edges, in the map's time; what had appeared there was known here."""
        for edge in edges:
            known = self.joined[edge.to_number].how not in {"new", "part"}
            if edge.kind == "appeared" and edge.to_state == 0 and known:
                continue
            self.edges.append(
                replace(
                    edge,
                    from_number=self.numbers[edge.from_number],
                    from_state=self._index(edge.from_number, edge.from_state),
                    to_number=self.numbers[edge.to_number],
                    to_state=self._index(edge.to_number, edge.to_state),
                )
            )

    def instances(self) -> list[InstanceRecord]:
        """All instances that are new or changed."""
        return [instance_record(self.objects[number]) for number in sorted(self.changed)] + self.merged

    # -- one object

    def _stay(self, known: MapObject, other: Met) -> None:
        """It stood there all along: the state goes on."""
        before, index = known.state, known.state.index
        alone = len(other.states) == 1
        self._pour(known, other, fresh=not alone)
        came = other.states[0]
        state = replace(
            open_state(known, came.gone_ns),
            index=index,
            first_seen_ns=before.first_seen_ns,
            last_seen_ns=came.last_seen_ns,
            empty_before_ns=before.empty_before_ns,
        )
        self.states.append(state if alone else replace(state, centroid_map=came.centroid_map, box=came.box))
        self._add_states(known, other, index, from_state=1)
        if alone:
            known.state = before
        self._settle(known, other, index, "in place")
        if came.gone_ns is not None or not alone:
            self.ends_ns[known.number] = came.gone_ns or other.states[1].first_seen_ns

    def _go_on(
        self, known: MapObject, other: Met, how: How, empty_ns: int | None, moved_m: float | None = None
    ) -> None:
        """It stands there, or elsewhere, again: a state of its own, of which the other memory has the whole."""
        offset = known.state.index + 1
        self._pour(known, other, fresh=True)
        states = [replace(other.states[0], empty_before_ns=empty_ns), *other.states[1:]]
        self._add_states(known, replace(other, states=tuple(states)), offset)
        if len(states) == 1:
            known.state.empty_before_ns = empty_ns
        self._settle(known, other, offset, how, moved_m)

    def _move(self, known: MapObject, other: Met, bounds_ns: tuple[int | None, int], empty_ns: int | None) -> None:
        """It stands elsewhere: in the other memory's first place for it."""
        distance_m = displacement_m(known.shape.box, other.first.shape.box)
        self._note("moved", known, bounds_ns, distance_m)
        self._go_on(known, other, "moved", empty_ns, distance_m)

    def _take_over(self, known: MapObject, found: Met) -> None:
        """A thing of the map that is gone is one that was found elsewhere (as `transitions.relocate`)."""
        came = found.first.state
        if known.gone_ns is None or known.gone_ns > came.first_seen_ns:
            self._close(known, came.first_seen_ns)
        self._move(known, found, (known.last_seen_ns, came.first_seen_ns), came.empty_before_ns)

    def _enter(self, other: Met, candidates: Sequence[Relocation]) -> None:
        """An object that the map did not know."""
        number = self._number(other, "new", tuple((each.gone, each.probability) for each in candidates))
        self._add_states(other.last, other, 0, empty_before_ns=other.first.state.empty_before_ns)
        if other.record.merged_into is not None:
            return
        if len(other.states) == 1:
            other.last.state.empty_before_ns = other.first.state.empty_before_ns
        self.objects.add(other.last)
        self.changed.add(number)
        came = other.first.state
        if came.empty_before_ns is not None and other.states[0].empty_before_ns is None:
            self._link("appeared", (number, None), (number, 0), (came.empty_before_ns, came.first_seen_ns))
        for each in candidates:
            gone = self.objects[each.gone]
            bounds_ns = (gone.last_seen_ns, came.first_seen_ns)
            source = (gone.number, gone.state.index)
            self._link("candidate", source, (number, 0), bounds_ns, probability=each.probability)

    def _number(
        self, other: Met, how: How, candidates: tuple[tuple[int, float], ...] = (), into: int | None = None
    ) -> int:
        """A number of its own, and nothing of the map's before its states."""
        number = self.objects.new_number()
        other.last.number = number
        self.numbers[other.number], self.offsets[other.number] = number, 0
        self.joined[other.number] = Joined(other.number, number, how, None, candidates, into)
        return number

    def _ask_whether_it_came(self, other: Met) -> None:
        """Its place may have been seen empty by the map, if not by the other memory."""
        came, shape = other.first.state, other.first.shape
        if came.empty_before_ns is None and other.record.merged_into is None:
            voxel_m = other.first.voxels.voxel_m
            came.empty_before_ns = self.free_space.last_seen_empty(shape.points, voxel_m, came.first_seen_ns)

    # -- what they have in common

    def _pour(self, known: MapObject, other: Met, *, fresh: bool) -> None:
        """All that is known of it comes together; `fresh`: its cloud is that of its last place."""
        last = other.last
        merge_evidence(known, last)
        if fresh:
            known.voxels, known.existence = last.voxels, last.existence
        known.status = replace(last.status, demoted=False)
        known.clear_negative_evidence()
        known.best_crop = max(known.best_crop, last.best_crop)
        known.voxels_changed()

    def _settle(self, known: MapObject, other: Met, offset: int, how: How, moved_m: float | None = None) -> None:
        """Its numbers are known; its present state is the other memory's last, but where that went on."""
        last = other.last.state
        if how != "in place" or len(other.states) > 1:
            empty_ns = known.state.empty_before_ns if len(other.states) == 1 else last.empty_before_ns
            known.state = OpenState(offset + last.index, last.first_seen_ns, empty_ns)
        self.numbers[other.number], self.offsets[other.number] = known.number, offset
        self.joined[other.number] = Joined(other.number, known.number, how, moved_m)
        self.changed.add(known.number)

    def _add_states(
        self,
        of: MapObject,
        other: Met,
        offset: int,
        *,
        from_state: int = 0,
        empty_before_ns: int | None = None,
    ) -> None:
        for each in other.states[from_state:]:
            empty_ns = each.empty_before_ns
            if each.index == 0 and empty_ns is None:
                empty_ns = empty_before_ns
            self.states.append(
                replace(each, object_number=of.number, index=offset + each.index, empty_before_ns=empty_ns)
            )

    def _leave(self, known: MapObject, gone_ns: int) -> None:
        """It was seen to be gone."""
        self._close(known, gone_ns)
        known.mark_absent(gone_ns)
        self._note("disappeared", known, (known.last_seen_ns, gone_ns))

    def _extend(self, known: MapObject) -> None:
        """The state that it is in, as more is known of it."""
        self.states.append(open_state(known))
        self.changed.add(known.number)

    def _close(self, known: MapObject, gone_ns: int) -> None:
        self.states.append(open_state(known, gone_ns))
        self.ends_ns[known.number] = gone_ns
        self.changed.add(known.number)

    def _index(self, other: int, state: int | None) -> int | None:
        return None if state is None else state + self.offsets[other]

    def _note(
        self,
        kind: TemporalKind,
        of: MapObject,
        bounds_ns: tuple[int | None, int],
        distance_m: float | None = None,
    ) -> None:
        """What happened to the state that it is in: it ended, or the next one follows."""
        index = of.state.index
        to = index if kind == "disappeared" else index + 1
        self._link(kind, (of.number, index), (of.number, to), bounds_ns, distance_m=distance_m)

    def _link(
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
    return max((each for each in times_ns if each is not None), default=None)


def _earliest(first_ns: int | None, second_ns: int) -> int:
    return second_ns if first_ns is None else min(first_ns, second_ns)
