"""What questions read: traversals, instances with their states and visits, observations, edges, trajectories.

A map may hold a hundred thousand instances: everything is asked for by number, by label or by place, through an index.
`instances` and what rests on it is for those who go through the whole map (evaluation, export), never for a question.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from sqlalchemy import Connection, Select, and_, func, or_, select, text

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.memory import blobs, rows
from supermap_cli.memory.as_of import AsOf
from supermap_cli.memory.databases import Database
from supermap_cli.memory.finding import Finder
from supermap_cli.memory.numbers import BATCH, batches
from supermap_cli.memory.values import ObservationRef, Sighting, StoredInstance, StoredTraversal, StoredVisit
from supermap_cli.types.memory import SpatialEdge, StateRecord, TemporalEdge, VoxelCloud
from supermap_schema import models

V = TypeVar("V")

COUNTED = {
    "instances": models.Instance,
    "states": models.State,
    "visits": models.Visit,
    "spatial_edges": models.SpatialEdge,
    "temporal_edges": models.TemporalEdge,
}


def select_traversals() -> Select[Any]:
    """All traversals in the order of building."""
    return select(models.Traversal.__table__).order_by(models.Traversal.number)


class LookedUp(dict[int, V], Generic[V]):
    """What is known of instances by their numbers: read when it is asked for, and kept."""

    def __init__(self, read: Callable[[Collection[int]], dict[int, V]]) -> None:
        super().__init__()
        self._read = read

    def __missing__(self, number: int) -> V:
        self.update(self._read([number]))
        return self[number]

    def of(self, numbers: Iterable[int]) -> dict[int, V]:
        """Those of many numbers, read together."""
        wanted = set(numbers)
        for batch in batches(sorted(wanted - self.keys())):
            self.update(self._read(batch))
        return {number: self[number] for number in wanted if number in self}


class MapReader:
    """Reads of one moment (`MapStore.reader` makes it). What was merged counts for its survivor everywhere."""

    def __init__(self, connection: Connection, database: Database) -> None:
        self.connection = connection
        self._database = database
        self._times: dict[tuple[int, int | None], AsOf] = {}

    @property
    def where(self) -> str:
        """The map's place for people: a path, or a URL without its password."""
        return self._database.where

    def size_bytes(self) -> int:
        """What the map takes on the disk."""
        return self._database.size_bytes(self.connection)

    @cached_property
    def traversals(self) -> tuple[StoredTraversal, ...]:
        """All traversals in the order of building."""
        return tuple(map(rows.stored_traversal, self.connection.execute(select_traversals())))

    @cached_property
    def now_ns(self) -> int:
        """The newest sensor time the map knows of; 0 for an empty map."""
        return max((each.mapped_ns or each.end_ns for each in self.traversals), default=0)

    @cached_property
    def finder(self) -> Finder:
        """Finds instances by what they are called, when and where they stood."""
        return Finder(self.connection)

    def as_of(self, at_ns: int, since_ns: int | None = None) -> AsOf:
        """All that stood at a time, or at the end of a traversal that began at `since_ns`."""
        return self._times.setdefault((at_ns, since_ns), AsOf(self.connection, at_ns, since_ns))

    @cached_property
    def survivors(self) -> LookedUp[int]:
        """An instance's number -> the number of the instance it is part of today (its own, if it was not merged)."""
        return LookedUp(self._survivors)

    @cached_property
    def text_ids(self) -> LookedUp[str]:
        """The text id of any instance there ever was, by its number."""
        instance = models.Instance
        return LookedUp(
            lambda numbers: {
                row.number: row.id
                for row in self.connection.execute(
                    select(instance.number, instance.id).where(instance.number.in_(numbers))
                )
            }
        )

    # Instances

    def instance(self, text_id: str) -> StoredInstance | None:
        """The instance of a text id, or the one it was merged into; `None` if there never was one."""
        spelt = {text_id, text_id.lower(), text_id.casefold()}
        statement = select(models.Instance.number).where(models.Instance.id.in_(spelt)).limit(1)
        number = self.connection.execute(statement).scalar()
        return None if number is None else self.instances_of([number])[0]

    def instances_of(
        self, numbers: Collection[int], *, visits: bool = True, traversal_ids: Collection[int] | None = None
    ) -> tuple[StoredInstance, ...]:
        """The instances that the given numbers are part of today, each once, in the order of their numbers; without
        their visits, or with those of some traversals only, if no others are wanted.
        """
        survivors = sorted(set(self.survivors.of(numbers).values()))
        wanted = traversal_ids if visits else ()
        return tuple(instance for batch in batches(survivors) for instance in self._whole(batch, wanted))

    def lives_of(self, numbers: Collection[int], traversal_ids: Collection[int] = ()) -> dict[int, StoredInstance]:
        """Instances that were not merged, by their numbers, with the visits of the given traversals only: enough to
        choose by, and read faster.
        """
        found: dict[int, StoredInstance] = {}
        for batch in batches(sorted(set(numbers))):
            parts = self.parts_of(batch) if traversal_ids else {number: number for number in batch}
            visits = self._visits(parts, traversal_ids) if traversal_ids else defaultdict(list)
            found |= {each.number: each for each in self._instances(batch, parts, visits)}
        return found

    @cached_property
    def instances(self) -> tuple[StoredInstance, ...]:
        """All instances in the order of their numbers, those merged into others as part of them."""
        return self.instances_of(self.connection.execute(select(models.Instance.number)).scalars().all())

    def each_instance(self, *, visits: bool = True) -> Iterator[StoredInstance]:
        """As `instances`, but read while they are taken and not kept: for what goes through a map of any size.

        Without `visits`, which are most of what belongs to an instance, they have none.
        """
        instance = models.Instance
        statement = select(instance.number).where(instance.merged_into.is_(None)).order_by(instance.number)
        numbers = self.connection.execute(statement.limit(BATCH)).scalars().all()
        while numbers:
            yield from self._whole(numbers, None if visits else ())
            later = statement.where(instance.number > numbers[-1])
            numbers = self.connection.execute(later.limit(BATCH)).scalars().all()

    @property
    def believed(self) -> tuple[StoredInstance, ...]:
        """All instances but those that the evidence no longer says were ever real."""
        return tuple(each for each in self.instances if each.presence != "doubted")

    def supported_in(self, traversal_ids: Collection[int]) -> tuple[int, ...]:
        """The numbers of the instances that one of the traversals saw, in order."""
        visit = models.Visit
        statement = select(visit.instance_number).where(visit.traversal_id.in_(traversal_ids), visit.supported > 0)
        seen = self.connection.execute(statement).scalars().all()
        return tuple(sorted(set(self.survivors.of(seen).values())))

    def changed_within(self, low_ns: int, high_ns: int) -> tuple[int, ...]:
        """The numbers of the instances of which a state began or ended within (low, high], in order."""
        state = models.State
        number = select(state.instance_number)
        began = number.where(state.first_seen_ns > low_ns, state.first_seen_ns <= high_ns)
        ended = number.where(state.gone_ns > low_ns, state.gone_ns <= high_ns)
        return self._numbers(began, ended)

    def standing_at(self, at_ns: int) -> tuple[int, ...]:
        """The numbers of the instances of which a state had begun by a time and was not known to have ended."""
        state = models.State
        held = and_(state.first_seen_ns <= at_ns, or_(state.gone_ns.is_(None), state.gone_ns > at_ns))
        return self._numbers(select(state.instance_number).where(held))

    def _numbers(self, *statements: Select[Any]) -> tuple[int, ...]:
        """The numbers that statements find, as those of the instances that they are part of today."""
        found = {number for each in statements for number in self.connection.execute(each).scalars()}
        return tuple(sorted(set(self.survivors.of(found).values())))

    def voxels(self, instance: StoredInstance) -> VoxelCloud:
        """An instance's geometry, in its present or last place."""
        found = self.connection.execute(select(models.Instance.voxels).where(models.Instance.number == instance.number))
        return blobs.decode_voxels(found.scalar_one())

    # Observations

    def observations(self, instance: StoredInstance) -> tuple[ObservationRef, ...]:
        """What was seen of an instance, in the order of time."""
        observation = models.Observation
        told = (observation.id, observation.keyframe_id, observation.instance_number, observation.label)
        weighed = (observation.score, observation.evidence_for, observation.evidence_against)
        where = (observation.x, observation.y, observation.z)
        statement = _in_time(select(*told, *weighed, *where), instance)
        return tuple(rows.observation_ref(row, self.survivors) for row in self.connection.execute(statement))

    def sightings(self, instance: StoredInstance) -> tuple[Sighting, ...]:
        """When and how surely an instance was seen, in the order of time: answered by an index alone, but for when."""
        statement = _in_time(select(models.Observation.id, models.Observation.score), instance)
        found = self.connection.execute(statement)
        return tuple(Sighting(row.id, row.traversal_id, row.stamp_ns, row.score) for row in found)

    # Edges

    def edges_of(
        self, numbers: Collection[int], relations: Collection[str] | None = None, *, open_only: bool = False
    ) -> tuple[SpatialEdge, ...]:
        """The spatial edges at either end of which one of the given instances stands, in the order of writing."""
        ends = list(self.parts_of(numbers))
        edge = models.SpatialEdge
        found: dict[int, Any] = {}
        for end in (edge.subject_number, edge.object_number):
            for batch in batches(ends):
                statement = select(edge.__table__).where(end.in_(batch))
                if relations is not None:
                    statement = statement.where(edge.relation.in_(relations))
                found |= {row.id: row for row in self.connection.execute(statement)}
        survivors = self.survivors.of({n for row in found.values() for n in (row.subject_number, row.object_number)})
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for _, row in sorted(found.items()):
            subject, obj = survivors[row.subject_number], survivors[row.object_number]
            if subject != obj:
                stored = SpatialEdge(subject, row.relation, obj, row.since_ns, row.until_ns, row.confidence)
                edges[subject, row.relation, obj, row.since_ns] = stored
        return tuple(each for each in edges.values() if each.until_ns is None or not open_only)

    def temporal_edges(self, numbers: Collection[int] | None = None) -> tuple[TemporalEdge, ...]:
        """All temporal edges (or those that touch one of the given numbers), in the order of time."""
        edge = models.TemporalEdge
        statement = select(edge.__table__).order_by(edge.not_after_ns, edge.id)
        if numbers is None:
            return tuple(map(rows.temporal_edge, self.connection.execute(statement)))
        found: dict[tuple[int, int], Any] = {}
        for batch in batches(sorted(numbers)):
            touching = statement.where(or_(edge.from_number.in_(batch), edge.to_number.in_(batch)))
            found |= {(row.not_after_ns, row.id): row for row in self.connection.execute(touching)}
        return tuple(rows.temporal_edge(row) for _, row in sorted(found.items()))

    # Ways

    def trajectory(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """The robot's way in one traversal: (n,) stamps and (n, 3) positions in the map."""
        stamps_ns, T_map_base = self.poses(traversal_id)
        return stamps_ns, T_map_base[:, :3, 3]

    def poses(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """One traversal's keyframes, each stamp once, however many cameras share it: (n,) stamps and (n, 4, 4)
        `T_map_base`.
        """
        statement = (
            select(models.Keyframe.stamp_ns, models.Keyframe.T_map_base)
            .where(models.Keyframe.traversal_id == traversal_id)
            .order_by(models.Keyframe.stamp_ns, models.Keyframe.id)
        )
        found = {row.stamp_ns: row.T_map_base for row in self.connection.execute(statement)}
        poses = [json.loads(T_map_base) for T_map_base in found.values()]
        return np.array(list(found), np.int64), np.array(poses, np.float64).reshape(-1, 4, 4)

    # The whole

    def counts(self) -> dict[str, int]:
        """How many rows there are of what; traversals know how many keyframes and observations they have."""
        return {
            "traversals": len(self.traversals),
            "keyframes": sum(each.keyframes for each in self.traversals),
            "observations": sum(each.observations for each in self.traversals),
        } | {
            name: self.connection.execute(select(func.count()).select_from(model)).scalar_one()
            for name, model in COUNTED.items()
        }

    def revision(self) -> str:
        """The newest migration the database went through."""
        return str(self.connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one())

    # Rows by number

    def parts_of(self, numbers: Collection[int]) -> dict[int, int]:
        """All that was merged into the given instances, and they themselves: each one's number -> its survivor's."""
        instance = models.Instance
        parts: dict[int, int] = {}
        for batch in batches(sorted(numbers)):
            start = select(instance.number, instance.number.label("survivor")).where(instance.number.in_(batch))
            part = start.cte("part", recursive=True)
            merged = select(instance.number, part.c.survivor).join(part, instance.merged_into == part.c.number)
            found = self.connection.execute(select(part.union(merged)))
            parts |= {row.number: row.survivor for row in found}
        return dict(sorted(parts.items()))

    def _survivors(self, numbers: Collection[int]) -> dict[int, int]:
        """Follows merges of merges, one step of all at a time."""
        instance = models.Instance
        end = {number: number for number in numbers}
        into: dict[int, int | None] = {}
        asked = set(end)
        while asked:
            statement = select(instance.number, instance.merged_into).where(instance.number.in_(asked))
            found = {row.number: row.merged_into for row in self.connection.execute(statement)}
            into |= found
            asked = {merged for merged in found.values() if merged is not None} - into.keys()
        for number in numbers:
            seen = {number}
            while (further := into.get(end[number])) is not None and further not in seen:
                end[number] = further
                seen.add(further)
        return {number: survivor for number, survivor in end.items() if number in into}

    def _whole(self, survivors: Sequence[int], traversal_ids: Collection[int] | None) -> Iterator[StoredInstance]:
        """Instances that were not merged, with all that belongs to them, and the visits of the traversals (all)."""
        parts = self.parts_of(survivors)
        looked = traversal_ids is None or len(traversal_ids) > 0
        return self._instances(survivors, parts, self._visits(parts, traversal_ids) if looked else defaultdict(list))

    def _instances(
        self, survivors: Collection[int], parts: dict[int, int], visits: dict[int, list[StoredVisit]]
    ) -> Iterator[StoredInstance]:
        numbers: dict[int, list[int]] = defaultdict(list)
        for number, survivor in parts.items():
            numbers[survivor].append(number)
        states = self._states(survivors)
        instance = models.Instance
        wanted = select(*rows.INSTANCE_WITHOUT_GEOMETRY).where(instance.number.in_(survivors))
        for row in self.connection.execute(wanted.where(instance.merged_into.is_(None)).order_by(instance.number)):
            number = row.number
            yield rows.stored_instance(row, tuple(numbers[number]), tuple(states[number]), tuple(visits[number]))

    def _states(self, numbers: Collection[int]) -> dict[int, list[StateRecord]]:
        state = models.State
        statement = select(state.__table__).where(state.instance_number.in_(numbers))
        states: dict[int, list[StateRecord]] = defaultdict(list)
        for row in self.connection.execute(statement.order_by(state.instance_number, state.state_index)):
            states[row.instance_number].append(rows.state_record(row))
        return states

    def _visits(
        self, parts: dict[int, int], traversal_ids: Collection[int] | None = None
    ) -> dict[int, list[StoredVisit]]:
        """Visits (of some traversals) by survivor, summed over those merged into it."""
        summed: dict[tuple[int, int], StoredVisit] = {}
        for batch in batches(list(parts)):
            statement = select(models.Visit.__table__).where(models.Visit.instance_number.in_(batch))
            if traversal_ids is not None:
                statement = statement.where(models.Visit.traversal_id.in_(traversal_ids))
            for row in self.connection.execute(statement):
                key = parts[row.instance_number], row.traversal_id
                summed[key] = rows.added_visit(summed.get(key), row, key[0])
        visits: dict[int, list[StoredVisit]] = defaultdict(list)
        for (survivor, _), visit in sorted(summed.items(), key=lambda item: item[0][1]):
            visits[survivor].append(visit)
        return visits


def _in_time(statement: Select[*tuple[Any, ...]], instance: StoredInstance) -> Select[*tuple[Any, ...]]:
    """Observations of an instance with their traversal and stamp, in the order of time."""
    keyframe, observation = models.Keyframe, models.Observation
    return (
        statement.add_columns(keyframe.traversal_id, keyframe.stamp_ns)
        .join(keyframe, keyframe.id == observation.keyframe_id)
        .where(observation.instance_number.in_(instance.numbers))
        .order_by(keyframe.stamp_ns, observation.id)
    )
