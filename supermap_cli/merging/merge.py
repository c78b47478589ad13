"""One memory taken into another: placed, ordered in time, its things recognised, their lives joined, all written."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from supermap_cli.building.placing import Placement
from supermap_cli.building.time_order import TimeShift, shift_to_follow
from supermap_cli.errors import MemoryStoreError
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.memory.joining import Incoming
from supermap_cli.memory.names import unique_name
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.merging.laying_aside import laid_aside
from supermap_cli.merging.lives import Joined, Lives
from supermap_cli.merging.meeting import Met, in_place, met, parts_of
from supermap_cli.merging.passage import Passage
from supermap_cli.merging.placing import place_memory
from supermap_cli.merging.relations import join_edges, judge_anew
from supermap_cli.merging.witnessing import Witness
from supermap_cli.types.memory import MapDelta, SpatialEdge, StateRecord, TemporalEdge, Visit

Progress = Callable[[int, int], None]
"""Called with how many of the other memory's keyframes were held against the map, and of how many."""


@dataclass(frozen=True)
class MergeSummary:
    """What came of a merge. `names` are the traversals' names there and here; `other_ids` and `labels` are text ids and
    labels there, by number, `ids` those that were here before; `changes` what the two together say has changed.
    """

    placement: Placement
    time: TimeShift
    names: tuple[tuple[str, str], ...]
    joined: tuple[Joined, ...]
    other_ids: dict[int, str]
    labels: dict[int, str]
    ids: dict[int, str]
    changes: tuple[TemporalEdge, ...]
    written: bool
    warnings: tuple[str, ...] = ()


