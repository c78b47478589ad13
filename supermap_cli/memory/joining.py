"""Takes another memory's rows into a map, within a transaction of each: traversals, keyframes and observations pass as
rows, one chunk after the other; all else comes as values.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import Connection, Table, func, insert, select

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.rows import to_json
from supermap_cli.memory.undo import drop_before_images
from supermap_cli.memory.writing import measure_moves, write_delta
from supermap_cli.types.memory import MapDelta
from supermap_schema.models import Base

CHUNK = 200
_TRAVERSAL_TIMES = (
    *("start_ns", "end_ns", "mapped_ns"),
    *("crops_kept_from_ns", "observations_kept_from_ns", "thumbnails_kept_from_ns"),
)

Values = dict[str, Any]


@dataclass(frozen=True)
class Incoming:
    """What another memory brings, in this one's frame, time and numbers.

    `names` are its traversals' names here, by their ids there, in their order; `numbers` its instances' numbers here;
    `deltas` all that is not a keyframe or an observation, by the id there of the traversal that wrote it. `origin` says
    where it comes from.
    """

    T_map_other: FloatArray
    shift_ns: int
    names: Mapping[int, str]
    numbers: Mapping[int, int]
    deltas: Mapping[int, MapDelta]
    origin: str


def take_in(target: Connection, source: Connection, incoming: Incoming) -> None:
    """Write all of it. The source is only read."""
    dialect_of(target).align_row_ids(target)
    traversal_ids = _take_traversals(target, source, incoming)
    first_keyframe = _take_keyframes(target, source, incoming, traversal_ids)
    for other_id, delta in incoming.deltas.items():
        for part in _parts(delta):
            write_delta(target, traversal_ids[other_id], part)
        measure_moves(target, traversal_ids[other_id])
        drop_before_images(target, traversal_ids[other_id])
    _take_observations(target, source, incoming, first_keyframe)
    dialect_of(target).align_row_ids(target)


def _take_traversals(target: Connection, source: Connection, incoming: Incoming) -> dict[int, int]:
    """Enter the traversals after those there are; their ids here by those there."""
    table = Base.metadata.tables["traversal"]
    number = target.execute(select(func.coalesce(func.max(table.c.number), 0))).scalar_one()
    ids: dict[int, int] = {}
    for row in source.execute(select(table).order_by(table.c.number)).all():
        number += 1
        values = dict(row._mapping)
        other_id = values.pop("id")
        if other_id not in incoming.names:
            raise MemoryStoreError("a build began meanwhile", where=incoming.origin, cure="merge when it has ended")
        config = json.loads(values["config"]) | {"merged_from": {"database": incoming.origin, "traversal": row.name}}
        values |= {
            "number": number,
            "name": incoming.names[other_id],
            "config": to_json(config),
            "T_map_odom": _moved(incoming.T_map_other, row.T_map_odom),
            "clock_shift_ns": row.clock_shift_ns + incoming.shift_ns,
            **{name: _later(values[name], incoming.shift_ns) for name in _TRAVERSAL_TIMES},
        }
        ids[other_id] = target.execute(insert(table).returning(table.c.id), values).scalar_one()
    return ids


def _take_keyframes(
    target: Connection, source: Connection, incoming: Incoming, traversal_ids: Mapping[int, int]
) -> int:
    """Enter the keyframes; what is added to their ids."""
    table = Base.metadata.tables["keyframe"]
    first = target.execute(select(func.coalesce(func.max(table.c.id), 0))).scalar_one()
    for chunk in _chunks(source, table):
        for values in chunk:
            values |= {
                "id": values["id"] + first,
                "traversal_id": traversal_ids[values["traversal_id"]],
                "stamp_ns": values["stamp_ns"] + incoming.shift_ns,
                "T_map_base": _moved(incoming.T_map_other, values["T_map_base"]),
                "T_map_camera": _moved(incoming.T_map_other, values["T_map_camera"]),
            }
        target.execute(insert(table), chunk)
    return int(first)


def _take_observations(target: Connection, source: Connection, incoming: Incoming, first_keyframe: int) -> None:
    table = Base.metadata.tables["observation"]
    for chunk in _chunks(source, table):
        places = np.array([[each["x"], each["y"], each["z"]] for each in chunk], np.float64)
        moved = transform_points(incoming.T_map_other, places).tolist()
        for values, (x, y, z) in zip(chunk, moved, strict=True):
            del values["id"]
            values |= {
                "keyframe_id": values["keyframe_id"] + first_keyframe,
                "instance_number": incoming.numbers[values["instance_number"]],
                "x": x,
                "y": y,
                "z": z,
            }
        target.execute(insert(table), chunk)


def _chunks(source: Connection, table: Table) -> Iterator[list[Values]]:
    """All rows of a table in the order of their ids, some at a time."""
    rows = source.execute(select(table).order_by(table.c.id).execution_options(yield_per=CHUNK))
    for part in rows.partitions():
        yield [dict(row._mapping) for row in part]


def _parts(delta: MapDelta) -> Iterator[MapDelta]:
    """A delta in parts that a statement can hold: instances first, which all else speaks of."""
    for at in range(0, len(delta.instances), CHUNK):
        yield MapDelta(instances=delta.instances[at : at + CHUNK])
    longest = max(map(len, (delta.states, delta.visits, delta.spatial_edges, delta.temporal_edges)))
    for at in range(0, longest, CHUNK):
        part = slice(at, at + CHUNK)
        yield MapDelta(
            states=delta.states[part],
            visits=delta.visits[part],
            spatial_edges=delta.spatial_edges[part],
            temporal_edges=delta.temporal_edges[part],
        )


def _moved(T_map_other: FloatArray, transform: str) -> str:
    return to_json((T_map_other @ np.array(json.loads(transform), np.float64)).tolist())


def _later(stamp_ns: int | None, shift_ns: int) -> int | None:
    return None if stamp_ns is None else stamp_ns + shift_ns
