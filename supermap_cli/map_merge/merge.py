"""Merges another map into this one: registration, time shift, object matching, state merge, one transaction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from supermap_cli.errors import MemoryStoreError
from supermap_cli.map_merge.depth_consistency import DepthConsistency, ViewCounts
from supermap_cli.map_merge.displacement import displacement_hypothesis
from supermap_cli.map_merge.matching import ImportedObject, imported_object, match_in_place, match_parts
from supermap_cli.map_merge.registration import register_map
from supermap_cli.map_merge.relations import merge_edges, reevaluate_edges
from supermap_cli.map_merge.state_merge import ObjectMatch, StateMerge
from supermap_cli.map_merge.transform import MapTransform
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.mapping.walls import WallMap
from supermap_cli.memory.checking import check
from supermap_cli.memory.map_import import MapImport
from supermap_cli.memory.names import unique_name
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.time_order import TimeShift, shift_to_follow
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.stages.map_registration import Placement
from supermap_cli.types.memory import KeyframeRecord, MapDelta, SpatialEdge, StateRecord, TemporalEdge, Visit

Progress = Callable[[int, int], None]
"""Called with how many of the other map's keyframes were compared, and how many there are."""


@dataclass(frozen=True)
class MergeSummary:
    """The result of a merge.

    `names` are the traversals' names in the other map and here; `other_ids` and `labels` the other map's text ids and
    labels by number; `ids` the text ids that were here before; `changes` the temporal edges that the merge added.
    """

    placement: Placement
    time: TimeShift
    names: tuple[tuple[str, str], ...]
    matches: tuple[ObjectMatch, ...]
    other_ids: dict[int, str]
    labels: dict[int, str]
    ids: dict[int, str]
    changes: tuple[TemporalEdge, ...]
    written: bool
    warnings: tuple[str, ...] = ()


