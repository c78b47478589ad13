"""Builds of recordings with several cameras: every camera has its keyframes, in the order of stamps."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.checking import check
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame
from support import databases
from support import fakes as f
from support import scenes as s
from support.fake_builds import KITCHEN, build


def two_cameras(images: int = 12) -> f.FakeRecording:
    return f.FakeRecording(f.film(KITCHEN, images), cameras=("front", "left"))


def test_every_camera_is_mapped_at_its_rate_and_in_the_order_of_stamps(store: MapStore) -> None:
    summary = build(store, two_cameras())
    stored = [(record.stamp_ns, record.camera_id) for record in store.keyframe_depths()]
    assert stored == [(s.ns(i / 3), camera_id) for i in range(6) for camera_id in ("front", "left")]
    assert summary.statistics.keyframes == summary.statistics.perceived == 12
    assert summary.statistics.labels == {"cup": 1, "dining table": 1}
    with store.reader() as reader:
        assert check(reader) == []


def test_the_rate_of_all_cameras_together_is_bounded(store: MapStore) -> None:
    summary = build(store, two_cameras(), config=f.config(keyframes={"rate_hz": 6, "total_rate_hz": 6}))
    assert summary.statistics.keyframes == 12


class FailingDetector(f.FakeDetector):
    """Fails at its n-th image."""

    left = 15

    def detect(self, frame: CameraFrame) -> Detections | None:
        FailingDetector.left -= 1
        if FailingDetector.left == 0:
            raise DetectorError("no power", cure="plug it in")
        return super().detect(frame)


SMALL_BATCHES = f.config(keyframes={"batch": 3, "checkpoint_s": 0, "rate_hz": 6})


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("undisturbed") / "map.db"
    with open_store(str(path), create=True) as store:
        build(store, two_cameras(), f.FakePlugins(tracker=f.ResumableTracker), SMALL_BATCHES)
    return path


@pytest.mark.parametrize("images_before", [5, 8, 15])
def test_a_build_of_several_cameras_goes_on_between_images_of_one_moment(
    undisturbed: Path, tmp_path: Path, images_before: int
) -> None:
    """Whatever a batch ends with, the memory is that of an undisturbed build."""
    stopped = tmp_path / "stopped.db"
    FailingDetector.left = images_before
    failing = f.FakePlugins(tracker=f.ResumableTracker, detector=FailingDetector)
    with open_store(str(stopped), create=True) as store:
        with pytest.raises(DetectorError):
            build(store, two_cameras(), failing, SMALL_BATCHES)
        before = [record.stamp_ns for record in store.keyframe_depths()]
        log = f.ObserverLog()
        sound = f.FakePlugins(tracker=f.ResumableTracker, observer=log)
        build(store, two_cameras(), sound, SMALL_BATCHES, unfinished="resume")
    assert databases.contents(stopped, but=("traversal",)) == databases.contents(undisturbed, but=("traversal",))
    told = [stamp_ns for stamp_ns, _ in log.mapped_keyframes if stamp_ns is not None]
    assert len(before) + len(told) == 24
