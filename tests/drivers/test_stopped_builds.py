"""Builds that are stopped, run out of disk, or share their database with others: real processes."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from supermap_cli.errors import AlignmentError, MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from support import stopping
from support.cli import document, supermap

HALF_BUILT = stopping.Moment(statement="INSERT INTO observation", nth=4)
"""In the middle of the first visit."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    return stopping.record_two_visits(tmp_path_factory.mktemp("visits"))


@pytest.fixture(scope="module")
def undisturbed(recordings: tuple[Path, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stopping.build_undisturbed(tmp_path_factory.mktemp("undisturbed"), recordings)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "supermap.toml").write_text(stopping.SETTINGS)
    return tmp_path


def is_sound(db: Path) -> bool:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        return check(reader) == []


def mapped(db: Path) -> int:
    """Keyframes committed so far; 0 as long as there is no map."""
    try:
        with open_store(str(db), read_only=True) as store, store.reader() as reader:
            return sum(each.keyframes for each in reader.traversals)
    except MemoryStoreError as error:
        assert "there is no map database" in str(error)  # noqa: PT017 - every other is a fault
        return 0


def wait_until_mapped(db: Path, keyframes: int) -> None:
    for _ in range(600):
        if mapped(db) >= keyframes:
            return
        time.sleep(0.05)
    raise AssertionError("the build does not get on")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_build_finishes_its_batch_says_how_to_go_on_and_goes_on(
    recordings: tuple[Path, ...], undisturbed: Path, folder: Path, number: signal.Signals
) -> None:
    db = folder / "map.db"
    build = stopping.start(
        folder, "build", *recordings, "--db", "map.db", prepare=stopping.wait_after_commits, given=0.1
    )
    wait_until_mapped(db, 6)
    assert build.pid is not None
    os.kill(build.pid, number)
    build.join()
    told = (folder / "stderr.txt").read_text()
    assert build.exitcode == 130, told
    assert "stopped at" in told
    assert "--resume" in told
    assert is_sound(db)
    assert mapped(db) % 3 == 0
    refused = supermap("build", recordings[0], "--db", db)
    assert "was stopped at" in str(refused.exception)
    went_on = stopping.run(folder, "build", *recordings, "--db", "map.db", "--resume")
    assert went_on[0] == 0, went_on[1]
    assert stopping.rows(db) == stopping.rows(undisturbed)


def build_half(folder: Path, recording: Path) -> Path:
    """A memory with the visit half built."""
    (folder / "supermap.toml").write_text(stopping.SETTINGS)
    arguments = ("build", recording, "--db", "map.db")
    code, told = stopping.run(folder, *arguments, prepare=stopping.kill, given=HALF_BUILT)
    assert code == -signal.SIGKILL, told
    return folder / "map.db"


@pytest.fixture(scope="module")
def stopped(recordings: tuple[Path, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A memory with the first visit half built, which no test changes."""
    return build_half(tmp_path_factory.mktemp("stopped"), recordings[0])


def test_a_stopped_build_goes_on_with_the_settings_it_was_begun_with_only(
    recordings: tuple[Path, ...], stopped: Path
) -> None:
    before = stopping.rows(stopped)
    refused = supermap("build", recordings[0], "--db", stopped, "--resume", "--rate", "5")
    assert "keyframes.batch was 3, now 10" in str(refused.exception)
    assert stopping.rows(stopped) == before


def test_a_stopped_build_can_begin_anew(recordings: tuple[Path, ...], undisturbed: Path, folder: Path) -> None:
    db = build_half(folder, recordings[0])
    code, told = stopping.run(folder, "build", recordings[0], "--db", "map.db", "--restart")
    assert code == 0, told
    assert "had been stopped" in told
    code, told = stopping.run(folder, "build", recordings[1], "--db", "map.db")
    assert code == 0, told
    assert stopping.rows(db) == stopping.rows(undisturbed)


def test_a_build_that_is_begun_anew_in_vain_costs_nothing(recordings: tuple[Path, ...], stopped: Path) -> None:
    before = stopping.rows(stopped)
    refused = supermap("build", recordings[0], "--db", stopped, "--restart", "--align", "nowhere")
    assert isinstance(refused.exception, AlignmentError)
    assert stopping.rows(stopped) == before


@pytest.mark.parametrize("other", [("--align", "none"), ("--name", "sunday")])
def test_a_build_goes_on_in_the_place_and_under_the_name_it_was_begun_with(
    recordings: tuple[Path, ...], stopped: Path, other: tuple[str, str]
) -> None:
    code, told = stopping.run(stopped.parent, "build", recordings[0], "--db", "map.db", "--resume", *other)
    assert code == 1
    assert "was begun otherwise" in told


def test_a_recording_that_is_built_again_can_be_stopped_and_go_on(recordings: tuple[Path, ...], folder: Path) -> None:
    arguments = ("build", recordings[0], "--db", "map.db")
    assert stopping.run(folder, *arguments)[0] == 0
    assert stopping.run(folder, *arguments, "--again", prepare=stopping.kill, given=HALF_BUILT)[0] == -signal.SIGKILL
    code, told = stopping.run(folder, *arguments, "--resume")
    assert code == 0, told
    with open_store(str(folder / "map.db"), read_only=True) as store:
        assert [(each.name, each.status) for each in store.traversals()] == [
            ("monday", "complete"),
            ("monday-2", "complete"),
        ]


def test_what_is_half_built_can_be_asked_and_is_called_so(stopped: Path) -> None:
    assert mapped(stopped) == 12
    shown = document("show", "show", "--db", stopped)
    assert [each["status"] for each in shown["traversals"]] == ["building"]
    assert is_sound(stopped)


def test_what_is_in_the_map_is_passed_over_by_a_build_that_goes_on(
    recordings: tuple[Path, ...], undisturbed: Path, folder: Path
) -> None:
    before = stopping.rows(undisturbed)
    code, told = stopping.run(folder, "build", *recordings, "--db", undisturbed, "--resume")
    assert code == 0
    assert told.count("is in the map already") == 2
    assert stopping.rows(undisturbed) == before


@pytest.mark.sqlite_only("about files")
@pytest.mark.parametrize("size_kb", [200, 500, 900])
def test_a_full_disk_is_a_clear_error_and_costs_nothing_that_was_committed(
    recordings: tuple[Path, ...], undisturbed: Path, folder: Path, size_kb: int
) -> None:
    arguments = ("build", *recordings, "--db", "map.db")
    code, told = stopping.run(folder, *arguments, prepare=stopping.limit_files, given=size_kb * 1000)
    assert code == 1
    assert "Traceback" not in told
    assert told.rstrip().splitlines()[-1].startswith("error: the map database")
    assert "free space" in told
    db = folder / "map.db"
    if mapped(db):
        assert is_sound(db)
    code, told = stopping.run(folder, *arguments, "--resume")
    assert code == 0, told
    assert stopping.rows(db) == stopping.rows(undisturbed)


def test_readers_see_a_sound_past_while_a_build_writes_and_a_second_build_is_refused(
    recordings: tuple[Path, ...], undisturbed: Path, folder: Path
) -> None:
    db = folder / "map.db"
    build = stopping.start(
        folder, "build", *recordings, "--db", "map.db", prepare=stopping.wait_after_commits, given=0.15
    )
    wait_until_mapped(db, 3)
    seen = []
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    code, told = stopping.run(elsewhere, "build", recordings[1], "--db", db)
    assert code == 1
    assert f"another build is writing this map (process {build.pid}" in told
    while build.is_alive():
        with open_store(str(db), read_only=True) as store, store.reader() as reader:
            at_first = reader.counts()
            assert check(reader) == []
            time.sleep(0.1)  # the build goes on meanwhile, and this reader does not see it
            assert reader.counts() == at_first
        seen.append(at_first["keyframes"])
        assert document("answer", "query", "how many chairs", "--db", db)["intent"] == "count"
    build.join()
    assert build.exitcode == 0, (folder / "stderr.txt").read_text()
    assert seen == sorted(seen)
    assert len(set(seen)) > 1
    assert stopping.rows(db) == stopping.rows(undisturbed)
