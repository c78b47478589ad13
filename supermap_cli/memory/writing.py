"""Writes a `MapDelta` within a transaction."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Connection, and_, bindparam, delete, insert, select, tuple_, update
from sqlalchemy.orm import aliased

from supermap_cli.geometry.boxes import Box3D, displacement_m
from supermap_cli.memory import rows
from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.names import InstanceIds, label_slug
from supermap_cli.memory.rollback import save_before_images
from supermap_cli.memory.values import Checkpoint
from supermap_cli.types.memory import (
    InstanceRecord,
    KeyframeRecord,
    MapDelta,
    Observation,
    SpatialEdge,
    StateRecord,
    TemporalEdge,
    Visit,
)
from supermap_schema import models


def write_delta(connection: Connection, traversal_id: int, delta: MapDelta) -> None:
    """Write a batch of keyframes and everything that it changed; `MapDelta` says which keys are replaced."""
    _add_keyframes(connection, traversal_id, delta.keyframes)
    _replace_instances(connection, traversal_id, delta.instances)
    _add_observations(connection, traversal_id, delta.observations)
    _replace_states(connection, traversal_id, delta.states)
    _replace_visits(connection, traversal_id, delta.visits)
    _replace_spatial_edges(connection, traversal_id, delta.spatial_edges)
    _add_temporal_edges(connection, traversal_id, delta.temporal_edges)


def write_checkpoint(connection: Connection, traversal_id: int, checkpoint: Checkpoint) -> None:
    """Replace the traversal's checkpoint."""
    table = models.Checkpoint
    connection.execute(delete(table).where(table.traversal_id == traversal_id))
    common = {"traversal_id": traversal_id, "stamp_ns": int(checkpoint.stamp_ns)}
    connection.execute(
        insert(table), [{**common, "part": part, "content": content} for part, content in checkpoint.parts.items()]
    )


def measure_moves(connection: Connection, traversal_id: int) -> None:
    """Recompute the distance of all moves of the instances that a traversal viewed, from the final boxes of the states.

    When a move is detected, the object has hardly been seen in its new place, so that its box is still rough.
    """
    edge, before, after = models.TemporalEdge, aliased(models.State), aliased(models.State)
    viewed = select(models.Visit.instance_number).where(models.Visit.traversal_id == traversal_id)
    moves = connection.execute(
        select(edge.id, edge.distance_m, *_box_columns(before, "before"), *_box_columns(after, "after"))
        .join(before, and_(before.instance_number == edge.from_number, before.state_index == edge.from_state))
        .join(after, and_(after.instance_number == edge.to_number, after.state_index == edge.to_state))
        .where(edge.kind == "moved", edge.to_number.in_(viewed))
    ).all()
    for move in moves:
        distance_m = displacement_m(_box(move, "before"), _box(move, "after"))
        if distance_m != move.distance_m:
            connection.execute(update(edge).where(edge.id == move.id).values(distance_m=distance_m))


_BOX = ("center_x", "center_y", "center_z", "size_x", "size_y", "size_z", "yaw")


def _box_columns(state: Any, prefix: str) -> list[ColumnElement[float]]:
    return [getattr(state, name).label(f"{prefix}_{name}") for name in _BOX]


def _box(row: Any, prefix: str) -> Box3D:
    x, y, z, width, depth, height, yaw = (getattr(row, f"{prefix}_{name}") for name in _BOX)
    return Box3D(np.array([x, y, z]), np.array([width, depth, height]), yaw)


def _add_keyframes(connection: Connection, traversal_id: int, keyframes: Sequence[KeyframeRecord]) -> None:
    if not keyframes:
        return
    connection.execute(
        insert(models.Keyframe), [rows.keyframe_values(keyframe, traversal_id) for keyframe in keyframes]
    )
    newest_ns = max(int(keyframe.stamp_ns) for keyframe in keyframes)
    added = {"mapped_ns": newest_ns, "keyframes": models.Traversal.keyframes + len(keyframes)}
    connection.execute(update(models.Traversal).where(models.Traversal.id == traversal_id).values(added))


def _replace_instances(connection: Connection, traversal_id: int, instances: Sequence[InstanceRecord]) -> None:
    if not instances:
        return
    newest = {record.number: record for record in instances}
    save_before_images(connection, traversal_id, "instance", newest.keys())
    known = select(models.Instance.number, models.Instance.id).where(models.Instance.number.in_(newest))
    stored = {row.number: row.id for row in connection.execute(known)}
    new = sorted(newest.keys() - stored.keys())
    ids = InstanceIds(_taken(connection, {label_slug(newest[number].label) for number in new}))
    for number in new:
        stored[number] = ids.next_id(newest[number].label)
    statement = dialect_of(connection).upsert(models.Instance)
    constant = {"number", "id", "traversal_id"}
    changed = {column.name: column for column in statement.excluded if column.name not in constant}
    connection.execute(
        statement.on_conflict_do_update(index_elements=["number"], set_=changed),
        [rows.instance_values(record, traversal_id, stored[number]) for number, record in sorted(newest.items())],
    )


