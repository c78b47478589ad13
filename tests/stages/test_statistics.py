"""What is said where a build ends empty."""

from __future__ import annotations

import pytest

from supermap_cli.errors import DetectorError, RecordingError
from supermap_cli.stages.statistics import BuildStatistics


def test_an_empty_place_is_a_map_where_the_recording_says_so() -> None:
    empty = BuildStatistics(frames=40, keyframes=30, perceived=30)
    warning = empty.check_not_empty("run.mcap", "recorded", first_visit=True, detections_recorded=True)
    assert warning is not None
    assert "0 objects (40 images, 30 mapped with a pose, 30 looked at by the detector, 0 detections" in warning


def test_stray_detections_leave_it_empty() -> None:
    stray = BuildStatistics(frames=40, keyframes=30, perceived=30, detections=3, masks=3, lifted=2, tentative=2)
    assert stray.check_not_empty("run.mcap", "onnx", first_visit=True) is not None


@pytest.mark.parametrize(
    ("statistics", "given", "error", "held_back"),
    [
        (BuildStatistics(30, 0, 30, 30), {"first_visit": True}, DetectorError, "found nothing in 30 images"),
        (BuildStatistics(30, 0, 30, 30), {"detections_recorded": True}, DetectorError, "found nothing"),
        (BuildStatistics(30, 0, 30, 30, 60), {"first_visit": True}, RecordingError, "no detection got a mask"),
        (BuildStatistics(30, 0, 30, 30, 60, 60), {"first_visit": True}, RecordingError, "met no depth"),
        (BuildStatistics(30, 0, 30, 30, 60, 60, 60, 5), {"first_visit": True}, RecordingError, "too few views agreed"),
        (BuildStatistics(30, 0, 30, 0), {"first_visit": True, "lost_results": 30}, RecordingError, "never came"),
    ],
)
def test_what_else_is_empty_is_loud(
    statistics: BuildStatistics, given: dict[str, bool], error: type[Exception], held_back: str
) -> None:
    with pytest.raises(error, match=held_back):
        statistics.check_not_empty("run.mcap", "onnx", **given)  # type: ignore[arg-type]
