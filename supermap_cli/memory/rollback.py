"""Rolls an unfinished traversal back: its new rows are deleted, rows that it changed get their before-images back."""

from __future__ import annotations

import json
from collections.abc import Collection
from typing import Any

from sqlalchemy import Connection, Table, delete, insert, select

from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.rows import to_json
from supermap_schema.models import (
    Base,
    BeforeImage,
    Checkpoint,
    Checksum,
    Instance,
    Keyframe,
    Observation,
    SpatialEdge,
    State,
    TemporalEdge,
    Traversal,
    Visit,
)

_CHANGING = ("instance", "state", "spatial_edge")


def save_before_images(connection: Connection, traversal_id: int, table_name: str, keys: Collection[int]) -> None:
    """Store the rows of other traversals that are about to change, once for each traversal that changes them."""
    table = Base.metadata.tables[table_name]
    key = _key(table)
    saved = select(BeforeImage.row_key).where(
        BeforeImage.traversal_id == traversal_id, BeforeImage.table_name == table_name
    )
    rows = connection.execute(
        select(table).where(key.in_(keys), table.c.traversal_id != traversal_id, key.not_in(saved))
    )
    images = [
        {
            "traversal_id": traversal_id,
            "table_name": table_name,
            "row_key": row._mapping[key],
            "content": to_json({name: _to_json_value(value) for name, value in row._mapping.items()}),
        }
        for row in rows
    ]
    if images:
        connection.execute(insert(BeforeImage), images)


def drop_before_images(connection: Connection, traversal_id: int) -> None:
    """The traversal is complete and cannot be rolled back any more."""
    connection.execute(delete(BeforeImage).where(BeforeImage.traversal_id == traversal_id))


def roll_back(connection: Connection, traversal_id: int) -> None:
    """Undo everything that an unfinished traversal wrote, and delete it."""
    dialect_of(connection).defer_foreign_keys(connection)
    keyframes = select(Keyframe.id).where(Keyframe.traversal_id == traversal_id)
    connection.execute(delete(Observation).where(Observation.keyframe_id.in_(keyframes)))
    for model in (Checkpoint, Checksum, Keyframe, TemporalEdge, SpatialEdge, Visit, State, Instance):
        connection.execute(delete(model).where(model.traversal_id == traversal_id))
    for table_name in _CHANGING:
        _restore(connection, traversal_id, Base.metadata.tables[table_name])
    drop_before_images(connection, traversal_id)
    connection.execute(delete(Traversal).where(Traversal.id == traversal_id))


def _restore(connection: Connection, traversal_id: int, table: Table) -> None:
    images = connection.execute(
        select(BeforeImage.row_key, BeforeImage.content).where(
            BeforeImage.traversal_id == traversal_id, BeforeImage.table_name == table.name
        )
    ).all()
    if not images:
        return
    if table.name == "state":  # restored one by one, a state could overlap another that is restored later
        connection.execute(delete(table).where(_key(table).in_([image.row_key for image in images])))
    statement = dialect_of(connection).upsert(table)
    changed = {column.name: column for column in statement.excluded if not column.primary_key}
    connection.execute(
        statement.on_conflict_do_update(index_elements=[_key(table)], set_=changed),
        [{name: _from_json_value(value) for name, value in json.loads(image.content).items()} for image in images],
    )


def _key(table: Table) -> Any:
    return next(iter(table.primary_key.columns))


def _to_json_value(value: object) -> object:
    return {"hex": value.hex()} if isinstance(value, bytes) else value


def _from_json_value(value: object) -> object:
    return bytes.fromhex(value["hex"]) if isinstance(value, dict) else value
