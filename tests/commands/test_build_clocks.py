"""Recordings whose stamps and times of recording differ, and windows of them, built into sound memories."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import MemoryStoreError, RecordingError
from supermap_cli.memory import open_store
from supermap_cli.memory.values import StoredTraversal
from support import bags
from support.cli import supermap

S = 10**9
FRAMES = 60
FRAME = "camera_optical_frame"
SIZE, K = (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, (bags.WIDTH - 1) / 2, (bags.HEIGHT - 1) / 2)

Clock = Callable[[int], int]


@pytest.fixture(autouse=True)
def _here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


def record(path: Path, stamped: Clock = bags.stamp, logged: Clock = bags.stamp) -> Path:
    """A robot that looks at a box from a place for six seconds, at 10 Hz, its stamps and times of recording as told."""
    with bags.BagWriter(path) as bag:
        bag.transform(stamped(0), "base_link", FRAME, bags.T_BASE_OPTICAL, static=True, log_ns=logged(0))
        for index in range(FRAMES):
            at, log_ns = stamped(index), logged(index)
            numbers = np.zeros((bags.HEIGHT, bags.WIDTH), np.uint16)
            numbers[16:32, 24:40] = 1
            bag.odometry("/odom", at, bags.pose_at(0), log_ns=log_ns)
            for topic in ("/camera/color/camera_info", "/camera/depth/camera_info"):
                bag.camera_info(topic, at, FRAME, SIZE, K, log_ns=log_ns)
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(0), "rgb8", log_ns=log_ns)
            bag.image("/camera/depth/image_raw", at, FRAME, bags.depth_image(), "16UC1", log_ns=log_ns)
            bag.detections("/detections", at, FRAME, [([("box", 0.9)], (24, 16, 40, 32))], log_ns=log_ns)
            bag.image("/masks", at, FRAME, numbers, "16UC1", log_ns=log_ns)
    return path


def build(path: Path, *arguments: str) -> list[str]:
    """Build into the database here; returns the warnings."""
    result = supermap("build", str(path), "--align", "none", "--json", *arguments)
    if result.exception is not None:
        raise result.exception
    (traversal,) = json.loads(result.stdout)["traversals"]
    return list(traversal["warnings"])


def traversals() -> tuple[StoredTraversal, ...]:
    """What the database here holds, which must be sound, and every box in it."""
    assert supermap("db", "check").exit_code == 0
    with open_store("supermap.db", read_only=True) as store:
        assert {each.label for each in store.load_instances()} == {"box"}
        return store.traversals()


def later(by_s: float, since: int = 0) -> Clock:
    return lambda index: bags.stamp(index) + (round(by_s * S) if index >= since else 0)


@pytest.mark.parametrize("by_s", [-0.05, 0.05, -0.9, 0.9, -3.0, 3.0, 1000.0])
def test_stamps_before_and_after_the_time_of_recording_lie_in_the_traversal(tmp_path: Path, by_s: float) -> None:
    path = record(tmp_path / "run.mcap", later(by_s))
    warnings = build(path)
    (run,) = traversals()
    assert run.start_ns <= later(by_s)(0)
    assert run.end_ns >= later(by_s)(FRAMES - 1)
    assert run.end_ns - run.start_ns < 7 * S
    assert any("off the time of recording" in each for each in warnings) is (abs(by_s) >= 1)
    with pytest.raises(MemoryStoreError, match="in the map already, as traversal 'run'"):
        build(path)


@pytest.mark.parametrize("by_s", [-0.05, 0.0, 3.0])
def test_parts_hold_all_images_of_the_whole(tmp_path: Path, by_s: float) -> None:
    path = record(tmp_path / "run.mcap", later(by_s))
    build(path, "--end", "3", "--rate", "10")
    assert not [each for each in build(path, "--start", "3", "--rate", "10") if "clock starts" in each]
    first, second = traversals()
    assert first.keyframes + second.keyframes == FRAMES
    assert first.end_ns < second.start_ns


def test_windows_that_share_seconds_enter_once_unless_again(tmp_path: Path) -> None:
    path = record(tmp_path / "run.mcap")
    build(path, "--end", "3")
    for window in (("--end", "4"), (), ("--start", "1", "--end", "2"), ("--start", "2")):
        with pytest.raises(
            MemoryStoreError, match=r"\d\.\d s of this window are in the map already, as traversal 'run'"
        ):
            build(path, *window)
    warnings = build(path, "--end", "4", "--again")
    assert [each for each in warnings if each.startswith("run-2's clock starts before run's end")]
    build(path, "--start", "4.5", "--name", "rest")
    with pytest.raises(MemoryStoreError, match="as traversal 'rest'"):
        build(path, "--start", "5")
    assert [each.name for each in traversals()] == ["run", "run-2", "rest"]


def test_a_window_that_reaches_beyond_the_recording_is_the_recording(tmp_path: Path) -> None:
    path = record(tmp_path / "run.mcap", later(-0.05))
    build(path, "--start", "0", "--end", "100", "--rate", "10")
    assert [each.keyframes for each in traversals()] == [FRAMES]
    with pytest.raises(MemoryStoreError, match="this recording is in the map already"):
        build(path)


@pytest.mark.parametrize("by_s", [2.0, 30.0, 300.0])
def test_a_clock_set_forward_is_said_and_the_map_is_sound(tmp_path: Path, by_s: float) -> None:
    warnings = build(record(tmp_path / "run.mcap", later(by_s, 30)))
    (said,) = [each for each in warnings if "set forward" in each]
    assert "at 2.900 s: its clock is set forward by" in said
    assert "after image 30 of 60" in said
    (run,) = traversals()
    assert run.end_ns >= later(by_s, 30)(FRAMES - 1)


def test_a_clock_that_gets_its_time_by_network_is_an_error_that_names_windows_to_build(tmp_path: Path) -> None:
    clock: Clock = lambda index: bags.stamp(index) - (bags.START_NS - S if index < 30 else 0)  # noqa: E731
    path = record(tmp_path / "run.mcap", clock, clock)
    start = str((bags.stamp(30) - S) // S - 1)
    with pytest.raises(RecordingError, match=rf"set forward by 19676 days, after image 30 of 60.*--end 3 .*{start}"):
        build(path)
    inspected = supermap("inspect", str(path))
    assert inspected.exit_code == 1
    assert "set forward by 19676 days" in " ".join(inspected.output.split())
    build(path, "--end", "3")
    build(path, "--start", start)
    assert [each.clock_shift_ns for each in traversals()] == [0, 0]


def test_stamps_alone_that_go_forward_by_days_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"set forward by 3 days.*cut the recording there"):
        build(record(tmp_path / "run.mcap", later(3 * 86400, 30)))


def test_a_pause_of_the_recording_is_no_fault(tmp_path: Path) -> None:
    warnings = build(record(tmp_path / "run.mcap", later(3600, 30), later(3600, 30)))
    assert not [each for each in warnings if "clock" in each or "left out" in each]
    assert len(traversals()) == 1
