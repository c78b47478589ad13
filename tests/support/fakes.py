"""A recording that is rendered instead of read, and plugins that know all about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pydantic import Field

from supermap_cli.config import BuildConfig
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.hookspecs import Options, RecordingRequest, Register, hookimpl
from supermap_cli.plugin_manager import Plugins, load_plugins
from supermap_cli.protocols import Recording
from supermap_cli.recordings.fingerprint import window_fingerprint
from supermap_cli.types.detections import Detections, RegionMask, TrackPrior, Tracks
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.relations import SpatialPredicate
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep
from support import scenes as s

T_BASE_CAMERA = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
"""A camera that looks along the base's x axis."""


@cache
def film(
    things: tuple[s.Thing, ...],
    images: int = 12,
    *,
    start_s: float = 0.0,
    rate_hz: float = 6.0,
    target: s.Point = (1.6, 0, 0.4),
) -> tuple[s.Scene, ...]:
    """Images of a world from an arc of viewpoints, 1.7 m up."""
    return tuple(
        s.render(things, s.looking((0.0, float(y), 1.7), target), start_s + i / rate_hz)
        for i, y in enumerate(np.linspace(-0.5, 0.5, images))
    )


@dataclass
class FakeRecording:
    """A `Recording` over rendered scenes; `decoded` counts the images that were asked for."""

    scenes: Sequence[s.Scene]
    path: Path = Path("monday.fake")
    streams: frozenset[str] = frozenset({"color", "depth", "poses"})
    base_frame: str = "base_link"
    warnings: Sequence[str] = ()
    recorded: Sequence[Detections] = ()
    decoded: list[int] = field(default_factory=list)

    @property
    def start_ns(self) -> int:
        return self.scenes[0].keyframe.stamp_ns if self.scenes else s.ns(0)

    @property
    def end_ns(self) -> int:
        return self.scenes[-1].keyframe.stamp_ns if self.scenes else s.ns(0)

    def fingerprint(self) -> str:
        return window_fingerprint(self.content_fingerprint(), self.start_ns, self.end_ns)

    def content_fingerprint(self) -> str:
        return f"{self.path.name}, {len(self.scenes)} images from {self.start_ns}"

    def frame_stamps_ns(self) -> IntArray:
        return np.array([each.keyframe.stamp_ns for each in self.scenes], np.int64)

    def frames(self, selected: Callable[[int], bool] | None = None) -> Iterator[CameraFrame]:
        for each in self.scenes:
            frame = each.keyframe
            if selected is None or selected(frame.stamp_ns):
                self.decoded.append(frame.stamp_ns)
                yield CameraFrame(frame.stamp_ns, "camera", frame.rgb, frame.depth_m, frame.camera, T_BASE_CAMERA)

    def poses(self) -> Iterator[StampedPose]:
        for each in self.scenes:
            yield StampedPose(each.keyframe.stamp_ns, each.keyframe.T_map_camera @ inverse(T_BASE_CAMERA))

    def sweeps(self) -> Iterator[Sweep]:
        return iter(())

    def imu(self) -> Iterator[ImuSample]:
        return iter(())

    def detection_stamps_ns(self) -> IntArray:
        return np.array([each.stamp_ns for each in self.recorded], np.int64)

    def detections(self) -> Iterator[Detections]:
        return iter(self.recorded)


class FakeOptions(Options):
    """Options of the fake detector."""

    score: float = Field(default=0.8, ge=0, le=1, description="what it says of everything")


@dataclass
class FakeDetector:
    """Finds everything there is in the images of a recording, or only looks at some of them."""

    recording: FakeRecording
    score: float = 0.8
    only_ns: IntArray | None = None
    blind: bool = False
    without_masks: bool = False

    def image_stamps_ns(self) -> IntArray | None:
        return self.only_ns

    def detect(self, frame: CameraFrame) -> Detections | None:
        scene = next(each for each in self.recording.scenes if each.keyframe.stamp_ns == frame.stamp_ns)
        at_s = (frame.stamp_ns - s.EPOCH_NS) / 1e9
        things = {each.label for each in scene.things}
        found = s.detect(scene, at_s, score=self.score, blind_to=things if self.blind else ())
        return found.with_masks((None,) * len(found)) if self.without_masks else found


class FakeSegmenter:
    """Fills boxes."""

    def segment(self, frame: CameraFrame, detections: Detections) -> tuple[RegionMask | None, ...]:
        masks: list[RegionMask | None] = []
        for box, mask in zip(detections.boxes_xyxy.astype(int), detections.masks, strict=True):
            filled = RegionMask(box[0], box[1], np.ones((box[3] - box[1] + 1, box[2] - box[0] + 1), bool))
            masks.append(filled if mask is None else mask)
        return tuple(masks)


class FakeTracker:
    """Tracks nothing."""

    def update(self, detections: Detections, priors: Sequence[TrackPrior], image_size: tuple[int, int]) -> Tracks:
        return Tracks(np.full(len(detections), -1))


@dataclass
class FakePlugins:
    """What the fake plugin offers; `mapped` collects what its `keyframe_mapped` was told."""

    recordings: Mapping[str, FakeRecording] = field(default_factory=dict)
    predicates: Sequence[SpatialPredicate] = ()
    poses: Callable[[FakeRecording], Iterator[StampedPose]] = FakeRecording.poses
    detector: Callable[[FakeRecording], FakeDetector] = FakeDetector
    on_keyframe: Callable[[KeyframeRecord, MapDelta], None] = lambda keyframe, changes: None
    requests: list[RecordingRequest] = field(default_factory=list)

    def load(self) -> Plugins:
        """All installed plugins and this one."""
        return load_plugins([SimpleNamespace(**{name: hookimpl(hook) for name, hook in self._hooks().items()})])

    def _hooks(self) -> dict[str, Callable[..., object]]:
        def register_odometry(register: Register) -> None:
            register("fake", lambda _, recording: SimpleNamespace(poses=lambda: self.poses(recording)), preference=99)

        def register_detectors(register: Register) -> None:
            register("fake", self._make_detector, FakeOptions, preference=99)

        def register_segmenters(register: Register) -> None:
            register("fake", lambda _, recording: FakeSegmenter(), preference=99)

        def register_trackers(register: Register) -> None:
            register("fake", lambda _, recording: FakeTracker(), preference=99)

        def spatial_predicates() -> Sequence[SpatialPredicate]:
            return list(self.predicates)

        def keyframe_mapped(keyframe: KeyframeRecord, changes: MapDelta) -> None:
            self.on_keyframe(keyframe, changes)

        def open_recording(path: Path, request: RecordingRequest) -> Recording | None:
            self.requests.append(request)
            return self.recordings.get(path.name)

        hooks: list[Callable[..., object]] = [
            register_odometry,
            register_detectors,
            register_segmenters,
            register_trackers,
            spatial_predicates,
            keyframe_mapped,
            open_recording,
        ]
        return {hook.__name__: hook for hook in hooks}

    def _make_detector(self, options: FakeOptions, recording: FakeRecording) -> FakeDetector:
        detector = self.detector(recording)
        detector.score = options.score
        return detector


def config(**sections: Mapping[str, object]) -> BuildConfig:
    """The default configuration with some of it changed."""
    return BuildConfig.model_validate(sections)
