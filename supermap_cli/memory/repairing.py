"""Makes anew what follows from other rows: indices, views, triggers, search tables, counts (`supermap db check
--repair`). What was observed is never changed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial

from sqlalchemy import Connection, Index
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import STUMBLES, SupermapError
from supermap_cli.memory.checksums import renew_sums
from supermap_cli.memory.databases import dialect_of, is_no_damage
from supermap_cli.memory.stale_edges import end_stale_edges
from supermap_schema import models, sqlite

_COUNTS = (
    """UPDATE traversal SET keyframes = (SELECT count(*) FROM keyframe k WHERE k.traversal_id = traversal.id),
       observations = (SELECT count(*) FROM keyframe k JOIN observation o ON o.keyframe_id = k.id
                       WHERE k.traversal_id = traversal.id),
       mapped_ns = (SELECT max(stamp_ns) FROM keyframe k WHERE k.traversal_id = traversal.id)""",
    *(
        f"""DELETE FROM {table} WHERE traversal_id NOT IN (SELECT id FROM traversal WHERE status = 'building')"""  # noqa: S608
        for table in ("before_image", "checkpoint")
    ),
)
_FEWER = """WITH RECURSIVE part(number, survivor) AS (SELECT number, number FROM instance UNION
    SELECT part.number, instance.merged_into FROM part JOIN instance ON instance.number = part.survivor
    WHERE instance.merged_into IS NOT NULL),
    counted(number, n) AS (SELECT part.survivor, count(o.id) FROM part
        JOIN observation o ON o.instance_number = part.number GROUP BY part.survivor)
    UPDATE instance SET observations = (SELECT n FROM counted c WHERE c.number = instance.number)
    WHERE observations < (SELECT n FROM counted c WHERE c.number = instance.number)"""
_FILLED = {
    "state_box": """INSERT INTO state_box SELECT id, center_x - (size_x + size_y) / 2, center_x + (size_x + size_y) / 2,
        center_y - (size_x + size_y) / 2, center_y + (size_x + size_y) / 2, center_z - size_z / 2,
        center_z + size_z / 2 FROM state""",
    "instance_label": """INSERT INTO instance_label (rowid, id, label, labels) SELECT number, id, label,
        (SELECT group_concat(key, ', ') FROM json_each(label_belief)) FROM instance""",
}
"""What fills SQLite's search tables from the tables that they stand for."""
_CREATED = re.compile(r"\s*CREATE (VIRTUAL TABLE|TRIGGER|VIEW)")


def repair(connection: Connection) -> tuple[str, ...]:
    """Make what is derived anew, within the connection's transaction. Returns in words what was done.

    What cannot be made anew for damaged rows ends no other part of the repair.
    """
    done = []
    if connection.dialect.name == "sqlite":
        done += _search_tables_and_views(connection)
    done += _surviving(connection, "relations", _ended)
    done += _surviving(connection, "counts", _counted)
    return (*done, *_surviving(connection, "checksums", renew_sums))


def _surviving(connection: Connection, name: str, make: Callable[[Connection], Sequence[str]]) -> Sequence[str]:
    """What was made; where rows are damaged, that it cannot be, and nothing of it is changed."""
    try:
        with connection.begin_nested():
            return make(connection)
    except (DatabaseError, SupermapError, *STUMBLES) as error:
        if is_no_damage(error):
            raise
        why = getattr(error, "orig", None) or error
        return (f"not {name}, which cannot be made anew: {why}; `supermap db recover --out NEW.db` saves the rest",)


def _ended(connection: Connection) -> Sequence[str]:
    ended = end_stale_edges(connection)
    return [f"{ended} relations ended that an end had left"] if ended else []


def _counted(connection: Connection) -> Sequence[str]:
    for statement in (*_COUNTS, _FEWER):
        connection.exec_driver_sql(statement)
    return ["rows counted again"]


def _search_tables_and_views(connection: Connection) -> list[str]:
    """SQLite's own objects: those missing or altered, and always the search tables, which are filled anew."""
    dialect = dialect_of(connection)
    found, altered = dialect.objects(connection), dialect.altered(connection)
    done: list[str] = []
    for name, statement in sqlite.definitions().items():
        if name not in found or name in altered or name in _FILLED:
            done += _surviving(connection, name, partial(_made, name=name, statement=statement))
    for table in models.Base.metadata.sorted_tables:
        for index in table.indexes:
            if index.name not in found or index.name in altered:
                done += _surviving(connection, str(index.name), partial(_indexed, index=index))
    return [*done, *_surviving(connection, "indices", _reindexed)]


def _made(connection: Connection, name: str, statement: str) -> Sequence[str]:
    kind = _CREATED.match(statement)
    kind_name = "TABLE" if kind is not None and kind[1] == "VIRTUAL TABLE" else kind[1] if kind is not None else ""
    connection.exec_driver_sql(f"DROP {kind_name} IF EXISTS {name}")
    connection.exec_driver_sql(statement)
    if name in _FILLED:
        connection.exec_driver_sql(_FILLED[name])
    return [f"{name} made anew"]


def _indexed(connection: Connection, index: Index) -> Sequence[str]:
    connection.exec_driver_sql(f"DROP INDEX IF EXISTS {index.name}")
    index.create(connection)
    return [f"{index.name} made anew"]


def _reindexed(connection: Connection) -> Sequence[str]:
    connection.exec_driver_sql("REINDEX")
    return ["indices made anew"]
