"""Whatever command that writes is killed, at random moments: nothing stored is lost, and done again it gives the same.

``make kill-tests KILLS=50`` kills more often, and prints what came of it. The moments follow from `SUPERMAP_KILL_SEED`.
On PostgreSQL (``SUPERMAP_TEST_DATABASE=postgresql``) every other kill is the server's.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support import databases, kill_places, stopping
from support.kill_places import Files, Places, ServerDatabases
from support.stopping import Moment

COMMANDS = ("build", "resume", "merge", "prune", "upgrade")
KILLS = int(os.environ.get("SUPERMAP_KILLS", len(COMMANDS)))
"""Kills in all; the commands share them."""
SEED = int(os.environ.get("SUPERMAP_KILL_SEED", "1"))
TO_VERSION_3 = ("DROP TABLE checksum", "UPDATE alembic_version SET version_num = '0003'")
DONE = "the same recording is in both maps"
"""What a merge says that had been committed before it was killed."""
GIVE_UP = ("--keep", "observations=1s", "--keep", "crops=none", "--keep", "thumbnails=none")


@dataclass(frozen=True)
class Undisturbed:
    """A command, the map that it begins with (`None`: none), what it makes, and how long that is."""

    arguments: tuple[str | Path, ...]
    origin: str | None
    rows: stopping.Rows
    statements: int
    commits: int
    seconds: float


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kills")
    (folder / "supermap.toml").write_text(stopping.SETTINGS)
    return folder


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Places]:
    if not databases.on_postgresql():
        yield Files(tmp_path_factory.mktemp("maps"))
        return
    found = ServerDatabases()
    try:
        yield found
    finally:
        found.end()


@pytest.fixture(scope="module")
def commands(folder: Path, places: Places, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Undisturbed]:
    """Every command, after it ran once without a disturbance."""
    recordings = stopping.record_two_visits(tmp_path_factory.mktemp("visits"))
    build = ("build", *recordings, "--resume")
    both, first, second, stopped = (places.new() for _ in range(4))
    for url, wanted in ((both, recordings), (first, recordings[:1]), (second, recordings[1:])):
        code, told = stopping.run(folder, "build", *wanted, "--db", url)
        assert code == 0, told
    moment = Moment(statement="INSERT INTO visit", nth=6)
    code, told = stopping.run(folder, *build, "--db", stopped, prepare=stopping.kill, given=moment)
    assert code == -signal.SIGKILL, told
    old = places.copy(both)
    places.run_sql(old, TO_VERSION_3 if databases.on_postgresql() else (*TO_VERSION_3, "PRAGMA user_version = 3"))
    begun: dict[str, tuple[tuple[str | Path, ...], str | None]] = {
        "build": (build, None),
        "resume": (build, stopped),
        "merge": (("db", "merge", second), first),
        "prune": (("db", "vacuum", *GIVE_UP), both),
        "upgrade": (("db", "upgrade"), old),
    }
    found = {name: undisturbed(folder, places, *each) for name, each in begun.items()}
    assert found["build"].rows == found["resume"].rows == found["upgrade"].rows
    assert len(found["prune"].rows["observation"]) < len(found["build"].rows["observation"])
    return found


def undisturbed(folder: Path, places: Places, arguments: tuple[str | Path, ...], origin: str | None) -> Undisturbed:
    url = places.new() if origin is None else places.copy(origin)
    counted = str(folder / "counts.json")
    code, told = stopping.run(folder, *arguments, "--db", url, prepare=stopping.count_moments, given=counted)
    assert code == 0, told
    counts = json.loads(Path(counted).read_text())
    return Undisturbed(arguments, origin, stopping.rows(url), **counts)


def random_moment(chance: random.Random, command: Undisturbed) -> Moment:
    """At any time, at any statement, or within any commit."""
    kind = chance.choice(["time", "statement", "commit"])
    if kind == "time":
        return Moment(seconds=chance.uniform(0, command.seconds))
    if kind == "statement":
        return Moment(statement="", nth=chance.randint(1, command.statements))
    nth = chance.randint(1, max(command.commits, 1))
    return Moment(
        statement="BEGIN" if not databases.on_postgresql() else "",
        nth=nth,
        commit=True,
        seconds=chance.uniform(0, 0.004),
    )


def statuses(url: str) -> tuple[str, ...] | None:
    """Status of the traversals of a map, which is sound; `None` where there is none, or one of the old version."""
    try:
        with open_store(url, read_only=True) as store, store.reader() as reader:
            assert check(reader) == []
            return tuple(each.status for each in reader.traversals)
    except MemoryStoreError as error:
        assert "there is no map database" in str(error) or "older version 3" in str(error)  # noqa: PT017 - no other
        return None


def killed(folder: Path, places: Places, chance: random.Random, command: Undisturbed, url: str) -> bool:
    """Run the command until it, or the server, is killed; whether that was before its end."""
    moment = random_moment(chance, command)
    if isinstance(places, ServerDatabases) and chance.random() < 0.5:
        prepare, given = kill_places.kill_server, (moment, str(places.server.folder))
        code, told = stopping.run(folder, *command.arguments, "--db", url, prepare=prepare, given=given)
        was_killed = not databases.server_processes(places.server.folder)
        places.wake()
        assert code == 0 or (code == 1 and len(told.strip().splitlines()[-1:]) == 1 and "Traceback" not in told), told
        return was_killed
    code, told = stopping.run(folder, *command.arguments, "--db", url, prepare=kill_places.kill_client, given=moment)
    assert code in {0, -signal.SIGKILL} or DONE in told, told
    return code == -signal.SIGKILL


def finish(folder: Path, command: Undisturbed, url: str) -> None:
    """Do it again, to its end; a merge that was committed says that it is."""
    code, told = stopping.run(folder, *command.arguments, "--db", url)
    assert code == 0 or DONE in told, told


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_killed_at_random_moments_loses_nothing(
    name: str, folder: Path, places: Places, commands: dict[str, Undisturbed]
) -> None:
    command, chance = commands[name], random.Random(f"{SEED} {name}")  # noqa: S311 - any moments will do
    wanted = KILLS // len(COMMANDS) + (COMMANDS.index(name) < KILLS % len(COMMANDS))
    kills, runs, unfinished, maps = 0, 0, 0, 0
    while kills < wanted and runs < 10 * wanted:
        url = places.new() if command.origin is None else places.copy(command.origin)
        before = statuses(url)
        maps += 1
        for _ in range(chance.randint(1, 3)):
            runs += 1
            kills += killed(folder, places, chance, command, url)
            after = statuses(url)
            assert (before or ()).count("complete") <= (after or before or ()).count("complete")
            unfinished += after is not None and "building" in after
        finish(folder, command, url)
        assert stopping.rows(url) == command.rows
    sys.stderr.write(
        f"\n{name}: {kills} kills in {runs} runs (seed {SEED}), {unfinished} of them with a traversal half written; "
        f"none lost: {maps} of {maps} maps the same in every row as without a disturbance\n"
    )
    assert kills >= wanted, f"most of {runs} runs came to their end before their moment"
