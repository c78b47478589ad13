"""Whatever changes a row that never changes is found, and nothing that may change a map is taken for that."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import CheckConstraint, Connection, Table, event, select, update

from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.checksums import changed_rows
from supermap_cli.memory.pruning import PrunePolicy
from supermap_cli.memory.values import Problem
from supermap_cli.types.memory import MapDelta
from supermap_schema.checksums import IMMUTABLE
from supermap_schema.models import Base
from support import databases
from support import memories as m
from support.cli import supermap
from support.databases import examples

CHAIR = 1
PICTURE = b"\xff\xd8\xff picture"


def day(start: float, *, moved: bool = False) -> MapDelta:
    keyframes = [
        type(each)(**{**each.__dict__, "thumbnail_jpeg": PICTURE}) for each in m.keyframes([start + 1, start + 2])
    ]
    seen = [m.observation(CHAIR, start + at) for at in (1, 2)]
    first = 0 if moved else start
    states = (m.state(CHAIR, 0, (first + 1, first + 2), gone=start + 1 if moved else None),)
    return MapDelta(
        keyframes=tuple(keyframes),
        observations=tuple(type(each)(**{**each.__dict__, "crop_jpeg": PICTURE}) for each in seen),
        instances=(m.instance(CHAIR, "chair", seen=(first + 1, start + 2), observations=4 if moved else 2),),
        states=(*states, m.state(CHAIR, 1, (start + 1, start + 2))) if moved else states,
        visits=(m.visit(CHAIR, 2, 2, 0, (start + 1, start + 2)),),
        temporal_edges=(m.temporal("moved", (CHAIR, 0), (CHAIR, 1), 2, start + 1, distance_m=0.0),) if moved else (),
    )


def two_days(path: Path) -> Path:
    return m.make_memory(path, ("monday", (0, 10), day(0)), ("tuesday", (20, 30), day(20, moved=True)))


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return two_days(tmp_path / "map.db")


def problems(path: Path) -> list[Problem]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return check(reader)


def named(path: Path) -> set[tuple[str, str]]:
    """Table and traversal of every checksum that does not fit."""
    changes = ("changed since it was built", "rows of this traversal, not the")
    return {(each.table, each.row) for each in problems(path) if any(change in each.what for change in changes)}


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapStore]:
    path = two_days(tmp_path_factory.mktemp("checksums") / "map.db")
    with open_store(str(path)) as store:
        if store._engine is not None and not databases.on_postgresql():
            event.listen(store._engine, "connect", _ignore_constraints)
        yield store


def _ignore_constraints(connection: Any, _record: object) -> None:
    connection.execute("PRAGMA ignore_check_constraints = ON")


CELLS = [
    (each.name, name)
    for each in IMMUTABLE.values()
    for name in (*each.integers, *each.reals, *each.texts, *((each.image,) if each.image else ()))
]


class UndoneError(Exception):
    """Ends a transaction whose changes are not wanted."""


def other(value: Any, amount: int) -> Any:
    """The next value of the same kind, or one `amount` away."""
    if isinstance(value, float):
        return math.nextafter(value, math.inf)
    if isinstance(value, int):
        return value + amount
    if isinstance(value, bytes):
        return value[:-1] + bytes([value[-1] ^ 1])
    return amount if value is None else f"{value} "


def unguarded(connection: Connection, table: Table) -> None:
    """Let this transaction do what triggers, keys and constraints refuse."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("PRAGMA defer_foreign_keys = ON")
        connection.exec_driver_sql("DROP TRIGGER observation_is_immutable")
        return
    connection.exec_driver_sql("SET LOCAL session_replication_role = replica")
    for each in table.constraints:
        if isinstance(each, CheckConstraint):
            connection.exec_driver_sql(f"ALTER TABLE {table.name} DROP CONSTRAINT {each.name}")


