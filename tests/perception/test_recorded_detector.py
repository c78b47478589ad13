"""The detector `recorded`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.types.detections import Detections, Hypothesis
from supermap_cli.types.sensing import MAIN_CAMERA
from supermap_recorded.detector import RecordedDetector
from support.frames import frame


def recorded(stamp_ns: int, *scores: float) -> Detections:
    n = len(scores)
    return Detections(
        stamp_ns,
        np.zeros((n, 4), np.float32),
        np.array(scores, np.float32),
        ((Hypothesis("cup", 0.5),),) * n,
        (None,) * n,
    )


@dataclass
class FakeRecording:
    """As much of a recording as the detector looks at."""

    arrays: Sequence[Detections]
    streams: frozenset[str] = frozenset({"detections"})
    path: Path = Path("run.mcap")
    passes: list[int] = field(default_factory=list)

    def detection_stamps_ns(self, camera_id: str) -> IntArray:
        return np.array([array.stamp_ns for array in self.arrays], np.int64)

    def detections(self, camera_id: str) -> Iterator[Detections]:
        self.passes.append(1)
        return iter(self.arrays)


def detector(recording: FakeRecording, score_floor: float = 0.0) -> RecordedDetector:
    return RecordedDetector(recording, score_floor)  # type: ignore[arg-type]  # a part of one is enough


def test_a_recording_without_detections_is_refused_with_a_cure() -> None:
    with pytest.raises(DetectorError, match=r"holds no detections \(run.mcap\): .*--detector onnx"):
        detector(FakeRecording((), frozenset({"color"})))


def test_each_image_gets_its_own_detections_in_one_pass() -> None:
    recording = FakeRecording([recorded(1, 0.5), recorded(3), recorded(5, 0.9, 0.8)])
    recorded_detector = detector(recording)
    answers = [recorded_detector.detect(frame(stamp_ns=stamp)) for stamp in (1, 2, 3, 5)]
    assert [None if answer is None else len(answer) for answer in answers] == [1, None, 0, 2]
    assert len(recording.passes) == 1
    assert recorded_detector.image_stamps_ns(MAIN_CAMERA).tolist() == [1, 3, 5]


def test_images_may_be_skipped_repeated_and_asked_for_anew() -> None:
    recorded_detector = detector(FakeRecording([recorded(1, 0.5), recorded(3), recorded(5, 0.9, 0.8)]))
    answers = [recorded_detector.detect(frame(stamp_ns=stamp)) for stamp in (5, 5, 1, 3)]
    assert [None if answer is None else len(answer) for answer in answers] == [2, 2, 1, 0]


def test_low_scores_are_left_out() -> None:
    answer = detector(FakeRecording([recorded(1, 0.2, 0.6)]), 0.5).detect(frame(stamp_ns=1))
    assert answer is not None
    assert answer.scores.tolist() == pytest.approx([0.6])
