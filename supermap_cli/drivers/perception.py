"""Asks the detector about the frames of a recording: one at a time, several at once, or with answers that come late."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence

from supermap_cli.errors import DetectorError
from supermap_cli.protocols import BatchDetector, DeferredDetector, Detector, Segmenter
from supermap_cli.stages.checked_answers import checked_detections
from supermap_cli.stages.localization import LocatedFrame
from supermap_cli.stages.perception import generate_masks
from supermap_cli.timing import StageClock
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame

Perceived = tuple[LocatedFrame, Detections | None]
"""A frame and what was found in it; `None` where the detector was not asked, or says nothing."""

MAX_DEFERRED = 16
"""Images that a detector which answers later is asked about before its answers are waited for."""

MAX_WAITING = 16
"""Frames held for a batch, those of which the detector is not asked among them (2 MB each at 640 x 480)."""

DEFERRED_TIMEOUT_S, MAX_UNANSWERED = 20.0, 3
"""s; an image whose answer has not come for so long goes without; after so many in a row the detector is gone."""


class Perception:
    """Detector and segmenter; frames come back in their order."""

    def __init__(self, detector: Detector, segmenter: Segmenter, clock: StageClock) -> None:
        self._detector = detector
        self._segmenter = segmenter
        self._clock = clock
        self._unanswered = 0

    def perceive(self, frames: Iterable[LocatedFrame]) -> Iterator[Perceived]:
        """Every frame with what was found in it. Raises `DetectorError` where a detector does not answer."""
        if isinstance(self._detector, DeferredDetector):
            return self._perceive_deferred(frames, self._detector)
        if isinstance(self._detector, BatchDetector):
            return self._perceive_in_batches(frames, self._detector)
        return ((located, self._ask(located)) for located in frames)

    def _ask(self, located: LocatedFrame) -> Detections | None:
        if not located.awaits_detections:
            return None
        with self._clock.stage("detect"):
            detections = self._detector.detect(located.frame)
        return self._with_masks(located.frame, detections)

    def _perceive_in_batches(self, frames: Iterable[LocatedFrame], detector: BatchDetector) -> Iterator[Perceived]:
        waiting: list[LocatedFrame] = []
        for located in frames:
            waiting.append(located)
            asked = sum(frame.awaits_detections for frame in waiting)
            if asked == 0 or asked >= detector.batch_size or len(waiting) >= MAX_WAITING:
                yield from self._ask_batch(waiting, detector)
                waiting = []
        yield from self._ask_batch(waiting, detector)

    def _ask_batch(self, waiting: Sequence[LocatedFrame], detector: BatchDetector) -> Iterator[Perceived]:
        asked = [located.frame for located in waiting if located.awaits_detections]
        with self._clock.stage("detect"):
            given = detector.detect_batch(asked) if asked else ()
        if len(given) != len(asked):
            raise DetectorError(
                f"the detector answered for {len(given)} of {len(asked)} images", cure="report it to its author"
            )
        answers = iter(given)
        for located in waiting:
            detections = next(answers, None) if located.awaits_detections else None
            yield located, self._with_masks(located.frame, detections)

    def _perceive_deferred(self, frames: Iterable[LocatedFrame], detector: DeferredDetector) -> Iterator[Perceived]:
        waiting: deque[LocatedFrame] = deque()
        answers: dict[tuple[str, int], Detections | None] = {}
        for located in frames:
            waiting.append(located)
            if located.awaits_detections:
                detector.submit(located.frame)
            yield from self._answered(waiting, answers, detector, MAX_DEFERRED)
        yield from self._answered(waiting, answers, detector, 0)

    def _answered(
        self,
        waiting: deque[LocatedFrame],
        answers: dict[tuple[str, int], Detections | None],
        detector: DeferredDetector,
        most_waiting: int,
    ) -> Iterator[Perceived]:
        while waiting:
            key = _key(waiting[0].frame)
            if waiting[0].awaits_detections and key not in answers:
                must_wait = len(waiting) > most_waiting
                with self._clock.stage("detect"):
                    results = detector.results(DEFERRED_TIMEOUT_S if must_wait else 0.0)
                self._unanswered = 0 if results else self._unanswered
                answers.update({_key(frame): detections for frame, detections in results})
                if key not in answers and not must_wait:
                    return
                if not results:
                    self._give_up(waiting, answers)
                continue
            located = waiting.popleft()
            yield located, self._with_masks(located.frame, answers.pop(key, None))

    def _give_up(self, waiting: deque[LocatedFrame], answers: dict[tuple[str, int], Detections | None]) -> None:
        """One answer may be lost; with no answer at all to any of several images, the detector is gone."""
        self._unanswered += 1
        if self._unanswered >= MAX_UNANSWERED:
            raise DetectorError(
                f"the detector has not answered for {self._unanswered * DEFERRED_TIMEOUT_S:g} s",
                cure="see whether it still runs",
            )
        answers[_key(waiting[0].frame)] = None

    def _with_masks(self, frame: CameraFrame, answer: object) -> Detections | None:
        detections = checked_detections(answer, self._detector, frame)
        if detections is None:
            return None
        with self._clock.stage("segment"):
            return generate_masks(self._segmenter, frame, detections)


def _key(frame: CameraFrame) -> tuple[str, int]:
    return frame.camera_id, frame.stamp_ns
