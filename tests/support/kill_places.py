"""Where the maps lie whose commands are killed: files, or databases of a server that is killed, too."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import tempfile
import time
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote

from support import databases, stopping
from support.stopping import Moment


class Places(Protocol):
    """Makes new maps, and copies of maps."""

    def new(self) -> str:
        """A place where no map is yet."""

    def copy(self, url: str) -> str:
        """A copy of a map that nobody has open."""

    def run_sql(self, url: str, statements: tuple[str, ...]) -> None:
        """Do something to a map behind the program's back."""

    def wake(self) -> None:
        """Let everything be there again."""


class Files:
    """SQLite files in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._numbers = count(1)

    def new(self) -> str:
        return str(self._folder / f"map-{next(self._numbers)}.db")

    def copy(self, url: str) -> str:
        path = self.new()
        for suffix in ("", "-wal"):
            if Path(url + suffix).exists():
                shutil.copyfile(url + suffix, path + suffix)
        return path

    def run_sql(self, url: str, statements: tuple[str, ...]) -> None:
        with closing(sqlite3.connect(url)) as connection:
            connection.executescript(";\n".join(statements))

    def wake(self) -> None:
        """Files are there."""


class ServerDatabases:
    """Databases of a PostgreSQL server that may be killed; it has a folder of its own, whose path is short."""

    def __init__(self) -> None:
        self.server = databases.Server(Path(tempfile.mkdtemp(prefix="supermap-")))
        self.server.start()
        self._numbers = count(1)

    def end(self) -> None:
        """Stop the server and remove its folder."""
        self.wake()
        self.server.stop()
        shutil.rmtree(self.server.folder, ignore_errors=True)

    def new(self) -> str:
        return self._made("TEMPLATE template0")

    def copy(self, url: str) -> str:
        return self._made(f"TEMPLATE {url.partition('?')[0].rpartition('/')[2]}")

    def run_sql(self, url: str, statements: tuple[str, ...]) -> None:
        with closing(self._connect(url.partition("?")[0].rpartition("/")[2])) as connection:
            for statement in ("SET search_path = supermap", *statements):
                connection.execute(statement)

    def wake(self) -> None:
        """Start the server if it is not there, as one that was killed: it recovers."""
        if not databases.server_processes(self.server.folder):
            self.server.start()

    def _made(self, template: str) -> str:
        name = f"map_{next(self._numbers)}"
        with closing(self._connect("postgres")) as connection:
            connection.execute(f"CREATE DATABASE {name} {template}")
        return f"{self.server.url(name)}&options={quote('-csearch_path=supermap')}"

    def _connect(self, database: str) -> Any:
        import psycopg

        return psycopg.connect(
            host=str(self.server.folder), user="supermap", dbname=database, autocommit=True, connect_timeout=30
        )


def kill_server(given: tuple[Moment, str]) -> None:
    """A `prepare`: the server whose folder is given is killed at a moment, with all its processes."""
    moment, folder = given

    def kill_all() -> None:
        processes = databases.server_processes(Path(folder))
        for process in processes:
            try:
                os.kill(process, signal.SIGKILL)
            except ProcessLookupError:
                continue
        deadline_s = time.monotonic() + 10
        while any(map(databases.is_running, processes)) and time.monotonic() < deadline_s:
            time.sleep(0.01)

    stopping.in_small_batches()
    stopping.at(moment, kill_all)


def kill_client(moment: Moment) -> None:
    """A `prepare`: the process is killed at a moment."""
    stopping.in_small_batches()
    stopping.kill(moment)