@dataclass
class MemoryMerge:
    """Merges `other`, which is only read, into `store`; `run` reads like the method."""

    store: MapStore
    other: MapStore
    again: bool = False
    progress: Progress | None = None
    lives: Lives = field(init=False)

    def run(self, align: str = "auto", *, dry_run: bool = False) -> MergeSummary:
        """Take the other memory in, in one transaction; `dry_run`: only say what would be.

        Raises `MemoryStoreError` where one of them cannot be merged, `AlignmentError` where they cannot be laid over
        one another.
        """
        earlier, later = self.store.traversals(), self.other.traversals()
        self._check(earlier, later)
        placement = place_memory(self.store, self.other, align)
        names = _names(earlier, later)
        time = shift_to_follow(names[later[0].id], min(each.start_ns for each in later), earlier)
        passage = Passage(placement.T_map_odom, time.shift_ns)
        others = self._others(passage)
        objects = restore_objects(self.store.load_instances(), self.store.next_object_number())
        self._join_lives(objects, others, passage)
        deltas = self._deltas(passage, later, others)
        summary = self._summary(placement, time, [(each.name, names[each.id]) for each in later], dry_run=dry_run)
        if not dry_run:
            incoming = Incoming(
                placement.T_map_odom, time.shift_ns, names, self.lives.numbers, deltas, self.other.where
            )
            self.store.take_in(self.other, incoming)
        return summary

    def _check(self, earlier: Sequence[StoredTraversal], later: Sequence[StoredTraversal]) -> None:
        """Both are whole, hold something, and not the same recording, unless `again`."""
        if self.store.identity == self.other.identity:
            raise MemoryStoreError("a map cannot be merged with itself", where=self.store.where, cure="name another")
        for each, held in ((self.store, earlier), (self.other, later)):
            if not any(one.keyframes for one in held):
                raise MemoryStoreError(
                    "there is nothing in the map", where=each.where, cure="build a recording into it"
                )
            if (unfinished := each.unfinished()) is not None:
                raise MemoryStoreError(
                    f"the build of {unfinished.name!r} has not come to its end",
                    where=each.where,
                    cure="let it go on with `supermap build --resume`, or take out what it wrote (--restart)",
                )
        known = {each.fingerprint: each.name for each in earlier}
        both = [f"{each.name!r} is {known[each.fingerprint]!r}" for each in later if each.fingerprint in known]
        if both and not self.again:
            raise MemoryStoreError(
                f"the same recording is in both maps: {', '.join(both)}",
                where=self.other.where,
                cure="merge maps of other recordings, or take it in once more (--again)",
            )

    # -- what there is

    def _others(self, passage: Passage) -> list[Met]:
        """The other memory's objects, here."""
        states: dict[int, list[StateRecord]] = defaultdict(list)
        for state in self.other.load_states():
            states[state.object_number].append(passage.state(state))
        return [
            met(record, states[record.number], passage.thing(record, -record.number))
            for record in self.other.load_instances(merged=True)
        ]

    def _join_lives(self, objects: ObjectMap, others: Sequence[Met], passage: Passage) -> None:
        """Recognise things in their places, ask the other memory's images about the rest, look for that elsewhere."""
        things = {id(each.first): each for each in others if each.is_thing}
        pairs = in_place([each for each in objects if not each.is_dynamic], [each.first for each in things.values()])
        stood = frozenset(each.number for each in objects if each.present)
        met_there = {id(first) for _, first in pairs}
        parts = parts_of(
            [each for each in objects if not each.is_dynamic],
            [each.first for each in things.values() if id(each.first) not in met_there],
        )
        aside = {
            known.number: found
            for known, first in pairs
            if known.number in stood and (found := laid_aside(known, first)) is not None
        }
        witness = Witness(objects, frozenset(known.number for known, _ in (*pairs, *parts)), aside)
        self._hear(witness, passage)
        self.witness = witness
        self.lives = Lives(objects, stood, self._free_space())
        for known, first in pairs:
            self.lives.meet_in_place(known, things[id(first)], aside.get(known.number))
        for whole, first in parts:
            self.lives.take_for_part(whole, things[id(first)])
        self.lives.leave_unmet()
        self.lives.find_elsewhere([each for each in others if each.number not in self.lives.numbers])
        with self.other.reader() as reader:
            self.lives.bring_edges([passage.edge(each) for each in reader.temporal_edges()])

    def _hear(self, witness: Witness, passage: Passage) -> None:
        traversals = self.other.traversals()
        count, done = sum(each.keyframes for each in traversals), 0
        for traversal in traversals:
            for record in self.other.keyframe_depths([traversal.id]):
                witness.look(traversal.id, passage.keyframe(record))
                done += 1
                if self.progress is not None:
                    self.progress(done, count)

    def _free_space(self) -> FreeSpaceMemory:
        """What the map saw empty, and when."""
        free_space = FreeSpaceMemory()
        for traversal in self.store.traversals():
            for record in self.store.keyframe_depths([traversal.id]):
                free_space.add_record(traversal.number, record)
        return free_space

    # -- what is to be written

    def _deltas(self, passage: Passage, later: Sequence[StoredTraversal], others: Sequence[Met]) -> dict[int, MapDelta]:
        """All but keyframes and observations, by the traversal of the other memory in whose time it falls."""
        lives = self.lives
        starts = [(passage.time(each.start_ns), each.id) for each in later]

        def during(stamp_ns: int) -> int:
            return next((each for start_ns, each in reversed(starts) if start_ns <= stamp_ns), later[0].id)

        visits = self._visits(passage, others)
        spatial = self._spatial_edges(passage, later)
        instances = lives.instances()
        return {
            each.id: MapDelta(
                instances=tuple(one for one in instances if during(one.first_seen_ns) == each.id),
                states=tuple(one for one in lives.states if during(one.first_seen_ns) == each.id),
                visits=tuple(one for traversal, one in visits if traversal == each.id),
                spatial_edges=tuple(one for one in spatial if during(one.since_ns) == each.id),
                temporal_edges=tuple(one for one in lives.edges if during(one.not_after_ns) == each.id),
            )
            for each in later
        }

    def _visits(self, passage: Passage, others: Sequence[Met]) -> list[tuple[int, Visit]]:
        """How often each traversal of the other memory looked at what: as it counted, and as its images tell."""
        numbers = self.lives.numbers
        counted = [
            (traversal, passage.visit(replace(each, object_number=numbers[each.object_number])))
            for traversal, each in self.other.load_visits()
        ]
        known = {(traversal, visit.object_number) for traversal, visit in counted} | {
            (traversal, numbers[each.number]) for traversal in {one for one, _ in counted} for each in others
        }
        told = [
            (traversal, said.visit(number))
            for (traversal, number), said in self.witness.visits.items()
            if (traversal, number) not in known
        ]
        return counted + told

    def _spatial_edges(self, passage: Passage, later: Sequence[StoredTraversal]) -> list[SpatialEdge]:
        lives = self.lives
        held = self.store.load_spatial_edges(open_only=False)
        others = [
            SpatialEdge(
                lives.numbers[each.subject],
                each.relation,
                lives.numbers[each.object],
                passage.time(each.since_ns),
                passage.maybe_time(each.until_ns),
                each.confidence,
            )
            for each in self.other.load_spatial_edges(open_only=False)
        ]
        changed = join_edges(held, others, lives.ends_ns)
        end_ns = max(passage.time(each.mapped_ns or each.end_ns) for each in later)
        judge_anew(changed, held, lives.objects, lives.changed, end_ns)
        return list(changed.values())

    def _summary(
        self, placement: Placement, time: TimeShift, names: Sequence[tuple[str, str]], *, dry_run: bool
    ) -> MergeSummary:
        warnings = (*placement.warnings, *(() if time.warning is None else (time.warning,)))
        return MergeSummary(
            placement,
            time,
            tuple(names),
            tuple(each for _, each in sorted(self.lives.joined.items())),
            self.other.instance_ids(),
            {each.number: each.label for each in self.other.load_instances(merged=True)},
            self.store.instance_ids(),
            tuple(self.lives.edges),
            not dry_run,
            warnings,
        )


def _names(earlier: Sequence[StoredTraversal], later: Sequence[StoredTraversal]) -> dict[int, str]:
    """A name here for every traversal of the other memory, by its id there."""
    taken = {each.name for each in earlier}
    names = {}
    for each in later:
        names[each.id] = unique_name(each.name, taken)
        taken.add(names[each.id])
    return names