def _taken(connection: Connection, slugs: Iterable[str]) -> Iterator[str]:
    """The existing text ids that start with one of the slugs."""
    for slug in slugs:
        yield from connection.execute(select(models.Instance.id).where(models.Instance.id.like(f"{slug}-%"))).scalars()


def _add_observations(connection: Connection, traversal_id: int, observations: Sequence[Observation]) -> None:
    if not observations:
        return
    keys = {(int(observation.stamp_ns), observation.camera_id) for observation in observations}
    keyframe = models.Keyframe
    found = connection.execute(
        select(keyframe.stamp_ns, keyframe.camera_id, keyframe.id).where(
            keyframe.traversal_id == traversal_id, keyframe.stamp_ns.in_({stamp_ns for stamp_ns, _ in keys})
        )
    )
    keyframe_ids = {(row.stamp_ns, row.camera_id): row.id for row in found}
    missing = sorted(keys - keyframe_ids.keys())
    if missing:
        raise ValueError(f"observations at stamps of cameras that have no keyframe: {missing}")
    connection.execute(
        insert(models.Observation),
        [
            rows.observation_values(observation, keyframe_ids[int(observation.stamp_ns), observation.camera_id])
            for observation in observations
        ],
    )
    added = {"observations": models.Traversal.observations + len(observations)}
    connection.execute(update(models.Traversal).where(models.Traversal.id == traversal_id).values(added))


def _replace_states(connection: Connection, traversal_id: int, states: Sequence[StateRecord]) -> None:
    """All changed states are deleted before any is inserted, so that none overlaps one that is about to change."""
    if not states:
        return
    newest = {(state.object_number, state.index): state for state in states}
    table = models.State
    found = connection.execute(
        select(table.id, table.instance_number, table.state_index, table.traversal_id).where(
            tuple_(table.instance_number, table.state_index).in_(newest.keys())
        )
    )
    known = {(row.instance_number, row.state_index): row for row in found}
    save_before_images(connection, traversal_id, "state", [row.id for row in known.values()])
    connection.execute(delete(table).where(table.id.in_([row.id for row in known.values()])))
    replaced, new = [], []
    for key, state in sorted(newest.items(), key=lambda item: item[0]):
        if key in known:
            replaced.append(rows.state_values(state, known[key].traversal_id) | {"id": known[key].id})
        else:
            new.append(rows.state_values(state, traversal_id))
    for values in (replaced, new):
        if values:
            connection.execute(insert(table), values)


def _replace_visits(connection: Connection, traversal_id: int, visits: Sequence[Visit]) -> None:
    if not visits:
        return
    newest = {visit.object_number: visit for visit in visits}
    statement = dialect_of(connection).upsert(models.Visit)
    changed = {name: statement.excluded[name] for name in ("supported", "in_view", "contradicted")}
    changed |= {name: statement.excluded[name] for name in ("first_support_ns", "last_support_ns")}
    connection.execute(
        statement.on_conflict_do_update(index_elements=["traversal_id", "instance_number"], set_=changed),
        [rows.visit_values(visit, traversal_id) for visit in newest.values()],
    )


def _replace_spatial_edges(connection: Connection, traversal_id: int, edges: Sequence[SpatialEdge]) -> None:
    """An edge whose interval turned out empty never held; it is deleted."""
    if not edges:
        return
    newest = {(edge.subject, edge.relation, edge.object, edge.since_ns): edge for edge in edges}
    table = models.SpatialEdge
    found = connection.execute(
        select(table.id, table.subject_number, table.relation, table.object_number, table.since_ns).where(
            table.subject_number.in_({edge.subject for edge in edges})
        )
    )
    known = {(row.subject_number, row.relation, row.object_number, row.since_ns): row.id for row in found}
    save_before_images(connection, traversal_id, "spatial_edge", [known[key] for key in newest if key in known])
    empty = [key for key, edge in newest.items() if edge.until_ns is not None and edge.until_ns <= edge.since_ns]
    connection.execute(delete(table).where(table.id.in_([known[key] for key in empty if key in known])))
    lasting = [
        (known.get(key), rows.spatial_edge_values(newest[key], traversal_id)) for key in newest if key not in empty
    ]
    changed = [
        {"row_id": row_id, "until": values["until_ns"], "sure": values["confidence"]}
        for row_id, values in lasting
        if row_id is not None
    ]
    if changed:  # an upsert would use up a row id for every existing row
        statement = update(table).where(table.id == bindparam("row_id"))
        connection.execute(statement.values(until_ns=bindparam("until"), confidence=bindparam("sure")), changed)
    new = [values for row_id, values in lasting if row_id is None]
    if new:
        connection.execute(insert(table), new)


def _add_temporal_edges(connection: Connection, traversal_id: int, edges: Sequence[TemporalEdge]) -> None:
    if edges:
        connection.execute(
            insert(models.TemporalEdge), [rows.temporal_edge_values(edge, traversal_id) for edge in edges]
        )
