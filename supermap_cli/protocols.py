"""What a backend has to be able to do. Plugins fulfil these Protocols; the host calls nothing else on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.types.detections import Detections, RegionMask, TrackPrior, Tracks
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep
from supermap_cli.types.session import SessionContext, SessionSummary

SensorMessage = CameraFrame | Sweep | ImuSample | StampedPose | Detections
"""What a source gives, each with its `stamp_ns` in sensor time."""


@runtime_checkable
class Source(Protocol):
    """Sensors that can be listened to: a robot, a recording, a data set. It may never end.

    Errors: `RecordingError` (or `CalibrationError`) naming file, topic, time and cure.
    """

    @property
    def streams(self) -> frozenset[str]:
        """Which of "color", "depth", "lidar", "imu", "poses", "detections", "masks" there are."""
        ...

    @property
    def cameras(self) -> tuple[str, ...]:
        """The `camera_id` of every camera, the main one first."""
        ...

    @property
    def base_frame(self) -> str:
        """The frame that poses move, as named by the source."""
        ...

    @property
    def warnings(self) -> Sequence[str]:
        """What was corrected or left out so far, one line each."""
        ...

    def messages(self) -> Iterator[SensorMessage]:
        """All streams together, in the order of their stamps as far as they arrive so."""
        ...


@runtime_checkable
class Recording(Source, Protocol):
    """A finite recording opened for reading. Every call of a stream starts it anew, in the order of sensor time, and
    never holds more than a few seconds of it in memory. Streams keep to the window (`start_ns`, `end_ns`) the recording
    was opened with; poses, sweeps and IMU reach a little beyond it.
    """

    @property
    def path(self) -> Path:
        """The file or folder."""
        ...

    @property
    def start_ns(self) -> int:
        """Sensor time of the window's start, or of the first frame if that is earlier."""
        ...

    @property
    def end_ns(self) -> int:
        """Sensor time of the window's end, or of the last frame if that is later."""
        ...

    def fingerprint(self) -> str:
        """Hex digest that is the same for the same recording and window, cheap for large files: the
        `recordings.fingerprint.window_fingerprint` of `content_fingerprint` and the window.
        """
        ...

    def content_fingerprint(self) -> str:
        """Hex digest that is the same for the same recording, whatever the window."""
        ...

    def frame_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        """(n,) int64 stamps of all usable frames of a camera (`None`: the main one), ascending, without decoding any
        image.
        """
        ...

    def frames(
        self, selected: Callable[[int], bool] | None = None, camera_id: str | None = None
    ) -> Iterator[CameraFrame]:
        """Frames of a camera (`None`: the main one) in order; `selected(stamp_ns)` says which are worth decoding (all,
        if not given).
        """
        ...

    def poses(self) -> Iterator[StampedPose]:
        """The recorded odometry, `T_odom_base`. Non-finite poses are left out with a warning."""
        ...

    def sweeps(self) -> Iterator[Sweep]:
        """LiDAR sweeps, points finite, in the LiDAR's frame."""
        ...

    def imu(self) -> Iterator[ImuSample]:
        """IMU samples, in the IMU's frame."""
        ...

    def detection_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        """(n,) int64 stamps of a camera's images that recorded detections belong to (`header.stamp`), ascending."""
        ...

    def detections(self, camera_id: str | None = None) -> Iterator[Detections]:
        """Recorded detections of a camera with their masks, in the order of their images' stamps."""
        ...


class Odometry(Protocol):
    """Makes poses of what sensors say, which is pushed in the order of sensor time.

    Every `register_*` returns a pose that has become known by it, `T_odom_base` with a covariance where there is one,
    each later than the last; `None` where it tells none. Raises `OdometryError` when the motion is lost.
    """

    @property
    def inputs(self) -> frozenset[str]:
        """Which of "poses", "imu", "lidar", "color" (the main camera), "color.left" (camera "left") to push."""
        ...

    @property
    def warnings(self) -> Sequence[str]:
        """What is doubtful in the motion so far, one line each; they are printed and stored with the traversal."""
        ...

    def add_imu(self, sample: ImuSample) -> None:
        """An IMU sample, in the IMU's frame; `T_base_imu` has the lever arm."""
        ...

    def register_pose(self, pose: StampedPose) -> StampedPose | None:
        """A pose that the robot's own odometry gives."""
        ...

    def register_sweep(self, sweep: Sweep) -> StampedPose | None:
        """A LiDAR sweep."""
        ...

    def register_frame(self, frame: CameraFrame) -> StampedPose | None:
        """A camera frame."""
        ...

    def finish(self) -> None:
        """Nothing comes any more. Raises `OdometryError` when there was no usable motion at all."""
        ...


