"""A build that is killed, at whatever moment, leaves a sound memory, and goes on to that of an undisturbed build.

Fifty kills by default; ``SUPERMAP_KILLS=500 pytest -s tests/test_killed_builds.py`` does more and
says what came of it.
"""

from __future__ import annotations

import os
import random
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support import stopping
from support.stopping import Moment

KILLS = int(os.environ.get("SUPERMAP_KILLS", "50"))


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return stopping.record_two_visits(tmp_path_factory.mktemp("visits"))


@pytest.fixture(scope="module")
def undisturbed(recordings: tuple[Path, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The memory of both visits, built without a disturbance."""
    return stopping.build_undisturbed(tmp_path_factory.mktemp("undisturbed"), recordings)


def has_map(db: Path) -> bool:
    """Whether the build had come so far."""
    try:
        open_store(str(db), read_only=True).close()
    except MemoryStoreError as error:
        assert "there is no map database" in str(error)  # noqa: PT017 - every other is a fault
        return False
    return True


def random_moment(chance: random.Random, build_s: float) -> Moment:
    """At any time, at any statement, or within any commit of the first part of a build."""
    kind = chance.choice(["time", "statement", "commit"])
    if kind == "time":
        return Moment(seconds=chance.uniform(0, 0.6 * build_s))
    if kind == "statement":
        return Moment(statement=chance.randint(1, 400))
    return Moment(commit=chance.randint(1, 20), seconds=chance.uniform(0, 0.004))


def test_killed_builds_go_on_to_the_memory_of_an_undisturbed_one(
    recordings: tuple[Path, ...], undisturbed: Path, tmp_path: Path
) -> None:
    chance = random.Random(5)  # noqa: S311 - any moments will do
    wanted = stopping.rows(undisturbed)
    assert len(wanted["observation"]) > 50
    assert {row[1] for row in wanted["temporal_edge"]} >= {"disappeared"}
    counts: Counter[str] = Counter()
    (tmp_path / "supermap.toml").write_text(stopping.SETTINGS)
    build_s = 4.0
    while counts["kills"] < KILLS:
        counts["memories"] += 1
        db = tmp_path / f"map-{counts['memories']}.db"
        while True:
            began = time.monotonic()
            arguments = ("build", *recordings, "--db", db, "--resume")
            code, told = stopping.run(tmp_path, *arguments, prepare=stopping.kill, given=random_moment(chance, build_s))
            if code == 0:
                break
            assert code == -9, told
            counts["kills"] += 1
            if has_map(db):
                with open_store(str(db), read_only=True) as store, store.reader() as reader:
                    assert check(reader) == []
                    counts["in mid-build"] += any(each.status == "building" for each in reader.traversals)
                counts["sound"] += 1
            build_s = 0.8 * build_s + 0.2 * (time.monotonic() - began) if counts["kills"] == 1 else build_s
        assert stopping.rows(db) == wanted
        counts["same"] += 1
    told = (
        f"{counts['kills']} kills, {counts['in mid-build']} of them with a traversal half written: "
        f"{counts['sound']} databases sound (the others not made yet); "
        f"{counts['same']} of {counts['memories']} memories the same as the undisturbed one in every row"
    )
    sys.stderr.write(f"\n{told}\n")
    assert counts["in mid-build"] >= KILLS / 3
