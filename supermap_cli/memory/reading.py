"""Reads for queries: traversals, instances with their states and visits, observations, edges, trajectories.

A map may hold a hundred thousand instances, so that queries read by number, by label or by place, through an index.
`instances` and what uses it read the whole map: they are for evaluation and export only.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from sqlalchemy import Connection, Select, and_, func, or_, select, text

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.memory import blobs, rows
from supermap_cli.memory.databases import Database
from supermap_cli.memory.instance_search import InstanceSearch
from supermap_cli.memory.lookups import LazyLookup
from supermap_cli.memory.numbers import BATCH, batches
from supermap_cli.memory.presence_query import PresenceQuery
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.memory.values import ObservationRef, ScoredObservation, StoredInstance, StoredTraversal, StoredVisit
from supermap_cli.types.memory import SpatialEdge, StateRecord, TemporalEdge, VoxelCloud
from supermap_schema import models

KEPT_INSTANCES = 10_000
"""Instances that one reader keeps, to be asked for again by the parts of a question; some 20 MB."""

COUNTED = {
    "instances": models.Instance,
    "states": models.State,
    "visits": models.Visit,
    "spatial_edges": models.SpatialEdge,
    "temporal_edges": models.TemporalEdge,
}


def select_traversals() -> Select[Any]:
    """All traversals in the order in which they were built."""
    return select(models.Traversal.__table__).order_by(models.Traversal.number)


class MapReader:
    """Reads of one snapshot, made by `MapStore.reader`. Merged instances count as their survivor everywhere."""

    def __init__(self, connection: Connection, database: Database) -> None:
        self.connection = connection
        self._database = database
        self._presence_queries: dict[tuple[int, int | None], PresenceQuery] = {}
        self._read_before: dict[int, StoredInstance | None] = {}
        self._parts_read: dict[int, tuple[int, ...]] = {}

    @property
    def where(self) -> str:
        """The map's path, or its URL without the password."""
        return self._database.where

    def size_bytes(self) -> int:
        """The size of the map on disk."""
        return self._database.size_bytes(self.connection)

    @cached_property
    def traversals(self) -> tuple[StoredTraversal, ...]:
        """All traversals in the order in which they were built."""
        return tuple(map(rows.stored_traversal, self.connection.execute(select_traversals())))

    @cached_property
    def now_ns(self) -> int:
        """The newest sensor time in the map; 0 if it is empty."""
        return max((traversal.mapped_ns or traversal.end_ns for traversal in self.traversals), default=0)

    @cached_property
    def search(self) -> InstanceSearch:
        """Finds instances by label, time and place."""
        return InstanceSearch(self.connection)

    def presence_at(self, at_ns: int, since_ns: int | None = None) -> PresenceQuery:
        """Presence of all instances at a time, or at the end of a traversal that began at `since_ns`."""
        query = PresenceQuery(self.connection, at_ns, since_ns)
        return self._presence_queries.setdefault((at_ns, since_ns), query)

    @cached_property
    def survivors(self) -> LazyLookup[int]:
        """An instance's number -> the number of the instance that it is merged into today, or its own."""
        return LazyLookup(self._survivors)

    @cached_property
    def text_ids(self) -> LazyLookup[str]:
        """The text id of any instance, merged ones included, by its number."""
        instance = models.Instance
        return LazyLookup(
            lambda numbers: {
                row.number: row.id
                for row in self.connection.execute(
                    select(instance.number, instance.id).where(instance.number.in_(numbers))
                )
            }
        )

    # Instances

    def instance(self, text_id: str) -> StoredInstance | None:
        """The instance with a text id, or the one that it was merged into; `None` if there is none."""
        spellings = {text_id, text_id.lower(), text_id.casefold()}
        statement = select(models.Instance.number).where(models.Instance.id.in_(spellings)).limit(1)
        number = self.connection.execute(statement).scalar()
        return None if number is None else self.instances_of([number])[0]

    def instances_of(
        self, numbers: Collection[int], *, visits: bool = True, traversal_ids: Collection[int] | None = None
    ) -> tuple[StoredInstance, ...]:
        """The surviving instances of the given numbers, without duplicates, in the order of their numbers.

        `visits` false: without their visits; `traversal_ids`: with the visits of these traversals only.
        """
        survivors = sorted(set(self.survivors.of(numbers).values()))
        wanted = traversal_ids if visits else ()
        return tuple(instance for batch in batches(survivors) for instance in self._whole(batch, wanted))

    def instances_by_number(
        self, numbers: Collection[int], traversal_ids: Collection[int] = ()
    ) -> dict[int, StoredInstance]:
        """Instances by their numbers, merged ones left out, with the visits of the given traversals only.

        Faster than `instances_of`; enough for selecting instances.
        """
        wanted = sorted(set(numbers))
        if traversal_ids:
            found: dict[int, StoredInstance] = {}
            for batch in batches(wanted):
                parts = self.parts_of(batch)
                visits = self._visits(parts, traversal_ids)
                found |= {instance.number: instance for instance in self._instances(batch, parts, visits)}
            return found
        if len(self._read_before) > KEPT_INSTANCES:
            self._read_before.clear()
        for batch in batches([number for number in wanted if number not in self._read_before]):
            read = self._instances(batch, {number: number for number in batch}, defaultdict(list))
            self._read_before |= dict.fromkeys(batch) | {instance.number: instance for instance in read}
        before = ((number, self._read_before[number]) for number in wanted)
        return {number: instance for number, instance in before if instance is not None}

    def read_before(self, numbers: Collection[int]) -> dict[int, StoredInstance | None]:
        """Those of the given instances that were read before, without their visits; `None` for merged ones."""
        return {number: self._read_before[number] for number in numbers if number in self._read_before}

    @cached_property
    def instances(self) -> tuple[StoredInstance, ...]:
        """All surviving instances in the order of their numbers."""
        return self.instances_of(self.connection.execute(select(models.Instance.number)).scalars().all())

    def iter_instances(self, *, visits: bool = True) -> Iterator[StoredInstance]:
        """As `instances`, but read while they are iterated over, so that memory does not grow with the map.

        `visits` false: without their visits, which are the largest part of an instance.
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
        """All instances that were not demoted."""
        return tuple(instance for instance in self.instances if instance.presence != "doubted")

    def supported_in(self, traversal_ids: Collection[int]) -> tuple[int, ...]:
        """The numbers of the instances that one of the traversals saw, ordered."""
        visit = models.Visit
        statement = select(visit.instance_number).where(visit.traversal_id.in_(traversal_ids), visit.supported > 0)
        seen = self.connection.execute(statement).scalars().all()
        return tuple(sorted(set(self.survivors.of(seen).values())))

    def changed_within(self, low_ns: int, high_ns: int) -> tuple[int, ...]:
        """The numbers of the instances with a state that began or ended within (low, high], ordered."""
        state = models.State
        number = select(state.instance_number)
        began = number.where(state.first_seen_ns > low_ns, state.first_seen_ns <= high_ns)
        ended = number.where(state.gone_ns > low_ns, state.gone_ns <= high_ns)
        return self._numbers(began, ended)

    def instances_placed_at(self, at_ns: int) -> tuple[int, ...]:
        """The numbers, ordered, of instances with a state that had begun by a time and is not known to have ended."""
        state = models.State
        held = and_(state.first_seen_ns <= at_ns, or_(state.gone_ns.is_(None), state.gone_ns > at_ns))
        return self._numbers(select(state.instance_number).where(held))

    def _numbers(self, *statements: Select[Any]) -> tuple[int, ...]:
        """The surviving instances of the numbers that the statements find."""
        found = {number for statement in statements for number in self.connection.execute(statement).scalars()}
        return tuple(sorted(set(self.survivors.of(found).values())))

    def voxels(self, instance: StoredInstance) -> VoxelCloud:
        """An instance's geometry in its current or last place."""
        found = self.connection.execute(select(models.Instance.voxels).where(models.Instance.number == instance.number))
        return blobs.decode_voxels(found.scalar_one())

    def voxels_of(self, numbers: Collection[int]) -> dict[int, VoxelCloud]:
        """The geometry of some instances in their current or last place, by number."""
        clouds: dict[int, VoxelCloud] = {}
        for batch in batches(sorted(numbers)):
            statement = select(models.Instance.number, models.Instance.voxels).where(models.Instance.number.in_(batch))
            clouds |= {row.number: blobs.decode_voxels(row.voxels) for row in self.connection.execute(statement)}
        return clouds

    # Observations

    def observations(self, instance: StoredInstance) -> tuple[ObservationRef, ...]:
        """The observations of an instance in the order of time."""
        observation = models.Observation
        statement = _ordered_by_time(
            select(
                *(observation.id, observation.keyframe_id, observation.instance_number, observation.label),
                *(observation.score, observation.evidence_for, observation.evidence_against),
                *(observation.x, observation.y, observation.z),
            ),
            instance,
        )
        return tuple(rows.observation_ref(row, self.survivors) for row in self.connection.execute(statement))

    def camera_positions(self, keyframe_ids: Collection[int]) -> dict[int, FloatArray]:
        """Where the camera of each keyframe was in the map, (3,) metres, by keyframe id."""
        keyframe = models.Keyframe
        positions: dict[int, FloatArray] = {}
        for batch in batches(sorted(keyframe_ids)):
            statement = select(keyframe.id, keyframe.T_map_camera).where(keyframe.id.in_(batch))
            for row in self.connection.execute(statement):
                positions[row.id] = parsed_transform(row.T_map_camera, f"the camera of keyframe {row.id}")[:3, 3]
        return positions

    def scored_observations(self, instance: StoredInstance) -> tuple[ScoredObservation, ...]:
        """As `observations`, with their scores only: all but the stamps come from an index."""
        statement = _ordered_by_time(select(models.Observation.id, models.Observation.score), instance)
        found = self.connection.execute(statement)
        return tuple(ScoredObservation(row.id, row.traversal_id, row.stamp_ns, row.score) for row in found)

    # Edges

    def edges_of(
        self, numbers: Collection[int], relations: Collection[str] | None = None, *, open_only: bool = False
    ) -> tuple[SpatialEdge, ...]:
        """The spatial edges that begin or end at one of the given instances, in the order of their row ids. Of those
        that a merge made one (a relation of a part and of the survivor that began at once), the one that lasts longest.
        """
        edge = models.SpatialEdge
        named = [] if relations is None else [edge.relation.in_(relations)]
        found: dict[int, Any] = {}
        for batch in batches(list(self.parts_of(numbers))):
            ends = (edge.subject_number, edge.object_number)
            begun, ended = (select(edge.__table__).where(end.in_(batch), *named) for end in ends)
            found |= {row.id: row for row in self.connection.execute(begun.union_all(ended))}
        survivors = self.survivors.of({n for row in found.values() for n in (row.subject_number, row.object_number)})
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for _, row in sorted(found.items()):
            subject, obj = survivors[row.subject_number], survivors[row.object_number]
            if subject != obj:
                stored = SpatialEdge(subject, row.relation, obj, row.since_ns, row.until_ns, row.confidence)
                key = (subject, row.relation, obj, row.since_ns)
                if key not in edges or _lasts_longer(stored, edges[key]):
                    edges[key] = stored
        return tuple(edge for edge in edges.values() if edge.until_ns is None or not open_only)

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

    def temporal_edges_within(self, low_ns: int, high_ns: int) -> tuple[TemporalEdge, ...]:
        """The temporal edges whose bounds overlap [low_ns, high_ns], ordered by time."""
        edge = models.TemporalEdge
        began = or_(edge.not_before_ns.is_(None), edge.not_before_ns <= high_ns, edge.not_after_ns <= high_ns)
        statement = select(edge.__table__).where(edge.not_after_ns >= low_ns, began)
        return tuple(map(rows.temporal_edge, self.connection.execute(statement.order_by(edge.not_after_ns, edge.id))))

    # Trajectories

    def trajectory(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """The robot's trajectory in one traversal: (n,) stamps and (n, 3) positions in the map."""
        stamps_ns, T_map_base = self.poses(traversal_id)
        return stamps_ns, T_map_base[:, :3, 3]

    def poses(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """(n,) stamps of a traversal's keyframes and (n, 4, 4) `T_map_base`; cameras of one stamp share a pose."""
        statement = (
            select(models.Keyframe.stamp_ns, models.Keyframe.T_map_base)
            .where(models.Keyframe.traversal_id == traversal_id)
            .order_by(models.Keyframe.stamp_ns, models.Keyframe.id)
        )
        found = {row.stamp_ns: row.T_map_base for row in self.connection.execute(statement)}
        poses = [parsed_transform(T_map_base, f"the pose at {stamp_ns}") for stamp_ns, T_map_base in found.items()]
        return np.array(list(found), np.int64), np.array(poses, np.float64).reshape(-1, 4, 4)

    def last_pose(self) -> FloatArray | None:
        """Where the robot was at the newest keyframe of the latest traversal that has one: (4, 4) `T_map_base`."""
        keyframe = models.Keyframe
        for traversal in reversed(self.traversals):
            statement = (
                select(keyframe.T_map_base)
                .where(keyframe.traversal_id == traversal.id)
                .order_by(keyframe.stamp_ns.desc(), keyframe.id.desc())
                .limit(1)
            )
            written = self.connection.execute(statement).scalar()
            if written is not None:
                return parsed_transform(written, f"the last pose in {traversal.name}")
        return None

    def keyframe_cameras(self, traversal_id: int) -> list[tuple[int, str]]:
        """The stamp and camera of each keyframe of a traversal, in the order of stamps."""
        statement = (
            select(models.Keyframe.stamp_ns, models.Keyframe.camera_id)
            .where(models.Keyframe.traversal_id == traversal_id)
            .order_by(models.Keyframe.stamp_ns, models.Keyframe.id)
        )
        return [(row.stamp_ns, row.camera_id) for row in self.connection.execute(statement)]

    # The whole map

    def counts(self) -> dict[str, int]:
        """Numbers of rows by table; those of keyframes and observations are stored with the traversals."""
        return {
            "traversals": len(self.traversals),
            "keyframes": sum(traversal.keyframes for traversal in self.traversals),
            "observations": sum(traversal.observations for traversal in self.traversals),
        } | {
            name: self.connection.execute(select(func.count()).select_from(model)).scalar_one()
            for name, model in COUNTED.items()
        }

    def revision(self) -> str:
        """The revision of the newest migration that was applied."""
        return str(self.connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one())

    # Merged instances

    def parts_of(self, numbers: Collection[int]) -> dict[int, int]:
        """The given instances and those merged into them: number -> the given one's number; where one of the given is
        merged into another, the other's.
        """
        instance = models.Instance
        if len(self._parts_read) > KEPT_INSTANCES:
            self._parts_read.clear()
        for batch in batches(sorted(set(numbers) - self._parts_read.keys())):
            start = select(instance.number, instance.number.label("survivor")).where(instance.number.in_(batch))
            part = start.cte("part", recursive=True)
            merged = select(instance.number, part.c.survivor).join(part, instance.merged_into == part.c.number)
            own: dict[int, list[int]] = {number: [] for number in batch}
            for row in self.connection.execute(select(part.union(merged))):
                own[row.survivor].append(row.number)
            self._parts_read |= {number: tuple(sorted(parts)) for number, parts in own.items()}
        whole_last = sorted(numbers, key=lambda number: len(self._parts_read[number]))
        return dict(sorted({part: number for number in whole_last for part in self._parts_read[number]}.items()))

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
        """Surviving instances with their states, and the visits of the traversals (`None`: of all)."""
        parts = self.parts_of(survivors)
        with_visits = traversal_ids is None or len(traversal_ids) > 0
        visits = self._visits(parts, traversal_ids) if with_visits else defaultdict(list)
        return self._instances(survivors, parts, visits)

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
            self.survivors[number] = number
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
        """Visits (of some traversals) by surviving instance, summed over those merged into it."""
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


def _lasts_longer(edge: SpatialEdge, other: SpatialEdge) -> bool:
    """Whether an edge ends later than another; an open one does."""
    return other.until_ns is not None and (edge.until_ns is None or edge.until_ns > other.until_ns)


def _ordered_by_time(statement: Select[*tuple[Any, ...]], instance: StoredInstance) -> Select[*tuple[Any, ...]]:
    """The statement on observations, for those of an instance, with traversal and stamp, in the order of time."""
    keyframe, observation = models.Keyframe, models.Observation
    return (
        statement.add_columns(keyframe.traversal_id, keyframe.stamp_ns)
        .join(keyframe, keyframe.id == observation.keyframe_id)
        .where(observation.instance_number.in_(instance.numbers))
        .order_by(keyframe.stamp_ns, observation.id)
    )
