"""Which database the tests run on: SQLite files, or, with `SUPERMAP_TEST_DATABASE=postgresql`, schemas of a server.

A test names its map by a path, whatever the database is. On PostgreSQL every path stands for a schema of its own on a
server that the session starts for itself (Debian's, on a socket in a folder that is gone afterwards), or on the one at
`SUPERMAP_TEST_POSTGRESQL_URL`. Marks: `sqlite_only(reason)`, `postgresql_only`.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sqlite3
import subprocess
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial, wraps
from pathlib import Path
from typing import Any

import pytest

from supermap_schema.models import Base

SERVER = "SUPERMAP_TEST_POSTGRESQL_URL"
ABSENT = "SUPERMAP_TEST_POSTGRESQL_ABSENT"
SERVICE_USERS = ("postgres", "nobody")
"""PostgreSQL refuses to be run by root."""


def on_postgresql() -> bool:
    return os.environ.get("SUPERMAP_TEST_DATABASE") == "postgresql"


def place(path: str | Path) -> str:
    """What to give another process for the map that this one knows by a path."""
    if not on_postgresql() or "://" in str(path):
        return str(path)
    schema = "t" + hashlib.sha256(str(Path(path).absolute()).encode()).hexdigest()[:16]
    return f"{os.environ[SERVER]}&options=-csearch_path%3D{schema}"


def connect(path: str | Path) -> Any:
    """A plain connection to a map's database, as another program has it."""
    if not on_postgresql():
        return sqlite3.connect(path)
    import psycopg
    from sqlalchemy import make_url

    url = make_url(place(path))
    return psycopg.connect(dbname=url.database, user=url.username, **url.query)


def query(path: str | Path, sql: str) -> list[tuple[Any, ...]]:
    """What a plain connection reads."""
    with closing(connect(path)) as connection:
        return [tuple(row) for row in connection.execute(sql).fetchall()]


def contents(path: str | Path, but: tuple[str, ...] = ()) -> dict[str, list[tuple[Any, ...]]]:
    """All rows of all tables but some, as they are stored."""
    names = [table.name for table in Base.metadata.sorted_tables if table.name not in but]
    return {name: query(path, f"SELECT * FROM {name} ORDER BY 1, 2, 3") for name in names}


def refusals() -> tuple[type[Exception], ...]:
    """What a plain connection raises when the database refuses a change."""
    if not on_postgresql():
        return (sqlite3.IntegrityError,)
    import psycopg

    return (psycopg.IntegrityError,)


def run_sql(path: str | Path, script: str) -> None:
    """Do something to a database behind the program's back: statements that end with a semicolon and a newline."""
    with closing(connect(path)) as connection:
        if on_postgresql():
            connection.execute(script.encode())
        else:
            connection.executescript(script)
        connection.commit()


def use_postgresql() -> None:
    """From now on a path stands for a schema, wherever the program is given one."""
    from supermap_cli.memory.databases.postgresql import PostgresqlSchema
    from supermap_cli.memory.databases.sqlite import SqliteFile

    pytest.MonkeyPatch().setattr(SqliteFile, "of", lambda path, waiting=None: PostgresqlSchema.of(place(path), waiting))


def replay_migrations() -> None:
    """Every new map after the first one gets its tables by the statements that the migrations ran for that one.

    They are the same for every empty database, and Alembic takes much longer over them than the database.
    """
    from sqlalchemy import Connection, event, inspect

    from supermap_schema import upgrading

    migrate = upgrading.upgrade
    recorded: dict[str, list[tuple[str, Any]]] = defaultdict(list)

    def record(connection: Connection, _cursor: Any, statement: str, parameters: Any, *_: Any) -> None:
        recorded[connection.dialect.name].append((statement, parameters))

    @wraps(migrate)
    def upgrade(connection: Connection, revision: str = "head") -> None:
        if revision != "head" or inspect(connection).get_table_names():
            migrate(connection, revision)
        elif not recorded[connection.dialect.name]:
            event.listen(connection, "before_cursor_execute", record)
            migrate(connection)
            event.remove(connection, "before_cursor_execute", record)
        else:
            cursor = connection.connection.cursor()
            for statement, parameters in recorded[connection.dialect.name]:
                cursor.execute(statement, parameters)

    upgrading.upgrade = upgrade