@dataclass
class MapMerge:
    """Merges `other`, which is only read, into `store`."""

    store: MapStore
    other: MapStore
    again: bool = False
    progress: Progress | None = None
    _walls: WallMap = field(default_factory=WallMap, init=False, repr=False)

    def run(self, align: str = "auto", *, dry_run: bool = False) -> MergeSummary:
        """Merge the other map in one transaction; with `dry_run` nothing is written.

        Raises `MemoryStoreError` where one of the maps cannot be merged, `AlignmentError` where registration fails.
        """
        earlier, later = self.store.traversals(), self.other.traversals()
        self._check(earlier, later)
        for store in (self.store, self.other):
            _check_is_sound(store)
        placement = register_map(self.store, self.other, align)
        names = _names(earlier, later)
        time = shift_to_follow(names[later[0].id], min(traversal.start_ns for traversal in later), earlier)
        transform = MapTransform(placement.T_map_odom, time.shift_ns)
        others = self._imported_objects(transform)
        objects = restore_objects(self.store.load_instances(), self.store.next_object_number())
        states, views = self._merge_objects(objects, others, transform)
        deltas = self._deltas(transform, later, states, self._visits(transform, others, states.numbers, views))
        summary = MergeSummary(
            placement,
            time,
            tuple((traversal.name, names[traversal.id]) for traversal in later),
            tuple(match for _, match in sorted(states.matches.items())),
            self.other.instance_ids(),
            {record.number: record.label for record in self.other.load_instances(merged=True)},
            self.store.instance_ids(),
            tuple(states.edges),
            not dry_run,
            (*placement.warnings, *(() if time.warning is None else (time.warning,))),
        )
        if not dry_run:
            imported = MapImport(placement.T_map_odom, time.shift_ns, names, states.numbers, deltas, self.other.where)
            self.store.import_map(self.other, imported)
        return summary

    def _check(self, earlier: Sequence[StoredTraversal], later: Sequence[StoredTraversal]) -> None:
        """Both maps are complete, not empty, and hold no recording in common, unless `again`."""
        if self.store.identity == self.other.identity:
            raise MemoryStoreError("a map cannot be merged with itself", where=self.store.where, cure="name another")
        for store, traversals in ((self.store, earlier), (self.other, later)):
            if not any(traversal.keyframes for traversal in traversals):
                raise MemoryStoreError(
                    "there is nothing in the map", where=store.where, cure="build a recording into it"
                )
            if (unfinished := store.unfinished()) is not None:
                raise MemoryStoreError(
                    f"the build of {unfinished.name!r} has not come to its end",
                    where=store.where,
                    cure="let it go on with `supermap build --resume`, or take out what it wrote (--restart)",
                )
        known = {traversal.fingerprint: traversal.name for traversal in earlier}
        both = [
            f"{traversal.name!r} is {known[traversal.fingerprint]!r}"
            for traversal in later
            if traversal.fingerprint in known
        ]
        if both and not self.again:
            raise MemoryStoreError(
                f"the same recording is in both maps: {', '.join(both)}",
                where=self.other.where,
                cure="merge maps of other recordings, or take it in once more (--again)",
            )

    # Objects

    def _imported_objects(self, transform: MapTransform) -> list[ImportedObject]:
        """All objects of the other map, in this map's frame and time."""
        states: dict[int, list[StateRecord]] = defaultdict(list)
        for state in self.other.load_states():
            states[state.object_number].append(transform.state(state))
        return [
            imported_object(record, states[record.number], transform.map_object(record, -record.number))
            for record in self.other.load_instances(merged=True)
        ]

    def _merge_objects(
        self, objects: ObjectMap, others: Sequence[ImportedObject], transform: MapTransform
    ) -> tuple[StateMerge, Mapping[tuple[int, int], ViewCounts]]:
        """Match objects in their places, compare the rest with the other map's depth images, match that elsewhere.

        Returns the merged states, and in how many views of each of the other map's traversals an object was.
        """
        matchable = {id(other.first): other for other in others if other.is_matchable}
        static = [obj for obj in objects if not obj.is_dynamic]
        pairs = match_in_place(static, [other.first for other in matchable.values()])
        matched = {id(first) for _, first in pairs}
        parts = match_parts(static, [other.first for other in matchable.values() if id(other.first) not in matched])
        present = frozenset(obj.number for obj in objects if obj.present)
        displacements = {
            known.number: found
            for known, first in pairs
            if known.number in present and (found := displacement_hypothesis(known, first)) is not None
        }
        consistency = DepthConsistency(objects, frozenset(known.number for known, _ in (*pairs, *parts)), displacements)
        for traversal_id, keyframe in self._keyframes(transform):
            consistency.add_keyframe(traversal_id, keyframe)
            self._walls.add_record(keyframe)
        states = StateMerge(objects, present, self._free_space())
        for known, first in pairs:
            states.merge_in_place(known, matchable[id(first)], displacements.get(known.number))
        for whole, first in parts:
            states.merge_part(whole, matchable[id(first)])
        states.close_unmatched()
        states.merge_elsewhere([other for other in others if other.number not in states.numbers])
        with self.other.reader() as reader:
            states.import_temporal_edges([transform.edge(edge) for edge in reader.temporal_edges()])
        return states, consistency.views

    def _keyframes(self, transform: MapTransform) -> Iterator[tuple[int, KeyframeRecord]]:
        """The other map's keyframes with their traversal's id there, in this map's frame and time."""
        traversals = self.other.traversals()
        count, done = sum(traversal.keyframes for traversal in traversals), 0
        for traversal in traversals:
            for record in self.other.keyframe_depths([traversal.id]):
                yield traversal.id, transform.keyframe(record)
                done += 1
                if self.progress is not None:
                    self.progress(done, count)

    def _free_space(self) -> FreeSpaceMemory:
        """Where and when this map saw free space."""
        free_space = FreeSpaceMemory()
        for traversal in self.store.traversals():
            for record in self.store.keyframe_depths([traversal.id]):
                free_space.add_record(traversal.number, record)
                self._walls.add_record(record)
        return free_space

    # Rows

    def _deltas(
        self,
        transform: MapTransform,
        later: Sequence[StoredTraversal],
        merged: StateMerge,
        visits: Sequence[tuple[int, Visit]],
    ) -> dict[int, MapDelta]:
        """All rows but keyframes and observations, by the other map's traversal in whose time they fall."""
        starts = [(transform.time(traversal.start_ns), traversal.id) for traversal in later]

        def traversal_at(stamp_ns: int) -> int:
            return next((id_ for start_ns, id_ in reversed(starts) if start_ns <= stamp_ns), later[0].id)

        spatial = self._spatial_edges(transform, later, merged)
        instances = merged.instances()
        return {
            id_: MapDelta(
                instances=tuple(record for record in instances if traversal_at(record.first_seen_ns) == id_),
                states=tuple(state for state in merged.states if traversal_at(state.first_seen_ns) == id_),
                visits=tuple(visit for traversal_id, visit in visits if traversal_id == id_),
                spatial_edges=tuple(edge for edge in spatial if traversal_at(edge.since_ns) == id_),
                temporal_edges=tuple(edge for edge in merged.edges if traversal_at(edge.not_after_ns) == id_),
            )
            for _, id_ in starts
        }

    def _visits(
        self,
        transform: MapTransform,
        others: Sequence[ImportedObject],
        numbers: Mapping[int, int],
        views: Mapping[tuple[int, int], ViewCounts],
    ) -> list[tuple[int, Visit]]:
        """Visits by the other map's traversals: as stored there, and of objects it did not know as its images show."""
        stored = [
            (traversal_id, transform.visit(replace(visit, object_number=numbers[visit.object_number])))
            for traversal_id, visit in self.other.load_visits()
        ]
        known = {(traversal_id, visit.object_number) for traversal_id, visit in stored} | {
            (traversal_id, numbers[other.number])
            for traversal_id in {traversal_id for traversal_id, _ in stored}
            for other in others
        }
        seen = [
            (traversal_id, counts.visit(number))
            for (traversal_id, number), counts in views.items()
            if (traversal_id, number) not in known
        ]
        return stored + seen

    def _spatial_edges(
        self, transform: MapTransform, later: Sequence[StoredTraversal], merged: StateMerge
    ) -> list[SpatialEdge]:
        held = self.store.load_spatial_edges(open_only=False)
        others = [
            SpatialEdge(
                merged.numbers[edge.subject],
                edge.relation,
                merged.numbers[edge.object],
                transform.time(edge.since_ns),
                transform.optional_time(edge.until_ns),
                edge.confidence,
            )
            for edge in self.other.load_spatial_edges(open_only=False)
        ]
        changed = merge_edges(held, others, merged.state_ends_ns)
        end_ns = max(transform.time(traversal.mapped_ns or traversal.end_ns) for traversal in later)
        reevaluate_edges(changed, held, merged.objects, merged.changed, end_ns, walls=self._walls)
        return list(changed.values())


def _check_is_sound(store: MapStore) -> None:
    """Raise `MemoryStoreError` for a map that breaks its own invariants: what is merged cannot be taken apart again."""
    with store.reader() as reader:
        problems = check(reader)
    if problems:
        first = problems[0]
        raise MemoryStoreError(
            f"the map is damaged: {first.table} {first.row} {first.what}",
            where=store.where,
            cure="try `supermap db upgrade`, then `supermap db check --repair`; at last `supermap db recover`",
        )


def _names(earlier: Sequence[StoredTraversal], later: Sequence[StoredTraversal]) -> dict[int, str]:
    """A free name here for every traversal of the other map, by its id there."""
    taken = {traversal.name for traversal in earlier}
    names = {}
    for traversal in later:
        names[traversal.id] = unique_name(traversal.name, taken)
        taken.add(names[traversal.id])
    return names