class Detector(Protocol):
    """Finds objects in an image."""

    def image_stamps_ns(self, camera_id: str) -> IntArray | None:
        """The only images of a camera that it can speak of (recorded detections), or `None` if it can look at any."""
        ...

    def detect(self, frame: CameraFrame) -> Detections | None:
        """All detections of the image down to a low score; `None` if it says nothing of this image."""
        ...


@runtime_checkable
class IdentifiedDetector(Protocol):
    """What a detector adds that knows which network it runs. What it misses and how it calls things is that network's,
    also on another day.
    """

    @property
    def identity(self) -> str:
        """Equal for two detectors that err alike: the model's name, and a digest of its weights and words."""
        ...


@runtime_checkable
class WarningDetector(Protocol):
    """What a detector or a segmenter adds that has something to say beyond its detections or masks."""

    @property
    def warnings(self) -> Sequence[str]:
        """What the user should know of them so far, one line each."""
        ...


@runtime_checkable
class BatchDetector(Protocol):
    """What a detector adds that looks at several images at once."""

    @property
    def batch_size(self) -> int:
        """How many images it is best asked about at a time."""
        ...

    def detect_batch(self, frames: Sequence[CameraFrame]) -> Sequence[Detections | None]:
        """The detections of each image, as `detect` gives them."""
        ...


@runtime_checkable
class DeferredDetector(Protocol):
    """What a detector adds that answers later, such as one on another machine."""

    def submit(self, frame: CameraFrame) -> None:
        """Ask about an image; does not wait for the answer."""
        ...

    def results(self, timeout_s: float) -> Sequence[tuple[CameraFrame, Detections | None]]:
        """What has been answered since the last call, each with its image, in any order. Waits for the first answer,
        at most `timeout_s`.
        """
        ...


class Segmenter(Protocol):
    """Gives masks to boxes that came without."""

    def segment(self, frame: CameraFrame, detections: Detections) -> tuple[RegionMask | None, ...]:
        """A mask for every detection; existing masks are passed through; `None` where nothing can be told apart."""
        ...


class Tracker(Protocol):
    """Links detections over time in the image."""

    def update(self, detections: Detections, priors: Sequence[TrackPrior], image_size: tuple[int, int]) -> Tracks:
        """Assign the detections of the next image to tracks.

        `priors` are the map's predictions for tracks that belong to map objects, already moved with the camera;
        `image_size` is (width, height).
        """
        ...


@runtime_checkable
class Resumable(Protocol):
    """What a tracker adds so that a build that was stopped can go on in its midst, and not from its beginning.

    Detectors and segmenters need nothing of the kind: they speak of each image by itself.
    """

    def state(self) -> object:
        """All that later updates depend on: None, bool, int, float, str, bytes, numpy arrays, and lists, tuples, sets
        and dicts of these.
        """
        ...

    def resume(self, state: object) -> None:
        """Go on, just made, from what `state` gave."""
        ...


class TextEncoder(Protocol):
    """Embeds text."""

    def encode(self, texts: Sequence[str]) -> Float32Array:
        """(n, d) float32, unit length."""
        ...


class ImageEncoder(Protocol):
    """Embeds image crops, for re-identification."""

    def encode(self, crops_rgb: Sequence[UInt8Array]) -> Float32Array:
        """(n, d) float32, unit length, of n crops (h, w, 3) uint8."""
        ...


class Observer(Protocol):
    """Follows a mapping session: a viewer, a publisher, a log.

    It is called in a thread of its own and never slows the mapping: one that is slow misses frames and perceptions,
    which are counted and said, but no change of the map. One that raises is left out with a warning.
    """

    def started(self, context: SessionContext) -> None:
        """A traversal begins."""
        ...

    def frame(self, frame: CameraFrame, T_map_base: FloatArray, sweep: Sweep | None) -> None:
        """A frame has its place in the map, `T_map_base` (4, 4); `sweep` is the LiDAR's nearest in time, if any."""
        ...

    def perceived(
        self, keyframe: Keyframe, detections: Detections, masks: Sequence[RegionMask | None], tracks: Tracks
    ) -> None:
        """What was found in a keyframe, with a mask and a track for each detection."""
        ...

    def mapped(self, keyframe: KeyframeRecord | None, delta: MapDelta) -> None:
        """A keyframe was mapped: what it changed, once for each keyframe; at last what the end of the traversal
        changed, with `None`.
        """
        ...

    def committed(self, batch: MapDelta) -> None:
        """A batch of keyframes with all their changes stands in the database."""
        ...

    def ended(self, summary: SessionSummary) -> None:
        """The traversal is complete, or stopped."""
        ...


class LanguageModel(Protocol):
    """Answers a prompt."""

    def complete(self, prompt: str, images: Sequence[UInt8Array] = ()) -> str:
        """The model's answer to a text and images (h, w, 3) uint8 RGB."""
        ...