@given(cell=st.sampled_from(CELLS), at=st.integers(0, 3), amount=st.integers(1000, 2**40))
@settings(max_examples=examples(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_changed_cell_of_an_immutable_row_is_found(
    pristine: MapStore, cell: tuple[str, str], at: int, amount: int
) -> None:
    table, column = Base.metadata.tables[cell[0]], Base.metadata.tables[cell[0]].c[cell[1]]
    keys = tuple(table.primary_key.columns)
    with suppress(UndoneError), pristine._writing() as connection:
        rows = connection.execute(select(*keys, column.label("cell")).order_by(*keys)).all()
        chosen = rows[at % len(rows)]
        assert list(changed_rows(connection, table.name)) == []
        unguarded(connection, table)
        this = [key == value for key, value in zip(keys, chosen, strict=False)]
        connection.execute(update(table).where(*this).values({column.name: other(chosen.cell, amount)}))
        found = list(changed_rows(connection, table.name))
        assert {problem.table for problem in found} & {table.name, "checksum"}, (chosen, found)
        raise UndoneError


def test_the_traversal_and_the_table_are_named(db: Path) -> None:
    m.run_sql(db, """UPDATE keyframe SET camera_id = 'rear' WHERE id = 3;\nDELETE FROM temporal_edge;\n""")
    assert named(db) == {("keyframe", "tuesday"), ("temporal_edge", "tuesday")}
    assert any("has 0 rows of this traversal, not the 1" in each.what for each in problems(db))


@pytest.mark.parametrize("digest", ["", "zz", "0" * 31, "é"])
def test_a_damaged_checksum_is_named(db: Path, digest: str) -> None:
    m.run_sql(db, f"UPDATE checksum SET digest = '{digest}' WHERE traversal_id = 1 AND table_name = 'visit';\n")
    assert problems(db) == [Problem("checksum", "monday visit", "is missing or no checksum")]


def test_a_checksum_of_nothing_is_named(db: Path) -> None:
    m.run_sql(db, "INSERT INTO checksum VALUES (2, 'song', 0, '');\n")
    assert problems(db) == [Problem("checksum", "2 song", "belongs to nothing that is complete")]


def sums_of_map(path: Path) -> list[tuple[Any, ...]]:
    return databases.query(path, "SELECT * FROM checksum ORDER BY 1, 2")


def test_later_traversals_leave_the_checksums_of_earlier_ones(tmp_path: Path) -> None:
    alone = m.make_memory(tmp_path / "alone.db", ("monday", (0, 10), day(0)))
    both = two_days(tmp_path / "both.db")
    assert [row for row in sums_of_map(both) if row[0] == 1] == sums_of_map(alone)
    assert problems(both) == []


def test_equal_rows_have_the_same_checksums_in_both_databases(db: Path) -> None:
    """As written down here, once, on SQLite."""
    expected = {
        "traversal 1": "e99567575bf76f845e3c66918b546f81",
        "observation 1": "79473e103f2522eaa3634563991b6cb2",
        "visit 2": "0ddba3a624ddb7cba6d0c9b3a279bb81",
        "temporal_edge 2": "40d659d38fb3e4718a447d41049668b8",
    }
    found = {f"{row[1]} {row[0]}": row[3] for row in sums_of_map(db)}
    assert {name: found[name] for name in expected} == expected


def test_pruning_takes_off_what_it_removes_and_no_more(db: Path) -> None:
    before = sums_of_map(db)
    with open_store(str(db)) as store:
        store.prune(PrunePolicy(m.ns(15), m.ns(15), m.ns(15), best_crops=False))
    assert problems(db) == []
    touched = {(old[0], old[1]) for old, new in zip(before, sums_of_map(db), strict=True) if old != new}
    assert touched == {(1, "keyframe"), (1, "observation")}


def test_a_change_is_still_found_after_pruning(db: Path) -> None:
    m.run_sql(db, "UPDATE keyframe SET depth_step = 7 WHERE id = 1;\n")
    with open_store(str(db)) as store:
        store.prune(PrunePolicy(thumbnails_ns=m.ns(15)))
    assert named(db) == {("keyframe", "monday")}


def test_only_a_repair_accepts_what_was_changed_and_says_so(db: Path) -> None:
    m.run_sql(
        db, "UPDATE visit SET in_view = 9 WHERE traversal_id = 1;\nDELETE FROM checksum WHERE traversal_id = 2;\n"
    )
    result = supermap("db", "check", "--repair", "--db", databases.place(db))
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert "checksum of visit of traversal monday made anew: its rows are not those that were built" in told
    assert "checksum of keyframe of traversal tuesday made anew: it was missing" in told
    assert "keyframe of traversal monday" not in told
    assert problems(db) == []


def test_a_repair_of_a_sound_map_leaves_its_checksums(db: Path) -> None:
    before = sums_of_map(db)
    assert not any("checksum" in done for done in m.renew_checksums(db))
    assert sums_of_map(db) == before


@pytest.mark.sqlite_only("recovers a file")
def test_recovering_says_whose_rows_are_not_those_that_were_built(db: Path, tmp_path: Path) -> None:
    m.run_sql(db, "UPDATE visit SET in_view = 9 WHERE traversal_id = 1;\n")
    result = supermap("db", "recover", "--db", db, "--out", tmp_path / "new.db")
    assert "checksum of visit of traversal monday made anew" in " ".join(result.stderr.split())
    assert problems(tmp_path / "new.db") == []


def test_a_merge_refuses_a_map_with_changed_rows(db: Path, tmp_path: Path) -> None:
    other = m.make_memory(tmp_path / "other.db", ("friday", (200, 210), day(200)))
    m.run_sql(other, "UPDATE keyframe SET camera_id = 'rear' WHERE id = 1;\n")
    result = supermap("db", "merge", databases.place(other), "--into", databases.place(db), "--align", "none")
    assert result.exit_code == 1
    assert "changed since it was built" in str(result.exception)
