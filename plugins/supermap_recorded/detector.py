"""Answers for an image with the detections that were recorded for it."""

from __future__ import annotations

from collections.abc import Iterator

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.protocols import Recording
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame


class RecordedDetector:
    """A detector whose answers stand in the recording (design: `vision_msgs/msg/Detection2DArray`).

    Images are asked for in the order of time, so the recorded stream is read along with them and one array is held; an
    image before the last one asked for starts the stream anew.
    """

    def __init__(self, recording: Recording, score_floor: float = 0.0) -> None:
        if "detections" not in recording.streams:
            raise DetectorError(
                "the recording holds no detections",
                where=str(recording.path),
                cure="name their topic with --topic detections=/name, or detect with --detector onnx",
            )
        self._recording = recording
        self._score_floor = score_floor
        self._stamps_ns = recording.detection_stamps_ns()
        self._known_stamps_ns = frozenset(self._stamps_ns.tolist())
        self._stream: Iterator[Detections] = iter(())
        self._ahead: Detections | None = None
        self._asked_ns: int | None = None

    def image_stamps_ns(self) -> IntArray:
        """The stamps of the images that detections were recorded for."""
        return self._stamps_ns

    def detect(self, frame: CameraFrame) -> Detections | None:
        """What was recorded for exactly this image; `None` where nothing was, not even that there is nothing."""
        if frame.stamp_ns not in self._known_stamps_ns:
            return None
        if self._asked_ns is None or frame.stamp_ns < self._asked_ns:
            self._stream = self._recording.detections()
            self._ahead = next(self._stream, None)
        self._asked_ns = frame.stamp_ns
        while self._ahead is not None and self._ahead.stamp_ns < frame.stamp_ns:
            self._ahead = next(self._stream, None)
        if self._ahead is None or self._ahead.stamp_ns != frame.stamp_ns:
            return None
        return self._ahead.take(self._ahead.scores >= self._score_floor)
