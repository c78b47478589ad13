"""A map in PostgreSQL: what cannot be opened, who may write, what becomes of a lost connection."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import make_url

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.databases import database_of, dialect_of
from supermap_cli.memory.databases.postgresql import PostgresqlSchema
from supermap_cli.memory.opening import upgrade_database
from supermap_cli.types.memory import MapDelta
from supermap_schema import SCHEMA_VERSION
from support import databases, kitchen
from support import memories as m
from support.cli import supermap

FRAME = MapDelta(keyframes=(m.keyframe(1),))


@pytest.fixture
def server() -> str:
    if not databases.on_postgresql():
        pytest.skip("runs in `make test-postgresql`")
    return os.environ[databases.SERVER]


@pytest.fixture
def url(server: str, tmp_path: Path) -> Iterator[str]:
    """An empty database of its own."""
    import psycopg

    name = f"d{abs(hash(tmp_path))}"
    with closing(connected(server)) as connection:
        connection.autocommit = True
        connection.execute(f"CREATE DATABASE {name}".encode())
        try:
            yield server.replace("/postgres?", f"/{name}?")
        finally:
            with closing(psycopg.connect(connection.info.dsn, autocommit=True)) as last:
                last.execute(f"DROP DATABASE {name} WITH (FORCE)".encode())


def connected(url: str) -> Any:
    import psycopg

    parsed = make_url(url)
    return psycopg.connect(dbname=parsed.database, user=parsed.username, **parsed.query)


def run(url: str, script: str) -> Any:
    with closing(connected(url)) as connection:
        found = connection.execute(script.encode())
        connection.commit()
        return found.fetchall() if found.description else None


def tables(url: str) -> list[str]:
    return [name for (name,) in run(url, "SELECT tablename FROM pg_tables WHERE schemaname = current_schema()")]


# What needs no server


@pytest.mark.parametrize(
    ("url", "where"),
    [
        ("postgresql+psycopg://ann:secret@host/map", "postgresql+psycopg://ann@host/map"),
        ("postgresql://ann:secret@host:5433/map", "postgresql+psycopg://ann@host:5433/map"),
        ("postgres://host/map?password=secret&sslmode=require", "postgresql+psycopg://host/map?sslmode=require"),
    ],
)
def test_a_password_is_never_shown(url: str, where: str) -> None:
    assert database_of(url).where == where


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("postgresql+asyncpg://ann:secret@host/map", r"driver 'asyncpg'.*postgresql\+psycopg://USER@HOST"),
        ("postgresql+psycopg://ann:secret@host:port/map", "URL is not understood"),
        ("postgresql+psycopg://ann:secret@host", "names no database"),
        ("mysql://ann:secret@host/map", "databases of kind 'mysql' cannot be used"),
    ],
)
def test_a_wrong_url_is_an_error(url: str, message: str) -> None:
    with pytest.raises(MemoryStoreError, match=message) as caught:
        database_of(url)
    assert "secret" not in str(caught.value)
    assert caught.value.cure


def test_a_missing_driver_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(MemoryStoreError, match=r"psycopg.*pip install 'supermap-cli\[postgresql\]'"):
        open_store("postgresql+psycopg://host/map")


@pytest.mark.parametrize(
    "command", [["db", "info"], ["query", "chair"], ["db", "sql", "SELECT 1"], ["build", "x.mcap"]]
)
def test_no_server_is_one_line_with_a_cure(tmp_path: Path, command: list[str]) -> None:
    pytest.importorskip("psycopg")
    if command[0] == "build":
        pytest.skip("a build opens its recording first")
    url = f"postgresql+psycopg://ann:secret@/map?host={tmp_path}"
    error = supermap(*command, "--db", url).exception
    assert isinstance(error, MemoryStoreError)
    assert "start the server" in str(error)
    assert "secret" not in str(error)
    assert "\n" not in str(error)


# With a server


def test_what_the_server_refuses_is_said_with_its_cure(server: str, url: str) -> None:
    run(server, "DROP ROLE IF EXISTS guest; CREATE ROLE guest LOGIN")
    m.add_traversal(open_store(url, create=True), "monday", (0, 10), FRAME)
    guest = url.replace("supermap@", "guest:secret@")
    for refused, message in (
        (url.replace(f"/{make_url(url).database}?", "/nowhere?"), r'"nowhere" does not exist.*createdb'),
        (url.replace("supermap@", "nobody-known:secret@"), r'"nobody-known" does not exist.*a user that the server'),
        (guest, "permission denied.*GRANT"),
    ):
        with pytest.raises(MemoryStoreError, match=message) as caught:
            open_store(refused, read_only=True)
        assert "secret" not in str(caught.value)


def test_an_empty_database_is_no_map_yet(url: str) -> None:
    with pytest.raises(MemoryStoreError, match=r"there is no map database.*supermap build"):
        open_store(url)
    with open_store(url, create=True) as store:
        assert store.traversals() == ()
    assert tables(url) == []


@pytest.mark.parametrize("mode", [{"create": True}, {}, {"read_only": True}])
def test_tables_of_something_else_are_refused_and_left_alone(url: str, mode: dict[str, bool]) -> None:
    run(url, "CREATE TABLE traversal (name text); INSERT INTO traversal VALUES ('Matterhorn')")
    with pytest.raises(MemoryStoreError, match=r"'public' holds tables, but no SuperMap map.*search_path%3Dsupermap"):
        open_store(url, **mode)
    assert run(url, "SELECT * FROM traversal") == [("Matterhorn",)]
    with open_store(f"{url}&options=-csearch_path%3Dsupermap", create=True) as store:
        m.add_traversal(store, "monday", (0, 10), FRAME)


def test_a_newer_and_an_older_map_say_what_to_do(url: str) -> None:
    with open_store(url, create=True) as store:
        m.add_traversal(store, "monday", (0, 10), FRAME)
    run(url, f"UPDATE alembic_version SET version_num = '{SCHEMA_VERSION + 1:04}'")
    with pytest.raises(MemoryStoreError, match=f"newer version {SCHEMA_VERSION + 1}.*newer supermap-cli"):
        open_store(url, read_only=True)
    run(url, "UPDATE alembic_version SET version_num = '0001'")
    with pytest.raises(MemoryStoreError, match=r"older version 1.*supermap db upgrade"):
        open_store(url)
    run(url, f"UPDATE alembic_version SET version_num = '{SCHEMA_VERSION:04}'")
    assert upgrade_database(url) == (SCHEMA_VERSION, SCHEMA_VERSION)


def test_several_maps_lie_in_one_database_each_in_its_schema(url: str) -> None:
    office, home = (f"{url}&options=-csearch_path%3D{name}" for name in ("office", '"my%5C%20home"'))
    with open_store(office, create=True) as first, open_store(home, create=True) as second:
        m.add_traversal(first, "monday", (0, 10), FRAME)
        m.add_traversal(second, "tuesday", (20, 30))
    assert run(url, 'SELECT name FROM office.traversal UNION ALL SELECT name FROM "my home".traversal') == [
        ("monday",),
        ("tuesday",),
    ]
    assert "public" in run(url, "SELECT current_schema()")[0]
    assert tables(url) == []


def test_what_a_failed_build_made_is_taken_away_with_its_schema(url: str) -> None:
    run(url, "CREATE SCHEMA mine; CREATE TABLE mine.cat (name text)")
    for place in (url, f"{url}&options=-csearch_path%3Doffice"):
        with open_store(place, create=True) as store:
            store.commit(store.begin_traversal(m.start("monday", (0, 10))), FRAME)
            assert store.discard_if_created()
    left = "SELECT nspname, relname FROM pg_class c JOIN pg_namespace n ON n.oid = relnamespace"
    assert run(url, f"{left} WHERE nspname !~ '^pg_' AND nspname <> 'information_schema'") == [("mine", "cat")]
    assert run(url, "SELECT nspname FROM pg_namespace WHERE nspname = 'office'") == []
    assert run(url, "SELECT proname FROM pg_proc WHERE pronamespace = 'public'::regnamespace") == []
    with open_store(url, create=True) as store:
        m.add_traversal(store, "monday", (0, 10), FRAME)


def test_another_build_is_told_who_writes(url: str) -> None:
    holder = (
        "import sys; from supermap_cli.memory import open_store;"
        "store = open_store(sys.argv[1], create=True); print(flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, url], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(MemoryStoreError, match=rf"another build .*process {process.pid} on .*, since 20"):
            open_store(url, create=True)
        open_store(f"{url}&options=-csearch_path%3Doffice", create=True).close()
        process.kill()
    open_store(url, create=True).close()


def test_a_build_that_lost_its_lock_writes_no_more(url: str) -> None:
    with open_store(url, create=True) as store:
        traversal = store.begin_traversal(m.start("monday", (0, 10)))
        end_others(url, "pid IN (SELECT pid FROM pg_locks WHERE locktype = 'advisory')")
        with pytest.raises(MemoryStoreError, match="held the build lock was lost"):
            store.commit(traversal, FRAME)
    with open_store(url, read_only=True) as store:
        assert list(store.keyframe_depths()) == []


def test_a_lost_connection_is_one_line_and_what_was_committed_stays(url: str) -> None:
    with open_store(url, create=True) as store:
        traversal = store.begin_traversal(m.start("monday", (0, 10)))
        store.commit(traversal, FRAME)
        end_others(url, "true")
        with pytest.raises(MemoryStoreError, match=r"connection to the PostgreSQL server was lost.*is kept"):
            store.commit(traversal, MapDelta(keyframes=(m.keyframe(2),)))
    with open_store(url) as store:
        assert len(list(store.keyframe_depths())) == 1


def test_a_check_whose_connection_is_lost_does_not_call_that_damage(url: str) -> None:
    with open_store(url, create=True) as store:
        m.add_traversal(store, "monday", (0, 10), FRAME)

    def check_without_connection() -> None:
        with open_store(url, read_only=True) as store, store.reader() as reader:
            end_others(url, "true")
            check(reader)

    with pytest.raises(MemoryStoreError, match="was lost"):
        check_without_connection()


def end_others(url: str, which: str) -> None:
    others = f"pid <> pg_backend_pid() AND datname = current_database() AND {which}"
    run(url, f"SELECT pg_terminate_backend(pid, 5000) FROM pg_stat_activity WHERE {others}")


def test_triggers_hold_for_whoever_writes_from_wherever(url: str) -> None:
    import psycopg

    with open_store(f"{url}&options=-csearch_path%3Doffice", create=True) as store:
        m.add_traversal(store, "monday", (0, 100), kitchen.monday)
    for change in ("UPDATE office.observation SET score = 1", "DELETE FROM office.observation"):
        with pytest.raises(psycopg.IntegrityError, match="observations"):
            run(url, change)


def test_ids_go_on_after_what_was_taken_out_as_in_sqlite(url: str) -> None:
    with open_store(url, create=True) as store:
        store.discard_traversal(store.begin_traversal(m.start("monday", (0, 10))))
        assert m.add_traversal(store, "monday", (0, 10), FRAME) == 1


def test_boxes_and_labels_are_found_by_their_indices(url: str) -> None:
    with open_store(url, create=True) as store:
        m.add_traversal(store, "monday", (0, 100), kitchen.monday)
    dialect = dialect_of(database_of(url).reader_engine().connect())
    with database_of(url).reader_engine().connect() as connection:
        connection.exec_driver_sql("SET LOCAL enable_seqscan = off")
        for statement, index in (
            (dialect.states_near((0, 0, 0), (1, 1, 1)), "ix_state_ground"),
            (dialect.matching_labels("dining table"), "ix_instance_label_words"),
        ):
            compiled = statement.compile(connection, compile_kwargs={"literal_binds": True})
            plan = "\n".join(connection.exec_driver_sql(f"EXPLAIN {compiled}".replace("%", "%%")).scalars())
            assert index in plan


def test_a_server_that_is_too_old_is_refused(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("supermap_schema.postgresql.OLDEST_SERVER", 990000)
    with pytest.raises(MemoryStoreError, match="use PostgreSQL 99 or newer"):
        open_store(url, create=True)


def test_the_size_is_that_of_tables_and_indices(url: str) -> None:
    with open_store(url, create=True) as store:
        m.add_traversal(store, "monday", (0, 100), kitchen.monday)
    with open_store(url, read_only=True) as store, store.reader() as reader:
        (everything,) = run(
            url, "SELECT sum(pg_relation_size(oid)) FROM pg_class WHERE relnamespace = 'public'::regnamespace"
        )
        assert reader.size_bytes() >= everything[0] > 100_000
    assert isinstance(database_of(url), PostgresqlSchema)
