"""A PostgreSQL map that another program writes to: it is waited for, with a word, and then named."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from supermap_cli.memory import open_store
from supermap_cli.memory.databases import Waiting
from support import databases, kitchen, memories
from support.cli import supermap

pytestmark = pytest.mark.postgresql_only

WRITES = ("UPDATE instance SET yaw = yaw WHERE number = 1", "LOCK TABLE traversal", "LOCK TABLE state IN SHARE MODE")


@pytest.fixture
def url(tmp_path: Path) -> str:
    kitchen.make_kitchen(tmp_path / "map.db")
    return databases.place(tmp_path / "map.db")


@pytest.fixture(params=WRITES)
def other(request: pytest.FixtureRequest, url: str, tmp_path: Path) -> Iterator[Any]:
    """Another program, in the middle of its change."""
    with closing(databases.connect(tmp_path / "map.db")) as connection:
        connection.execute(request.param)
        yield connection
        connection.rollback()


def test_a_writer_waits_for_another_program_and_says_so(url: str, other: Any) -> None:
    told = list[str]()
    released = threading.Timer(2.0, other.rollback)
    released.start()
    with open_store(url, waiting=Waiting(30, told.append)) as store, store._writing():
        pass
    released.join(30)
    assert [line.partition(" to ")[0] for line in told] == ["another program writes"]
    assert "waiting up to 30 s for it" in told[0]


@pytest.mark.parametrize(
    "command", [("db", "vacuum", "--keep", "crops=none"), ("db", "check", "--repair"), ("db", "upgrade")]
)
def test_after_that_it_says_who_is_in_the_way(url: str, other: Any, command: tuple[str, ...]) -> None:
    began_s = time.monotonic()
    refused = supermap(*command, "--db", url, "--wait", "1")
    assert time.monotonic() - began_s < 20
    assert str(refused.exception).startswith("another program writes to the map database (postgresql")
    assert "--wait SECONDS waits longer" in str(refused.exception)


def test_readers_wait_for_a_lock_that_shuts_them_out_no_longer_than_that(url: str, tmp_path: Path) -> None:
    with closing(databases.connect(tmp_path / "map.db")) as connection:
        connection.execute("LOCK TABLE traversal")
        refused = supermap("db", "check", "--db", url, "--wait", "1")
        connection.rollback()
    assert str(refused.exception).startswith("another program writes to the map database")


def test_readers_of_another_program_are_not_waited_for(url: str, tmp_path: Path) -> None:
    with closing(databases.connect(tmp_path / "map.db")) as connection:
        connection.execute("SELECT count(*) FROM instance")
        with open_store(url, waiting=Waiting(0)) as store:
            store.begin_traversal(memories.start("friday", (1e6, 1e6 + 60)))
