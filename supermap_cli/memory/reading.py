"""What questions read: traversals, instances with their states and visits, observations, edges, trajectories."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Collection
from functools import cached_property
from typing import Any

import numpy as np
from sqlalchemy import Connection, Select, func, or_, select, text

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.memory import blobs, rows
from supermap_cli.memory.databases import Database
from supermap_cli.memory.values import ObservationRef, StoredInstance, StoredTraversal, StoredVisit
from supermap_cli.types.memory import SpatialEdge, StateRecord, TemporalEdge, VoxelCloud
from supermap_schema import models

COUNTED = {
    "traversals": models.Traversal,
    "keyframes": models.Keyframe,
    "observations": models.Observation,
    "instances": models.Instance,
    "states": models.State,
    "visits": models.Visit,
    "spatial_edges": models.SpatialEdge,
    "temporal_edges": models.TemporalEdge,
}


def select_traversals() -> Select[Any]:
    """All traversals with the count of their keyframes, in the order of building."""
    keyframes = (
        select(func.count()).where(models.Keyframe.traversal_id == models.Traversal.id).correlate(models.Traversal)
    )
    columns = select(models.Traversal.__table__, keyframes.scalar_subquery().label("keyframes"))
    return columns.order_by(models.Traversal.number)


class MapReader:
    """Reads of one moment (`MapStore.reader` makes it). What was merged counts for its survivor everywhere."""

    def __init__(self, connection: Connection, database: Database) -> None:
        self.connection = connection
        self._database = database

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
    def survivors(self) -> dict[int, int]:
        """Every instance's number -> the number of the instance it is part of today (its own, if it was not merged)."""
        merged = self.connection.execute(select(models.Instance.number, models.Instance.merged_into)).all()
        parent = {row.number: row.merged_into for row in merged}
        survivor = {}
        for number in parent:
            end, seen = number, {number}
            while parent[end] is not None and parent[end] not in seen:
                end = parent[end]
                seen.add(end)
            survivor[number] = end
        return survivor

    @cached_property
    def text_ids(self) -> dict[int, str]:
        """The text id of every instance ever, by its number."""
        found = self.connection.execute(select(models.Instance.number, models.Instance.id))
        return {row.number: row.id for row in found}

    @cached_property
    def instances(self) -> tuple[StoredInstance, ...]:
        """All instances in the order of their numbers, those merged into others as part of them."""
        numbers: dict[int, list[int]] = defaultdict(list)
        for number, survivor in sorted(self.survivors.items()):
            numbers[survivor].append(number)
        states, visits = self._states(), self._visits()
        found = self.connection.execute(select(*rows.INSTANCE_WITHOUT_GEOMETRY).order_by(models.Instance.number))
        return tuple(
            rows.stored_instance(row, tuple(numbers[row.number]), tuple(states[row.number]), tuple(visits[row.number]))
            for row in found
            if row.number in numbers
        )

    @property
    def believed(self) -> tuple[StoredInstance, ...]:
        """All instances but those that the evidence no longer says were ever real."""
        return tuple(each for each in self.instances if each.presence != "doubted")

    def instance(self, text_id: str) -> StoredInstance | None:
        """The instance of a text id, or the one it was merged into; `None` if there never was one."""
        wanted = text_id.casefold()
        number = next((number for number, known in self.text_ids.items() if known.casefold() == wanted), None)
        if number is None:
            return None
        survivor = self.survivors[number]
        return next(each for each in self.instances if each.number == survivor)

    def observations(self, instance: StoredInstance) -> tuple[ObservationRef, ...]:
        """What was seen of an instance, in the order of time."""
        statement = (
            select(
                models.Observation.id,
                models.Observation.keyframe_id,
                models.Observation.instance_number,
                models.Observation.label,
                models.Observation.score,
                models.Observation.evidence_for,
                models.Observation.evidence_against,
                models.Observation.x,
                models.Observation.y,
                models.Observation.z,
                models.Keyframe.traversal_id,
                models.Keyframe.stamp_ns,
            )
            .join(models.Keyframe, models.Keyframe.id == models.Observation.keyframe_id)
            .where(models.Observation.instance_number.in_(instance.numbers))
            .order_by(models.Keyframe.stamp_ns, models.Observation.id)
        )
        return tuple(rows.observation_ref(row, self.survivors) for row in self.connection.execute(statement))

    def voxels(self, instance: StoredInstance) -> VoxelCloud:
        """An instance's geometry, in its present or last place."""
        found = self.connection.execute(select(models.Instance.voxels).where(models.Instance.number == instance.number))
        return blobs.decode_voxels(found.scalar_one())

    @cached_property
    def spatial_edges(self) -> tuple[SpatialEdge, ...]:
        """All spatial edges between instances as they are today."""
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for row in self.connection.execute(select(models.SpatialEdge.__table__).order_by(models.SpatialEdge.id)):
            subject, obj = self.survivors[row.subject_number], self.survivors[row.object_number]
            if subject != obj:
                edge = SpatialEdge(subject, row.relation, obj, row.since_ns, row.until_ns, row.confidence)
                edges[subject, row.relation, obj, row.since_ns] = edge
        return tuple(edges.values())

    def temporal_edges(self, numbers: Collection[int] | None = None) -> tuple[TemporalEdge, ...]:
        """All temporal edges (or those that touch one of the given numbers), in the order of time."""
        edge = models.TemporalEdge
        statement = select(edge.__table__).order_by(edge.not_after_ns, edge.id)
        if numbers is not None:
            statement = statement.where(or_(edge.from_number.in_(numbers), edge.to_number.in_(numbers)))
        return tuple(map(rows.temporal_edge, self.connection.execute(statement)))

    def trajectory(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """The robot's way in one traversal: (n,) stamps and (n, 3) positions in the map."""
        stamps_ns, T_map_base = self.poses(traversal_id)
        return stamps_ns, T_map_base[:, :3, 3]

    def poses(self, traversal_id: int) -> tuple[IntArray, FloatArray]:
        """One traversal's keyframes: (n,) stamps and (n, 4, 4) `T_map_base`."""
        statement = (
            select(models.Keyframe.stamp_ns, models.Keyframe.T_map_base)
            .where(models.Keyframe.traversal_id == traversal_id)
            .order_by(models.Keyframe.stamp_ns)
        )
        found = self.connection.execute(statement).all()
        poses = [json.loads(row.T_map_base) for row in found]
        return np.array([row.stamp_ns for row in found], np.int64), np.array(poses, np.float64).reshape(-1, 4, 4)

    def counts(self) -> dict[str, int]:
        """How many rows there are of what."""
        return {
            name: self.connection.execute(select(func.count()).select_from(model)).scalar_one()
            for name, model in COUNTED.items()
        }

    def revision(self) -> str:
        """The newest migration the database went through."""
        return str(self.connection.execute(text("SELECT version_num FROM alembic_version")).scalar_one())

    def _states(self) -> dict[int, list[StateRecord]]:
        states: dict[int, list[StateRecord]] = defaultdict(list)
        order = (models.State.instance_number, models.State.state_index)
        for row in self.connection.execute(select(models.State.__table__).order_by(*order)):
            states[row.instance_number].append(rows.state_record(row))
        return states

    def _visits(self) -> dict[int, list[StoredVisit]]:
        """Visits by survivor, summed over those merged into it."""
        summed: dict[tuple[int, int], StoredVisit] = {}
        order = (models.Visit.traversal_id, models.Visit.instance_number)
        for row in self.connection.execute(select(models.Visit.__table__).order_by(*order)):
            survivor = self.survivors[row.instance_number]
            before = summed.get(
                (survivor, row.traversal_id), StoredVisit(row.traversal_id, survivor, 0, 0, 0, None, None)
            )
            summed[survivor, row.traversal_id] = StoredVisit(
                traversal_id=row.traversal_id,
                instance_number=survivor,
                supported=before.supported + row.supported,
                in_view=before.in_view + row.in_view,
                contradicted=before.contradicted + row.contradicted,
                first_support_ns=min(_known(before.first_support_ns, row.first_support_ns), default=None),
                last_support_ns=max(_known(before.last_support_ns, row.last_support_ns), default=None),
            )
        visits: dict[int, list[StoredVisit]] = defaultdict(list)
        for (survivor, _), visit in summed.items():
            visits[survivor].append(visit)
        return visits


def _known(*values: int | None) -> list[int]:
    return [value for value in values if value is not None]
