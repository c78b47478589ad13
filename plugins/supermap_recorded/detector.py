"""Answers for an image with the detections that were recorded for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.input_files import read_class_names
from supermap_cli.protocols import Recording
from supermap_cli.types.detections import Detections, Hypothesis
from supermap_cli.types.sensing import CameraFrame

_NUMBER_DIGITS = 6
"""Digits of a class number at most; the largest label sets have some 20,000 classes."""

_NAMED_NUMBERS = 5
"""Numbers that a warning lists."""


@dataclass
class _RecordedStream:
    """The recorded detections of one camera, read along with its images."""

    stamps_ns: IntArray
    known_ns: frozenset[int]
    remaining: Iterator[Detections] = field(default_factory=lambda: iter(()))
    ahead: Detections | None = None
    asked_ns: int | None = None


class RecordedDetector:
    """A detector whose answers stand in the recording (`vision_msgs/msg/Detection2DArray`).

    The images of a camera are asked for in the order of time, so its recorded stream is read along with them and one
    array is held; an image before the last one asked for starts the stream anew.
    """

    def __init__(self, recording: Recording, score_floor: float = 0.0, labels: Path | None = None) -> None:
        if "detections" not in recording.streams:
            raise DetectorError(
                "the recording holds no detections",
                where=str(recording.path),
                cure="name their topic with --topic detections=/name, or detect with --detector onnx",
            )
        self._recording = recording
        self._score_floor = score_floor
        self._labels = labels
        self._names = () if labels is None else read_class_names(labels, DetectorError, option="recorded.labels")
        self._unnamed: set[str] = set()
        self._streams: dict[str, _RecordedStream] = {}

    def image_stamps_ns(self, camera_id: str) -> IntArray:
        """The stamps of the images that detections were recorded for."""
        return self._stream(camera_id).stamps_ns

    def detect(self, frame: CameraFrame) -> Detections | None:
        """What was recorded for exactly this image; `None` where nothing was, not even that there is nothing."""
        stream = self._stream(frame.camera_id)
        if frame.stamp_ns not in stream.known_ns:
            return None
        if stream.asked_ns is None or frame.stamp_ns < stream.asked_ns:
            stream.remaining = self._recording.detections(frame.camera_id)
            stream.ahead = next(stream.remaining, None)
        stream.asked_ns = frame.stamp_ns
        while stream.ahead is not None and stream.ahead.stamp_ns < frame.stamp_ns:
            stream.ahead = next(stream.remaining, None)
        if stream.ahead is None or stream.ahead.stamp_ns != frame.stamp_ns:
            return None
        return self._named(stream.ahead.take(stream.ahead.scores >= self._score_floor))

    @property
    def warnings(self) -> tuple[str, ...]:
        """That labels are numbers without a name, once there was one."""
        if not self._unnamed:
            return ()
        numbers = ", ".join(sorted(self._unnamed, key=int)[:_NAMED_NUMBERS])
        cure = (
            "say --option recorded.labels=FILE with the detector's class names, one a line"
            if self._labels is None
            else f"{self._labels} names {len(self._names)} classes"
        )
        where = self._recording.path
        return (f"{where}: recorded detections are labelled with numbers ({numbers}) and stay without a name: {cure}",)

    def _named(self, detections: Detections) -> Detections:
        """The detections with names in place of class numbers, as far as there are any."""
        if not any(each.label.isdecimal() for ranked in detections.hypotheses for each in ranked):
            return detections
        named = tuple(tuple(self._name(each) for each in ranked) for ranked in detections.hypotheses)
        return replace(detections, hypotheses=named)

    def _name(self, hypothesis: Hypothesis) -> Hypothesis:
        if not (hypothesis.label.isdecimal() and hypothesis.label.isascii()):
            return hypothesis
        if len(hypothesis.label) <= _NUMBER_DIGITS and (number := int(hypothesis.label)) < len(self._names):
            return replace(hypothesis, label=self._names[number])
        self._unnamed.add(hypothesis.label[:_NUMBER_DIGITS])
        return hypothesis

    def _stream(self, camera_id: str) -> _RecordedStream:
        if camera_id not in self._streams:
            stamps_ns = self._recording.detection_stamps_ns(camera_id)
            self._streams[camera_id] = _RecordedStream(stamps_ns, frozenset(stamps_ns.tolist()))
        return self._streams[camera_id]
