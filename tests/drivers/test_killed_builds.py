"""A build that is killed, at whatever moment, leaves a sound memory, and goes on to that of an undisturbed build.

`test_killed_commands` kills at random moments, and other commands, too.
"""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support import stopping
from support.stopping import Moment

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
