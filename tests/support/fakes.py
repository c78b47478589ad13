"""A recording that is rendered instead of read, and plugins that know all about it."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pydantic import Field

from supermap_cli.config import BuildConfig
from supermap_cli.errors import OdometryError
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.hookspecs import Options, RecordingRequest, Register, hookimpl
from supermap_cli.plugin_manager import Plugins, load_plugins
from supermap_cli.protocols import Observer, Recording, SensorMessage, Tracker
from supermap_cli.recordings.fingerprint import window_fingerprint
from supermap_cli.types.detections import Detections, RegionMask, TrackPrior, Tracks
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.relations import SpatialPredicate
from supermap_cli.types.sensing import MAIN_CAMERA, CameraFrame, ImuSample, StampedPose, Sweep
from supermap_cli.types.session import SessionContext, SessionSummary
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
    cameras: tuple[str, ...] = (MAIN_CAMERA,)
    decoded: list[int] = field(default_factory=list)

    def messages(self) -> Iterator[SensorMessage]:
        return heapq.merge(self.poses(), self.frames(), self.detections(), key=lambda message: message.stamp_ns)

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

    def frame_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        return np.array([scene.keyframe.stamp_ns for scene in self.scenes], np.int64)

    def frames(
        self, selected: Callable[[int], bool] | None = None, camera_id: str | None = None
    ) -> Iterator[CameraFrame]:
        for scene in self.scenes:
            frame = scene.keyframe
            if selected is None or selected(frame.stamp_ns):
                self.decoded.append(frame.stamp_ns)
                made = CameraFrame(frame.stamp_ns, "camera", frame.rgb, frame.depth_m, frame.camera, T_BASE_CAMERA)
                yield replace(made, camera_id=camera_id or self.cameras[0])

    def poses(self) -> Iterator[StampedPose]:
        for scene in self.scenes:
            yield StampedPose(scene.keyframe.stamp_ns, scene.keyframe.T_map_camera @ inverse(T_BASE_CAMERA))

    def sweeps(self) -> Iterator[Sweep]:
        return iter(())

    def imu(self) -> Iterator[ImuSample]:
        return iter(())

    def detection_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        return np.array([detections.stamp_ns for detections in self.recorded], np.int64)

    def detections(self, camera_id: str | None = None) -> Iterator[Detections]:
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

    def image_stamps_ns(self, camera_id: str) -> IntArray | None:
        return self.only_ns

    def detect(self, frame: CameraFrame) -> Detections | None:
        scene = next(scene for scene in self.recording.scenes if scene.keyframe.stamp_ns == frame.stamp_ns)
        at_s = (frame.stamp_ns - s.EPOCH_NS) / 1e9
        things = {thing.label for thing in scene.things}
        found = s.detect(scene, at_s, score=self.score, blind_to=things if self.blind else ())
        found = replace(found, camera_id=frame.camera_id)
        return found.with_masks((None,) * len(found)) if self.without_masks else found


class FakeOdometry:
    """Knows all poses of a recording, whatever it is told; gives them by and by."""

    inputs = frozenset({"poses"})

    def __init__(self, poses: Callable[[], Iterator[StampedPose]], warnings: Sequence[str] = ()) -> None:
        self.warnings = list(warnings)
        self._poses = poses()
        self._given = 0

    def add_imu(self, sample: ImuSample) -> None:
        pass

    def register_pose(self, pose: StampedPose) -> StampedPose | None:
        given = next(self._poses, None)
        self._given += given is not None
        return given

    def register_sweep(self, sweep: Sweep) -> StampedPose | None:
        return None

    def register_frame(self, frame: CameraFrame) -> StampedPose | None:
        return None

    def finish(self) -> None:
        if not self._given:
            raise OdometryError("no usable pose in the recording", cure="record poses")


@dataclass
class ObserverLog:
    """An observer that keeps what it is told; a `failing` one does not get far."""

    failing: bool = False
    contexts: list[SessionContext] = field(default_factory=list)
    mapped_keyframes: list[tuple[int | None, MapDelta]] = field(default_factory=list)
    batches: list[MapDelta] = field(default_factory=list)
    summaries: list[SessionSummary] = field(default_factory=list)
    frames: int = 0
    perceptions: int = 0

    def started(self, context: SessionContext) -> None:
        self.contexts.append(context)

    def frame(self, frame: CameraFrame, T_map_base: FloatArray, sweep: Sweep | None) -> None:
        assert T_map_base.shape == (4, 4)
        self.frames += 1

    def perceived(
        self, keyframe: Keyframe, detections: Detections, masks: Sequence[RegionMask | None], tracks: Tracks
    ) -> None:
        assert len(detections) == len(masks) == len(tracks.track_ids)
        self.perceptions += 1

    def mapped(self, keyframe: KeyframeRecord | None, delta: MapDelta) -> None:
        if self.failing:
            raise ZeroDivisionError
        self.mapped_keyframes.append((None if keyframe is None else keyframe.stamp_ns, delta))

    def committed(self, batch: MapDelta) -> None:
        self.batches.append(batch)

    def ended(self, summary: SessionSummary) -> None:
        self.summaries.append(summary)


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


class ResumableTracker(FakeTracker):
    """Counts its images as tracks, and goes on counting where a build that was stopped had been."""

    def __init__(self) -> None:
        self.images = 0

    def update(self, detections: Detections, priors: Sequence[TrackPrior], image_size: tuple[int, int]) -> Tracks:
        self.images += 1
        return Tracks(np.full(len(detections), self.images))

    def state(self) -> object:
        return self.images

    def resume(self, state: object) -> None:
        assert isinstance(state, int)
        self.images = state


@dataclass
class FakePlugins:
    """What the fake plugin offers; `observer` follows each session."""

    recordings: Mapping[str, FakeRecording] = field(default_factory=dict)
    predicates: Sequence[SpatialPredicate] = ()
    poses: Callable[[FakeRecording], Iterator[StampedPose]] = FakeRecording.poses
    detector: Callable[[FakeRecording], FakeDetector] = FakeDetector
    tracker: Callable[[], Tracker] = FakeTracker
    odometry_warnings: Sequence[str] = ()
    observer: Observer | None = None
    requests: list[RecordingRequest] = field(default_factory=list)

    def load(self) -> Plugins:
        """All installed plugins and this one."""
        return load_plugins([self.plugin_object()])

    def plugin_object(self) -> object:
        """What implements the hooks."""
        return SimpleNamespace(**{name: hookimpl(hook) for name, hook in self._hooks().items()})

    def _hooks(self) -> dict[str, Callable[..., object]]:
        def register_odometry(register: Register) -> None:
            register(
                "fake",
                lambda _, recording: FakeOdometry(lambda: self.poses(recording), self.odometry_warnings),
                preference=99,
            )

        def register_detectors(register: Register) -> None:
            register("fake", self._make_detector, FakeOptions, preference=99)

        def register_segmenters(register: Register) -> None:
            register("fake", lambda _, recording: FakeSegmenter(), preference=99)

        def register_trackers(register: Register) -> None:
            register("fake", lambda _, recording: self.tracker(), preference=99)

        def spatial_predicates() -> Sequence[SpatialPredicate]:
            return list(self.predicates)

        def observe_session(context: SessionContext) -> Observer | None:
            return self.observer

        def open_recording(path: Path, request: RecordingRequest) -> Recording | None:
            self.requests.append(request)
            return self.recordings.get(path.name)

        hooks: list[Callable[..., object]] = [
            register_odometry,
            register_detectors,
            register_segmenters,
            register_trackers,
            spatial_predicates,
            observe_session,
            open_recording,
        ]
        return {hook.__name__: hook for hook in hooks}

    def _make_odometry(self, _: Options, recording: FakeRecording) -> FakeOdometry:
        return FakeOdometry(lambda: self.poses(recording), self.odometry_warnings)

    def _make_detector(self, options: FakeOptions, recording: FakeRecording) -> FakeDetector:
        detector = self.detector(recording)
        detector.score = options.score
        return detector


def config(**sections: Mapping[str, object]) -> BuildConfig:
    """The default configuration with some of it changed."""
    return BuildConfig.model_validate(sections)
