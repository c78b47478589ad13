"""A build that is killed, at whatever moment, leaves a sound memory, and goes on to that of an undisturbed build.

``SUPERMAP_KILLS=500 pytest -s tests/drivers/test_killed_builds.py`` kills more often at random moments and says what
came of it.
"""

from __future__ import annotations

import os
import random
import signal
import sys
from collections import Counter
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support import stopping
from support.stopping import Moment

KILLS = int(os.environ.get("SUPERMAP_KILLS", "6"))
"""Kills at random moments."""

NO_MAP = None
EMPTY_MAP: tuple[tuple[str, int], ...] = ()

IN_TURN = [
    ("making the tables", Moment(statement="CREATE TABLE checkpoint"), NO_MAP),
    ("before the traversal is begun", Moment(statement="INSERT INTO traversal"), EMPTY_MAP),
    ("before the first batch", Moment(statement="INSERT INTO keyframe"), (("building", 0),)),
    ("within the first batch", Moment(statement="INSERT INTO checkpoint"), (("building", 0),)),
    ("committing the first batch", Moment(statement="INSERT INTO checkpoint", commit=True), (("building", 0),)),
    ("between batches", Moment(statement="BEGIN IMMEDIATE", nth=4), (("building", 3),)),
    ("within a batch", Moment(statement="INSERT INTO visit", nth=2), (("building", 6),)),
    ("committing a batch", Moment(statement="INSERT INTO visit", nth=2, commit=True), (("building", 9),)),
    ("closing the visit", Moment(statement="DELETE FROM before_image"), (("building", 21),)),
    ("committing its end", Moment(statement="UPDATE traversal SET config", commit=True), (("building", 21),)),
    ("between the visits", Moment(statement="INSERT INTO traversal"), (("complete", 21),)),
    ("changing the first visit", Moment(statement="INSERT INTO before_image"), (("complete", 21), ("building", 0))),
    ("the second visit", Moment(statement="INSERT INTO visit", nth=4), (("complete", 21), ("building", 9))),
    ("closing it", Moment(statement="UPDATE traversal SET config"), (("complete", 21), ("building", 18))),
]
"""Kills of a build that goes on after each: where, at what moment, and status and keyframes of the traversals then."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return stopping.record_two_visits(tmp_path_factory.mktemp("visits"))


@pytest.fixture(scope="module")
def undisturbed(recordings: tuple[Path, ...], tmp_path_factory: pytest.TempPathFactory) -> stopping.Rows:
    """What the memory of both visits holds, built without a disturbance."""
    rows = stopping.rows(stopping.build_undisturbed(tmp_path_factory.mktemp("undisturbed"), recordings))
    assert len(rows["observation"]) > 50
    assert "disappeared" in {row[1] for row in rows["temporal_edge"]}
    return rows


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "supermap.toml").write_text(stopping.SETTINGS)
    return tmp_path


def sound_traversals(db: Path) -> tuple[tuple[str, int], ...] | None:
    """Status and keyframes of the traversals of a map, which is sound; `None` as long as there is no map."""
    try:
        with open_store(str(db), read_only=True) as store, store.reader() as reader:
            assert check(reader) == []
            return tuple((each.status, each.keyframes) for each in reader.traversals)
    except MemoryStoreError as error:
        assert "there is no map database" in str(error)  # noqa: PT017 - every other is a fault
        return NO_MAP


def test_a_build_killed_in_every_part_of_it_goes_on_to_the_memory_of_an_undisturbed_one(
    recordings: tuple[Path, ...], undisturbed: stopping.Rows, folder: Path
) -> None:
    arguments = ("build", *recordings, "--db", "map.db", "--resume")
    for where, moment, traversals in IN_TURN:
        code, told = stopping.run(folder, *arguments, prepare=stopping.kill, given=moment)
        assert code == -signal.SIGKILL, (where, told)
        assert sound_traversals(folder / "map.db") == traversals, where
    code, told = stopping.run(folder, *arguments)
    assert code == 0, told
    assert stopping.rows(folder / "map.db") == undisturbed


def random_moment(chance: random.Random) -> Moment:
    """At any time, at any statement, or within any commit of a build of 2 s, some 400 statements and 50 commits."""
    kind = chance.choice(["time", "statement", "commit"])
    if kind == "time":
        return Moment(seconds=chance.uniform(0, 2))
    if kind == "statement":
        return Moment(statement="", nth=chance.randint(1, 400))
    return Moment(statement="BEGIN", nth=chance.randint(1, 50), commit=True, seconds=chance.uniform(0, 0.004))


def test_a_build_killed_at_random_moments_goes_on_to_the_memory_of_an_undisturbed_one(
    recordings: tuple[Path, ...], undisturbed: stopping.Rows, folder: Path
) -> None:
    chance = random.Random(5)  # noqa: S311 - any moments will do
    counts: Counter[str] = Counter()
    while counts["kills"] < KILLS:
        counts["memories"] += 1
        db = folder / f"map-{counts['memories']}.db"
        arguments = ("build", *recordings, "--db", db, "--resume")
        while True:
            last = counts["kills"] == KILLS
            moment = Moment(seconds=3600) if last else random_moment(chance)
            code, told = stopping.run(folder, *arguments, prepare=stopping.kill, given=moment)
            if code == 0:
                break
            assert code == -signal.SIGKILL, told
            counts["kills"] += 1
            traversals = sound_traversals(db)
            counts["sound"] += traversals is not NO_MAP
            counts["in mid-build"] += "building" in dict(traversals or ())
        assert stopping.rows(db) == undisturbed
        counts["same"] += 1
    sys.stderr.write(
        f"\n{counts['kills']} kills, {counts['in mid-build']} of them with a traversal half written: "
        f"{counts['sound']} databases sound (the others not made yet); "
        f"{counts['same']} of {counts['memories']} memories the same as the undisturbed one in every row\n"
    )
