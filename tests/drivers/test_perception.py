"""However a detector is asked, every frame comes back in its order with its own detections."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from supermap_cli.drivers import perception
from supermap_cli.drivers.perception import Perception
from supermap_cli.errors import DetectorError
from supermap_cli.stages.localization import LocalizationMark, LocatedFrame
from supermap_cli.stages.perception import generate_masks
from supermap_cli.timing import StageClock
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, no_detections
from supermap_cli.types.sensing import CameraFrame
from support import fakes as f
from support import scenes as s


def located(count: int, every: int = 1) -> list[LocatedFrame]:
    """Frames, of every n-th of which the detector is asked."""
    keyframe = s.render(s.ROOM, s.looking((0, 0, 1.5), (2, 0, 0.5)), 0).keyframe
    frame = CameraFrame(0, "camera", keyframe.rgb, keyframe.depth_m, keyframe.camera, np.eye(4))
    mark = LocalizationMark(None, 0)
    return [
        LocatedFrame(replace(frame, stamp_ns=i), replace(keyframe, stamp_ns=i), i % every == 0, None, mark)
        for i in range(count)
    ]


class OneAtATime:
    def image_stamps_ns(self, camera_id: str) -> None:
        return None

    def detect(self, frame: CameraFrame) -> Detections | None:
        return None if frame.stamp_ns % 5 == 4 else no_detections(frame.stamp_ns)


class InBatches(OneAtATime):
    batch_size = 4

    def __init__(self) -> None:
        self.batches: list[int] = []

    def detect_batch(self, frames: Sequence[CameraFrame]) -> Sequence[Detections | None]:
        self.batches.append(len(frames))
        return [self.detect(frame) for frame in frames]


@dataclass
class Later(OneAtATime):
    """Answers the last image first, as soon as it has been asked three times for results."""

    asked: list[CameraFrame] = field(default_factory=list)
    calls: int = 0
    most_open: int = 0

    def submit(self, frame: CameraFrame) -> None:
        self.asked.append(frame)
        self.most_open = max(self.most_open, len(self.asked))

    def results(self, timeout_s: float) -> Sequence[tuple[CameraFrame, Detections | None]]:
        self.calls += 1
        if self.calls % 3 and timeout_s == 0:
            return []
        answered, self.asked = self.asked[::-1], []
        return [(frame, self.detect(frame)) for frame in answered]


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("make", [OneAtATime, InBatches, Later])
def test_frames_keep_their_order_and_their_detections(make: type[OneAtATime], every: int) -> None:
    frames = located(23, every)
    perceived = list(Perception(make(), f.FakeSegmenter(), StageClock()).perceive(frames))
    assert [one.frame.stamp_ns for one, _ in perceived] == list(range(23))
    answers = {one.frame.stamp_ns: None if found is None else found.stamp_ns for one, found in perceived}
    assert answers == {i: i if i % every == 0 and i % 5 != 4 else None for i in range(23)}


def test_a_batch_is_as_large_as_the_detector_wants() -> None:
    detector = InBatches()
    list(Perception(detector, f.FakeSegmenter(), StageClock()).perceive(located(10)))
    assert detector.batches == [4, 4, 2]


def test_no_more_images_are_open_than_allowed() -> None:
    detector = Later(calls=1)
    detector.results = lambda timeout_s: Later.results(detector, timeout_s) if timeout_s else []  # type: ignore[method-assign]
    list(Perception(detector, f.FakeSegmenter(), StageClock()).perceive(located(60)))
    assert detector.most_open == perception.MAX_DEFERRED + 1


def test_an_image_whose_answer_is_lost_goes_without(monkeypatch: pytest.MonkeyPatch) -> None:
    detector = Later()
    monkeypatch.setattr(perception, "DEFERRED_TIMEOUT_S", 0.01)
    detector.results = lambda timeout_s: [  # type: ignore[method-assign]
        answer for answer in Later.results(detector, timeout_s) if answer[0].stamp_ns != 3
    ]
    perceived = list(Perception(detector, f.FakeSegmenter(), StageClock()).perceive(located(12)))
    assert [one.frame.stamp_ns for one, found in perceived if found is None] == [3, 4, 9]


def test_few_images_are_held_where_the_detector_is_seldom_asked() -> None:
    detector, given = InBatches(), 0

    def frames() -> Iterator[LocatedFrame]:
        nonlocal given
        for one in located(200, every=50):
            given += 1
            yield one

    held = 0
    for taken, _ in enumerate(Perception(detector, f.FakeSegmenter(), StageClock()).perceive(frames())):
        held = max(held, given - taken)
    assert held <= perception.MAX_WAITING


def test_a_mask_beyond_the_image_is_an_error() -> None:
    (one,) = located(1)
    beyond = RegionMask(one.frame.camera.width - 2, 0, np.ones((4, 4), bool))
    box = np.array([[0, 0, 4, 4]], np.float32)
    found = Detections(0, box, np.ones(1, np.float32), ((Hypothesis("cup", 1.0),),), (beyond,))
    with pytest.raises(DetectorError, match="reaches beyond the image"):
        generate_masks(None, one.frame, found)


def test_a_detector_that_answers_nothing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    detector = Later()
    monkeypatch.setattr(perception, "DEFERRED_TIMEOUT_S", 0.01)
    detector.results = lambda timeout_s: []  # type: ignore[method-assign]
    with pytest.raises(DetectorError, match=r"has not answered for 0\.03 s"):
        list(Perception(detector, f.FakeSegmenter(), StageClock()).perceive(located(3)))
