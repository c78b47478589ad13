"""Detections that come late, seldom or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.drivers.build_summary import BuildSummary
from supermap_cli.errors import RecordingError
from supermap_cli.memory import MapStore, open_store
from support import databases
from support import fakes as f
from support import scenes as s
from support.fake_builds import build, monday, tuesday


def two_days(path: Path, perception: dict[str, float]) -> BuildSummary:
    """A cup that moves between two visits, built with a detector that takes its time."""
    config = f.config(keyframes={"rate_hz": 6, "batch": 3}, perception=perception)
    with open_store(str(path), create=True) as store:
        build(store, monday(), config=config)
        return build(store, tuesday(s.TABLE, s.CUP.at(1.4, 0.4)), config=config)


@pytest.fixture(scope="module")
def at_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The map made with detections that come at once."""
    path = tmp_path_factory.mktemp("at_once") / "map.db"
    two_days(path, {})
    return path


@pytest.mark.parametrize("delay_s", [0.3, 2.0])
def test_the_map_does_not_depend_on_how_late_detections_come(at_once: Path, tmp_path: Path, delay_s: float) -> None:
    late = tmp_path / "late.db"
    summary = two_days(late, {"delay_s": delay_s})
    assert summary.warnings == ()
    but = ("traversal", "checksum")  # its configuration differs
    assert databases.contents(late, but=but) == databases.contents(at_once, but=but)


def test_detections_that_come_too_late_are_left_out_with_a_warning(tmp_path: Path) -> None:
    summary = two_days(tmp_path / "map.db", {"delay_s": 0.7, "wait_s": 0.4})
    assert 0 < summary.statistics.perceived < summary.statistics.keyframes == 12
    assert any("detections that came over 0.4 s late" in warning for warning in summary.warnings)


@pytest.mark.parametrize("perception", [{"rate_hz": 3.0}, {"dropped": 0.3}])
def test_with_fewer_detections_depth_tells_what_has_gone(tmp_path: Path, perception: dict[str, float]) -> None:
    summary = two_days(tmp_path / "map.db", perception)
    assert 0 < summary.statistics.perceived < summary.statistics.keyframes == 12
    assert summary.statistics.labels == {"cup": 1, "dining table": 1}
    moves = databases.query(tmp_path / "map.db", "SELECT 1 FROM temporal_edge WHERE kind = 'moved'")
    assert moves == [(1,)]


def test_a_detector_that_never_answers_leaves_nothing_and_says_so(store: MapStore) -> None:
    with pytest.raises(RecordingError, match="no object confirmed"):
        build(store, monday(), config=f.config(perception={"dropped": 1.0}))
