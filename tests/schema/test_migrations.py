"""The models and the migrations make the same database."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, create_engine, text

from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.opening import mend_edges, upgrade_database
from supermap_cli.types.memory import MapDelta
from supermap_schema import SCHEMA_VERSION, postgresql, sqlite, upgrading
from supermap_schema.models import Base
from supermap_schema.upgrading import alembic_config
from support import databases
from support import memories as m

upgrade = inspect.unwrap(upgrading.upgrade)
"""The migrations themselves, not `databases.replay_migrations`."""

CLAUSES = re.compile(r"\n|, (?=\w+ (?:INTEGER|TEXT|REAL|BLOB)\b)")
"""Between columns and constraints; SQLite writes a column that was added later onto the last line."""


def tables(connection: Connection) -> dict[str, set[str]]:
    """Every table and index that a model stands for, as the set of its clauses."""
    found = connection.execute(text("SELECT type || ' ' || name, sql FROM sqlite_master WHERE sql IS NOT NULL"))
    names = {f"table {table.name}" for table in Base.metadata.sorted_tables}
    names |= {f"index {index.name}" for table in Base.metadata.sorted_tables for index in table.indexes}
    return {
        name: {re.sub(r"\s+", " ", clause).strip(" ,") for clause in CLAUSES.split(sql) if clause.strip()}
        for name, sql in found
        if name in names
    }


def test_models_and_migrations_agree() -> None:
    with create_engine("sqlite://").connect() as connection:
        Base.metadata.create_all(connection)
        by_models = tables(connection)
    with create_engine("sqlite://").connect() as connection:
        upgrade(connection)
        by_migrations = tables(connection)
    assert len(by_models) > len(Base.metadata.tables)
    assert by_migrations == by_models


def test_the_newest_migration_is_the_version_of_the_schema() -> None:
    with create_engine("sqlite://").connect() as connection:
        head = ScriptDirectory.from_config(alembic_config(connection)).get_current_head()
        assert head is not None
        assert int(head) == SCHEMA_VERSION
        upgrade(connection)
        assert connection.execute(text("PRAGMA user_version")).scalar_one() == SCHEMA_VERSION
        assert connection.execute(text("PRAGMA application_id")).scalar_one() == sqlite.APPLICATION_ID


def test_upgrading_twice_changes_nothing() -> None:
    with create_engine("sqlite://").connect() as connection:
        upgrade(connection)
        upgrade(connection)


@pytest.fixture
def memory(tmp_path: Path) -> Path:
    delta = MapDelta(
        keyframes=(m.keyframe(1, x=2.5),),
        instances=(
            m.instance(1, "chair", (1, 2, 0.5)),
            m.instance(2, "dining table"),
            m.instance(3, "cup", merged_into=2),
        ),
        states=(m.state(1, 0, (1, 1), (1, 2, 0.5), gone=5), m.state(2, 0, (1, 1), (5, 5, 0.5), label="dining table")),
        temporal_edges=(
            m.temporal("disappeared", (1, 0), (1, None), 1, 5),
            m.temporal("persisted", (2, 0), (2, 0), 1, 5),
        ),
    )
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))


@pytest.mark.parametrize(
    ("sql", "expected"),
    [
        ("SELECT id FROM current_objects ORDER BY id", ["chair-1", "dining-table-1"]),
        ("SELECT id || ' ' || first_traversal FROM object_history", ["chair-1 monday", "dining-table-1 monday"]),
        ("SELECT kind || ' ' || from_id FROM changes", ["disappeared chair-1"]),
        ("SELECT traversal || ' ' || x FROM trajectory", ["monday 2.5"]),
        ("SELECT state_id FROM state_box WHERE min_x <= 1 AND max_x >= 1 AND min_y <= 2 AND max_y >= 2", [1]),
    ],
)
def test_the_database_answers_in_plain_sql(memory: Path, sql: str, expected: list[object]) -> None:
    with open_store(str(memory), read_only=True) as store, store.reader() as reader:
        assert list(reader.connection.execute(text(sql)).scalars()) == expected


@pytest.mark.postgresql_only
def test_models_and_migrations_agree_on_postgresql(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        context = MigrationContext.configure(reader.connection, opts={"compare_type": True, "include_name": _is_model})
        assert compare_metadata(context, Base.metadata) == []
        assert check(reader) == []


def _is_model(name: str | None, kind: str, _: object) -> bool:
    return not (kind == "index" and name in postgresql.INDICES) and not (kind == "table" and name == "alembic_version")


RELEASES = sorted((Path(__file__).parent / "releases").glob("version_*.sql"))


@pytest.fixture(params=RELEASES, ids=lambda path: path.stem)
def released(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A database as a former release made it."""
    path = tmp_path / "map.db"
    m.run_sql(path, request.param.read_text())
    return path