def start_server(config: pytest.Config) -> None:
    """Once a session; processes that run a part of the tests find it in their environment."""
    if SERVER in os.environ or ABSENT in os.environ:
        return
    try:
        folder = Path(tempfile.mkdtemp(prefix="supermap-"))
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
        running = server(folder)
        os.environ[SERVER] = running.__enter__()
        config.add_cleanup(lambda: running.__exit__(None, None, None))
    except (OSError, ImportError, subprocess.CalledProcessError) as error:
        os.environ[ABSENT] = f"no PostgreSQL: {error}"


@contextmanager
def server(folder: Path) -> Iterator[str]:
    """A server of its own on a socket in `folder`, which is empty; its URL, without a schema."""
    running = Server(folder, "-c synchronous_commit=off -c full_page_writes=off")
    running.start()
    try:
        yield running.url("postgres")
    finally:
        running.stop()


class Server:
    """A PostgreSQL server on a socket in `folder`, which is empty before; it never syncs to the disk."""

    def __init__(self, folder: Path, options: str = "") -> None:
        import psycopg  # noqa: F401 - the reason for skipping is this or the next

        self.folder = folder
        self._options = f"-k {folder} -c listen_addresses='' -c fsync=off {options}"
        self._programs = _programs()
        user = _service_user()
        if user is not None:
            shutil.chown(folder, user)
        as_user: dict[str, Any] = {"user": user, "group": user and _group(user), "extra_groups": user and []}
        self._run = partial(
            subprocess.run, check=True, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **as_user
        )
        trusting = ["-U", "supermap", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"]
        self._run([self._programs / "initdb", "-D", folder / "cluster", *trusting])

    def url(self, database: str) -> str:
        """The URL of one of its databases, without a schema."""
        return f"postgresql+psycopg://supermap@/{database}?host={self.folder}"

    def start(self) -> None:
        if not server_processes(self.folder):  # a zombie's number in these files looks like a server that runs
            for name in ("cluster/postmaster.pid", ".s.PGSQL.5432.lock"):
                (self.folder / name).unlink(missing_ok=True)
        self._control("-o", self._options, "start")

    def stop(self) -> None:
        self._control("-m", "immediate", "stop")

    def _control(self, *arguments: str) -> None:
        control = [self._programs / "pg_ctl", "-D", self.folder / "cluster", "-w", "-l", self.folder / "log"]
        self._run([*control, *arguments])


def server_processes(folder: Path) -> tuple[int, ...]:
    """The processes of the server in a folder, its first one first; none if it is not there."""
    try:
        first = int((folder / "cluster" / "postmaster.pid").read_text().split()[0])
        children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
    except (OSError, IndexError):
        return ()
    return (first, *map(int, children)) if is_running(first) else ()


def is_running(process: int) -> bool:
    """Whether a process is there and has not ended: one that nobody waited for is a zombie."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in {"Z", "X"}


def _programs() -> Path:
    """Debian keeps the server's programs out of the way."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    on_path = shutil.which("initdb")
    if not found and on_path is None:
        raise FileNotFoundError("neither /usr/lib/postgresql/*/bin/initdb nor initdb on the path")
    return found[-1].parent if found else Path(str(on_path)).parent


def _service_user() -> str | None:
    if os.geteuid() != 0:
        return None
    import pwd

    known = {entry.pw_name for entry in pwd.getpwall()}
    return next(name for name in SERVICE_USERS if name in known)


def _group(user: str) -> int:
    import pwd

    return pwd.getpwnam(user).pw_gid


def examples(count: int) -> int:
    """How many random memories to try: fewer in PostgreSQL, where making one takes seconds."""
    return max(3, count // 5) if on_postgresql() else count
