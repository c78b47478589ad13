"""Imports another map's rows, within a transaction of each database.

Traversals, keyframes and observations are copied as rows, a chunk at a time; everything else comes as values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy import Connection, Table, func, insert, select

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.rollback import drop_before_images
from supermap_cli.memory.rows import to_json
from supermap_cli.memory.stored_values import parsed_object, parsed_transform
from supermap_cli.memory.writing import measure_moves, write_delta
from supermap_cli.types.memory import MapDelta
from supermap_schema.checksums import store_sums
from supermap_schema.models import Base

CHUNK = 200
"""Rows copied together: keyframes hold images, so that a chunk takes some megabytes."""
_TRAVERSAL_TIMES = (
    *("start_ns", "end_ns", "mapped_ns"),
    *("crops_kept_from_ns", "observations_kept_from_ns", "thumbnails_kept_from_ns"),
)

Values = dict[str, Any]


@dataclass(frozen=True)
class MapImport:
    """How another map is imported.

    `names` gives its traversals' names here by their ids there; `numbers` its instances' numbers here by those there.
    `deltas` holds all rows but keyframes and observations, in this map's frame, time and numbers, by the id there of
    the traversal that wrote them. `origin` is the other database's place. `T_map_other` and `shift_ns` apply to the
    copied rows.
    """

    T_map_other: FloatArray
    shift_ns: int
    names: Mapping[int, str]
    numbers: Mapping[int, int]
    deltas: Mapping[int, MapDelta]
    origin: str


def import_map(target: Connection, source: Connection, imported: MapImport) -> None:
    """Write everything. The source is only read."""
    dialect_of(target).align_row_ids(target)
    traversal_ids = _copy_traversals(target, source, imported)
    id_offset = _copy_keyframes(target, source, imported, traversal_ids)
    for other_id, delta in imported.deltas.items():
        for part in _parts(delta):
            write_delta(target, traversal_ids[other_id], part)
        measure_moves(target, traversal_ids[other_id])
        drop_before_images(target, traversal_ids[other_id])
    _copy_observations(target, source, imported, id_offset)
    store_sums(target, tuple(traversal_ids.values()))
    dialect_of(target).align_row_ids(target)


def _copy_traversals(target: Connection, source: Connection, imported: MapImport) -> dict[int, int]:
    """Append the traversals; their ids here by those there."""
    table = Base.metadata.tables["traversal"]
    number = target.execute(select(func.coalesce(func.max(table.c.number), 0))).scalar_one()
    ids: dict[int, int] = {}
    for row in source.execute(select(table).order_by(table.c.number)).all():
        number += 1
        values = dict(row._mapping)
        other_id = values.pop("id")
        if other_id not in imported.names:
            raise MemoryStoreError("a build began meanwhile", where=imported.origin, cure="merge when it has ended")
        config = parsed_object(values["config"], "the configuration of a traversal") | {
            "merged_from": {"database": imported.origin, "traversal": row.name}
        }
        values |= {
            "number": number,
            "name": imported.names[other_id],
            "config": to_json(config),
            "T_map_odom": _transformed(imported.T_map_other, row.T_map_odom),
            "clock_shift_ns": row.clock_shift_ns + imported.shift_ns,
            **{name: _shifted(values[name], imported.shift_ns) for name in _TRAVERSAL_TIMES},
        }
        ids[other_id] = target.execute(insert(table).returning(table.c.id), values).scalar_one()
    return ids


def _copy_keyframes(
    target: Connection, source: Connection, imported: MapImport, traversal_ids: Mapping[int, int]
) -> int:
    """Append the keyframes; returns what is added to their ids."""
    table = Base.metadata.tables["keyframe"]
    id_offset = target.execute(select(func.coalesce(func.max(table.c.id), 0))).scalar_one()
    for chunk in _chunks(source, table):
        for values in chunk:
            values |= {
                "id": values["id"] + id_offset,
                "traversal_id": traversal_ids[values["traversal_id"]],
                "stamp_ns": values["stamp_ns"] + imported.shift_ns,
                "T_map_base": _transformed(imported.T_map_other, values["T_map_base"]),
                "T_map_camera": _transformed(imported.T_map_other, values["T_map_camera"]),
            }
        target.execute(insert(table), chunk)
    return int(id_offset)


def _copy_observations(target: Connection, source: Connection, imported: MapImport, id_offset: int) -> None:
    table = Base.metadata.tables["observation"]
    for chunk in _chunks(source, table):
        places = np.array([[values["x"], values["y"], values["z"]] for values in chunk], np.float64)
        moved = transform_points(imported.T_map_other, places).tolist()
        for values, (x, y, z) in zip(chunk, moved, strict=True):
            del values["id"]
            values |= {
                "keyframe_id": values["keyframe_id"] + id_offset,
                "instance_number": imported.numbers[values["instance_number"]],
                "x": x,
                "y": y,
                "z": z,
            }
        target.execute(insert(table), chunk)


def _chunks(source: Connection, table: Table) -> Iterator[list[Values]]:
    """All rows of a table in the order of their ids, `CHUNK` at a time."""
    rows = source.execute(select(table).order_by(table.c.id).execution_options(yield_per=CHUNK))
    for part in rows.partitions():
        yield [dict(row._mapping) for row in part]


def _parts(delta: MapDelta) -> Iterator[MapDelta]:
    """A delta in parts that one statement can hold; instances first, because the other rows refer to them."""
    for start in range(0, len(delta.instances), CHUNK):
        yield MapDelta(instances=delta.instances[start : start + CHUNK])
    longest = max(map(len, (delta.states, delta.visits, delta.spatial_edges, delta.temporal_edges)))
    for start in range(0, longest, CHUNK):
        part = slice(start, start + CHUNK)
        yield MapDelta(
            states=delta.states[part],
            visits=delta.visits[part],
            spatial_edges=delta.spatial_edges[part],
            temporal_edges=delta.temporal_edges[part],
        )


def _transformed(T_map_other: FloatArray, transform: str) -> str:
    return to_json((T_map_other @ parsed_transform(transform, "a pose of the other map")).tolist())


def _shifted(stamp_ns: int | None, shift_ns: int) -> int | None:
    return None if stamp_ns is None else stamp_ns + shift_ns
