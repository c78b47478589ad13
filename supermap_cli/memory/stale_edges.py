"""Open spatial edges whose ends stand too far apart for their relation: what `db check` finds, and `db upgrade` ends.

Builds of older versions left them behind where a thing was recognised elsewhere: the edges of its old place went on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import Connection, func, select, update
from sqlalchemy.orm import aliased

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.numbers import batches
from supermap_cli.relations.map_relations import relations_of_configs
from supermap_cli.relations.registry import RelationRegistry, possible
from supermap_schema import models

TOLERANCE_M = 0.1
"""Metres by which two boxes may be too far apart: those of merged maps are voxels rotated into another grid."""

Edge, State = models.SpatialEdge, models.State
Subject, Object = aliased(models.Instance, name="subject"), aliased(models.Instance, name="object")
_ENDS = (("subject", Subject), ("object", Object))
_BOX = ("center_x", "center_y", "center_z", "size_x", "size_y", "size_z", "yaw")
_ROWS = 5000
"""Edges looked at together."""


@dataclass(frozen=True)
class StaleEdge:
    """An open edge that cannot hold, by its row; `name` is it in words."""

    row_id: int
    ends: tuple[int, int]
    since_ns: int
    name: str


def stale_edges(connection: Connection) -> Iterator[StaleEdge]:
    """The open edges that cannot hold where their ends stand now; those of merged instances are another invariant."""
    configs = connection.execute(select(models.Traversal.config).order_by(models.Traversal.number)).scalars()
    registry, slack = relations_of_configs(configs)
    boxes = [getattr(end, name).label(f"{which}_{name}") for which, end in _ENDS for name in _BOX]
    ids = [end.id.label(f"{which}_id") for which, end in _ENDS]
    statement = (
        select(Edge.id, Edge.subject_number, Edge.relation, Edge.object_number, Edge.since_ns, *ids, *boxes)
        .join(Subject, Subject.number == Edge.subject_number)
        .join(Object, Object.number == Edge.object_number)
        .where(Edge.until_ns.is_(None), Subject.merged_into.is_(None), Object.merged_into.is_(None))
        .order_by(Edge.id)
    )
    for rows in connection.execute(statement.execution_options(yield_per=_ROWS)).partitions():
        for row in _doubtful(rows, registry, slack):
            reach = registry.reach(row.relation)
            if not possible(reach, _box(row, "subject"), _box(row, "object"), slack, TOLERANCE_M):
                name = f"{row.subject_id} {row.relation} {row.object_id} since {row.since_ns}"
                yield StaleEdge(row.id, (row.subject_number, row.object_number), row.since_ns, name)


def end_stale_edges(connection: Connection) -> int:
    """End each of them when the first of its ends left the place where it began; returns how many there were."""
    stale = list(stale_edges(connection))
    now_ns = connection.execute(select(func.max(models.Traversal.end_ns))).scalar_one()
    left_ns = _left_ns(connection, {number for edge in stale for number in edge.ends})
    for edge in stale:
        ends_ns = (at_ns for number in edge.ends for at_ns in left_ns.get(number, ()) if at_ns > edge.since_ns)
        until_ns = max(min(ends_ns, default=now_ns), edge.since_ns + 1)
        connection.execute(update(Edge).where(Edge.id == edge.row_id).values(until_ns=until_ns))
    return len(stale)


def _left_ns(connection: Connection, numbers: set[int]) -> Mapping[int, list[int]]:
    """When each instance left the places where it stood: seen to be gone, or seen elsewhere."""
    found: dict[int, list[int]] = {}
    for batch in batches(sorted(numbers)):
        columns = select(State.instance_number, State.state_index, State.first_seen_ns, State.gone_ns)
        for row in connection.execute(columns.where(State.instance_number.in_(batch))):
            times = [row.gone_ns] if row.gone_ns is not None else []
            found.setdefault(row.instance_number, []).extend(
                [*times, *([row.first_seen_ns] if row.state_index > 0 else [])]
            )
    return found


def _doubtful(rows: Any, registry: RelationRegistry, slack: float) -> Iterator[Any]:
    """The rows whose boxes are not surely near enough: their middles are apart by more than the reach."""
    known = [row for row in rows if row.relation in registry and _is_boxed(row)]
    if not known:
        return
    boxes = np.array(
        [[[getattr(row, f"{which}_{name}") for name in _BOX] for which, _ in _ENDS] for row in known], np.float64
    )
    offsets = np.abs(boxes[:, 0, :3] - boxes[:, 1, :3])
    reaches = [registry.reach(row.relation) for row in known]
    floor_m = np.array([reach.floor_m for reach in reaches]) * slack
    height_m = np.array([reach.height_m for reach in reaches]) * slack
    apart = (np.hypot(offsets[:, 0], offsets[:, 1]) > floor_m) | (
        offsets[:, 2] - boxes[:, :, 5].sum(axis=1) / 2 > height_m
    )
    yield from (row for row, is_apart in zip(known, apart.tolist(), strict=True) if is_apart)


def _is_boxed(row: Any) -> bool:
    """Whether both ends have a box; that an instance has none is another invariant."""
    values = [getattr(row, f"{which}_{name}") for which, _ in _ENDS for name in _BOX]
    sizes = [getattr(row, f"{which}_{name}") for which, _ in _ENDS for name in _BOX[3:6]]
    return bool(np.isfinite(np.array(values, np.float64)).all()) and min(sizes) >= 0


def _box(row: Any, which: str) -> Box3D:
    values = np.array([getattr(row, f"{which}_{name}") for name in _BOX], np.float64)
    return Box3D(values[:3], values[3:6], float(values[6]))
