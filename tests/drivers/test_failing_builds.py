"""A build that comes to nothing says why and leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from supermap_cli.errors import (
    ConfigError,
    DetectorError,
    OdometryError,
    RecordingError,
    SupermapError,
)
from supermap_cli.memory import MapStore, open_store
from support import databases
from support import fakes as f
from support import scenes as s
from support.fake_builds import DAY_S, KITCHEN, build, monday


def without_poses(recording: f.FakeRecording) -> Iterator[object]:
    return iter(())


def lost_odometry(recording: f.FakeRecording) -> Iterator[object]:
    yield next(recording.poses())
    raise OdometryError("the odometry is lost")


class BrokenDetectorError(Exception):
    """A bug in a plugin."""


class BrokenDetector(f.FakeDetector):
    def detect(self, frame: object) -> None:
        if len(self.recording.decoded) > 30 + 4:
            raise BrokenDetectorError


FAILURES = [
    pytest.param(monday, {"poses": without_poses}, OdometryError, id="no poses"),
    pytest.param(monday, {"poses": lost_odometry}, OdometryError, id="lost odometry"),
    pytest.param(lambda: f.FakeRecording(()), {}, RecordingError, id="no images"),
    pytest.param(
        monday, {"detector": lambda recording: f.FakeDetector(recording, blind=True)}, DetectorError, id="no detections"
    ),
    pytest.param(
        lambda: f.FakeRecording(f.film(KITCHEN, 2)), {}, RecordingError, id="too few images to confirm anything"
    ),
    pytest.param(
        lambda: f.FakeRecording(f.film((s.CHAIR.at(9, 0),))),
        {},
        SupermapError,
        id="everything out of range",
    ),
]


@pytest.mark.parametrize(("recording", "given", "error"), FAILURES)
def test_a_build_that_comes_to_nothing_says_why_and_leaves_no_database(
    tmp_path: Path, recording: object, given: dict[str, object], error: type[SupermapError]
) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store, pytest.raises(error) as raised:
        build(store, recording(), f.FakePlugins(**given))  # type: ignore[operator, arg-type]
    assert raised.value.cure or "lost" in str(raised.value)
    assert "\n" not in str(raised.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("recording", "given", "error"), FAILURES)
def test_a_build_that_comes_to_nothing_leaves_an_existing_database_as_it_was(
    tmp_path: Path, recording: object, given: dict[str, object], error: type[SupermapError]
) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        build(
            store,
            f.FakeRecording(
                f.film((*s.ROOM, s.BOX.at(-1.6, 0)), start_s=-DAY_S, target=(-1.6, 0, 0.4)), Path("sunday.fake")
            ),
        )
    before = databases.contents(path)
    with open_store(str(path)) as store, pytest.raises(error):
        build(store, recording(), f.FakePlugins(**given))  # type: ignore[operator, arg-type]
    assert databases.contents(path) == before


def test_a_bug_in_a_plugin_shows_itself_and_leaves_nothing(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store, pytest.raises(BrokenDetectorError):
        build(
            store,
            f.FakeRecording(f.film(KITCHEN, 60, rate_hz=10)),
            f.FakePlugins(detector=BrokenDetector),
            f.config(keyframes={"batch": 2, "rate_hz": 10}),
        )
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_option_is_found_before_anything_is_read(store: MapStore, tmp_path: Path) -> None:
    recording = monday()
    with pytest.raises(ConfigError, match="score"):
        build(store, recording, config=f.config(backends={"options": {"fake": {"speed": 1}}}))
    with pytest.raises(ConfigError, match="nobody"):
        build(store, recording, config=f.config(backends={"options": {"nobody": {"speed": 1}}}))
    assert recording.decoded == []


def test_images_without_a_pose_are_left_out_with_a_warning(store: MapStore) -> None:
    def half_of_them(recording: f.FakeRecording) -> Iterator[object]:
        poses = list(recording.poses())
        return iter(poses[: len(poses) // 2])

    summary = build(store, f.FakeRecording(f.film(KITCHEN, 20)), f.FakePlugins(poses=half_of_them))  # type: ignore[arg-type]
    assert (summary.statistics.keyframes, summary.statistics.without_pose) == (5, 5)
    assert any("5 images had no pose" in warning for warning in summary.warnings)