@pytest.mark.sqlite_only("no map of the first version lies in PostgreSQL")
def test_a_memory_of_an_earlier_release_is_lifted_and_goes_on(released: Path) -> None:
    before, after = upgrade_database(str(released))
    assert before < after == SCHEMA_VERSION
    mend_edges(str(released))
    with open_store(str(released), read_only=True) as store, store.reader() as reader:
        assert check(reader) == []
        assert [traversal.name for traversal in reader.traversals] == ["monday", "tuesday", "wednesday"]
        assert {instance.id for instance in reader.instances} >= {"chair-1", "dining-table-1", "potted-plant-1"}
    with open_store(str(released)) as store:
        store.roll_back_unfinished()
        m.add_traversal(store, "thursday", (300, 310), MapDelta(keyframes=(m.keyframe(301),)))
    mend_edges(str(released))  # what the traversal that was rolled back had closed is open again
    with open_store(str(released), read_only=True) as store, store.reader() as reader:
        assert check(reader) == []
        assert [traversal.name for traversal in reader.traversals] == ["monday", "tuesday", "thursday"]
        assert {instance.label for instance in reader.instances} == {"chair", "dining table", "potted plant"}


@pytest.mark.sqlite_only("no map of the first version lies in PostgreSQL")
def test_a_lifted_memory_has_what_a_new_one_has(released: Path) -> None:
    upgrade_database(str(released))
    with create_engine(f"sqlite:///{released}").connect() as connection:
        lifted = tables(connection)
    with create_engine("sqlite://").connect() as connection:
        upgrade(connection)
        assert lifted == tables(connection)


@pytest.mark.sqlite_only("no map of the first version lies in PostgreSQL")
def test_keyframes_of_a_lifted_memory_are_of_its_only_camera(released: Path) -> None:
    observed = "SELECT id, keyframe_id FROM observation ORDER BY id"
    before = databases.query(released, "SELECT * FROM keyframe ORDER BY id"), databases.query(released, observed)
    upgrade_database(str(released))
    keyframes = databases.query(released, "SELECT * FROM keyframe ORDER BY id")
    assert keyframes == [(*row[:10], "camera") for row in before[0]]
    assert databases.query(released, observed) == before[1]
    assert databases.query(released, "PRAGMA foreign_key_check") == []
    assert databases.query(released, "SELECT DISTINCT warnings FROM traversal") == [("[]",)]


@pytest.mark.postgresql_only
def test_keyframes_of_a_lifted_schema_are_of_its_only_camera(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    m.make_memory(path, ("monday", (0, 10), MapDelta(keyframes=(m.keyframe(1), m.keyframe(2)))))
    with open_store(str(path)) as store, store._writing() as connection:
        for statement in (*TO_VERSION_2, *postgresql_trajectory_0002()):
            connection.exec_driver_sql(statement.replace("%", "%%"))
    assert upgrade_database(str(path)) == (2, SCHEMA_VERSION)
    assert databases.query(path, "SELECT stamp_ns, camera_id FROM keyframe ORDER BY id") == [
        (m.ns(1), "camera"),
        (m.ns(2), "camera"),
    ]
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        context = MigrationContext.configure(reader.connection, opts={"compare_type": True, "include_name": _is_model})
        assert compare_metadata(context, Base.metadata) == []
        assert check(reader) == []


TO_VERSION_2 = (
    "DROP TABLE checksum",
    "DROP VIEW trajectory",
    "ALTER TABLE keyframe DROP CONSTRAINT uq_keyframe_traversal_id_stamp_ns_camera_id",
    "ALTER TABLE keyframe ADD CONSTRAINT uq_keyframe_traversal_id_stamp_ns UNIQUE (traversal_id, stamp_ns)",
    "ALTER TABLE keyframe DROP COLUMN camera_id",
    "ALTER TABLE traversal DROP COLUMN warnings",
    "UPDATE alembic_version SET version_num = '0002'",
)
"""Takes a schema back to what version 2 made, for a map of PostgreSQL cannot be kept as a file."""


def postgresql_trajectory_0002() -> tuple[str, ...]:
    return tuple(sql for sql in postgresql.OBJECTS_0002 if "CREATE VIEW trajectory" in sql)


def test_a_memory_of_every_earlier_version_is_kept() -> None:
    assert [path.stem for path in RELEASES] == [f"version_{n}" for n in range(1, SCHEMA_VERSION)]
