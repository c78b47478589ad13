"""A recorded bag as a `Recording`: every stream an iterator in the order of sensor time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from supermap_cli.errors import CalibrationError, RecordingError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.protocols import SensorMessage
from supermap_cli.recordings import messages
from supermap_cli.recordings.camera_frames import CameraFrames, ImageTimes
from supermap_cli.recordings.clock_faults import REORDER_NS
from supermap_cli.recordings.decoding import MessageError
from supermap_cli.recordings.detection_messages import DetectionArrival, join_masks
from supermap_cli.recordings.detection_readers import read_detections
from supermap_cli.recordings.detection_scale import BoxScale, find_box_scale, image_sizes, scaled_numbers
from supermap_cli.recordings.detection_stamps import DetectionStamps, find_stamps, unjoined
from supermap_cli.recordings.fingerprint import content_fingerprint, window_fingerprint
from supermap_cli.recordings.image_topics import shows_a_camera
from supermap_cli.recordings.images import decode_numbers
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.opening import MARGIN_NS, OpenedCamera, OpenedRecording, no_poses
from supermap_cli.recordings.pointclouds import read_points
from supermap_cli.recordings.poses import recorded_poses
from supermap_cli.recordings.storage import RawMessage
from supermap_cli.recordings.survey import Topic
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep

_LATE_NS = 5_000_000_000
"""ns of log time by which detections and masks may come later than their image's stamp: a slow detector on a robot."""

_SILENCE_NS = 30_000_000_000
"""ns before the first and after the last message of a sensor that still belong to a recording."""

_BOXES_OF = 200
"""Detection arrays whose boxes are looked at to find out of which image size they are."""

_MOST_BROKEN = 50
"""Sweeps that may be broken before the first sound one; with more the topic is not what it says."""

Stamped = TypeVar("Stamped", StampedPose, Sweep, ImuSample)


def in_order(items: Iterable[Stamped], dropped: Callable[[int, int], None] | None = None) -> Iterator[Stamped]:
    """Items by ascending stamp, though some come up to half a second late; doubles and later ones are dropped.

    `dropped` is told how many came too late so far, and the stamp of the last of them.
    """
    waiting: list[tuple[int, int, Stamped]] = []
    last_ns: int | None = None
    late = 0
    for index, item in enumerate(items):
        if last_ns is not None and item.stamp_ns < last_ns:
            late += 1
            if dropped is not None:
                dropped(late, item.stamp_ns)
            continue
        heapq.heappush(waiting, (item.stamp_ns, index, item))
        while waiting[0][0] < item.stamp_ns - REORDER_NS:
            stamp_ns, _, ready = heapq.heappop(waiting)
            if last_ns is None or stamp_ns > last_ns:
                last_ns = stamp_ns
                yield ready
    while waiting:
        stamp_ns, _, ready = heapq.heappop(waiting)
        if last_ns is None or stamp_ns > last_ns:
            last_ns = stamp_ns
            yield ready


class BagRecording:
    """Fulfils `supermap_cli.protocols.Recording` for every container that `open_storage` can read."""

    def __init__(self, opened: OpenedRecording) -> None:
        if opened.rig.problems:
            raise opened.rig.problems[0]
        if not opened.rig.cameras:
            raise ValueError("a recording without problems has a camera")
        self._opened = opened
        times = ImageTimes(opened)
        self._stamps: dict[str, DetectionStamps] = {}
        self._scales: dict[str, BoxScale] = {}
        self._frames = {camera.camera_id: CameraFrames(opened, camera, times) for camera in opened.rig.cameras}

    @property
    def path(self) -> Path:
        """The file or folder."""
        return self._opened.path

    @property
    def start_ns(self) -> int:
        """Sensor time of the window's start, or of the first image if that is earlier."""
        return self._span_ns[0]

    @property
    def end_ns(self) -> int:
        """Sensor time of the window's end, or of the last image if that is later."""
        return self._span_ns[1]

    @cached_property
    def _span_ns(self) -> tuple[int, int]:
        """The window and all its images. Its open sides are times of recording, which stamps lie before or beyond; what
        was added when all sensors were long silent (results, latched messages) is no part of it.
        """
        window, stamps_ns = self._opened.rig.window, [self.frame_stamps_ns(camera_id) for camera_id in self.cameras]
        first_ns, last_ns = min(int(stamps[0]) for stamps in stamps_ns), max(int(stamps[-1]) for stamps in stamps_ns)
        sensed_ns = self._sensed_ns()
        start_ns, end_ns = max(window.start_ns, sensed_ns[0]), min(window.end_ns, sensed_ns[1])
        return min(start_ns, first_ns), max(end_ns, last_ns)

    def _sensed_ns(self) -> tuple[int, int]:
        """Between which sensor times images, clouds and IMU were recorded; open where that is about the whole."""
        opened = self._opened
        roles = ("color", "depth", "lidar", "imu")
        topics = {
            choice.topic.name for role, choice in opened.rig.plan.choices.items() if role.partition(".")[0] in roles
        }
        first_ns, last_ns = opened.storage.start_ns, opened.storage.end_ns
        sensed_ns = [-(1 << 62), 1 << 62]
        if next(iter(opened.storage.messages(topics, None, first_ns + _SILENCE_NS)), None) is None:
            sensed_ns[0] = min(time for _, time in opened.storage.log_times(topics)) + opened.rig.window.offset_ns
        if next(iter(opened.storage.messages(topics, last_ns - _SILENCE_NS, None)), None) is None:
            sensed_ns[1] = max(time for _, time in opened.storage.log_times(topics)) + opened.rig.window.offset_ns
        return sensed_ns[0], sensed_ns[1]

    @cached_property
    def _cameras(self) -> tuple[OpenedCamera, ...]:
        """The cameras, without those that were found by themselves and turn out to have no usable frame (noted)."""
        given = self._opened.rig.cameras
        if len(given) == 1:
            return given
        usable: list[OpenedCamera] = []
        failures: dict[str, RecordingError] = {}
        for camera in given:
            try:
                if not camera.plan.named:
                    self._frames[camera.camera_id].stamps_ns()
                usable.append(camera)
            except RecordingError as error:
                failures[camera.camera_id] = error
        if not usable:
            raise next(iter(failures.values()))
        for camera_id, failure in failures.items():
            self._opened.notes.note(f"camera {camera_id}", f"the camera {camera_id!r} is left out: {failure}")
        return tuple(usable)

    @property
    def streams(self) -> frozenset[str]:
        """Which of "color", "depth", "lidar", "imu", "poses", "detections", "masks" there are."""
        roles = {"lidar"} & self._opened.rig.plan.shared.keys()
        for camera in self._cameras:
            roles |= {"color", "depth", "detections", "masks"} & camera.plan.choices.keys()
        if self._opened.rig.pose_source is not None:
            roles.add("poses")
        if self._imu_topic() is not None:
            roles.add("imu")
        return frozenset(roles)

    @property
    def cameras(self) -> tuple[str, ...]:
        """The `camera_id` of every camera, the main one first."""
        return tuple(camera.camera_id for camera in self._cameras)

    @property
    def base_frame(self) -> str:
        """The frame that poses move, as named in the recording."""
        return self._opened.rig.base_frame

    @property
    def warnings(self) -> Sequence[str]:
        """What was corrected or left out while opening and reading so far, one line each."""
        return self._opened.notes.lines

    def fingerprint(self) -> str:
        """Hex digest of what is in the files, and of the window."""
        return window_fingerprint(self.content_fingerprint(), self.start_ns, self.end_ns)

    def content_fingerprint(self) -> str:
        """Hex digest of what is in the files, whatever the window."""
        return content_fingerprint(self.path, self._opened.storage.channels)

    def messages(self) -> Iterator[SensorMessage]:
        """All streams together, in the order of their stamps."""
        poses = self.poses() if "poses" in self.streams else iter(())
        frames = [self.frames(camera_id=camera_id) for camera_id in self.cameras]
        detections = [self.detections(camera_id) for camera_id in self.cameras]
        streams: tuple[Iterator[SensorMessage], ...] = (poses, self.imu(), self.sweeps(), *frames, *detections)
        return heapq.merge(*streams, key=lambda message: message.stamp_ns)

    def frame_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        """(n,) int64 stamps of all usable frames of a camera, ascending, without decoding any image."""
        return self._frames[self._camera(camera_id).camera_id].stamps_ns()

    def frames(
        self, selected: Callable[[int], bool] | None = None, camera_id: str | None = None
    ) -> Iterator[CameraFrame]:
        """Frames of a camera in order; `selected` is asked about all stamps, ascending, before any image is decoded."""
        return self._frames[self._camera(camera_id).camera_id].frames(selected)

    def poses(self) -> Iterator[StampedPose]:
        """The recorded odometry, `T_odom_base`. Raises `RecordingError` where there is none, or none that is finite."""
        if self._opened.rig.pose_source is None:
            raise self._opened.motion_problem or no_poses(str(self.path))
        return in_order(recorded_poses(self._opened, self._opened.rig.pose_source), self._note_late("poses"))

    def sweeps(self) -> Iterator[Sweep]:
        """LiDAR sweeps, points finite, in the LiDAR's frame; nothing where there is no LiDAR."""
        lidar = self._opened.rig.plan.topic("lidar")
        return iter(()) if lidar is None else in_order(self._sweeps(lidar), self._note_late("sweeps"))

    def imu(self) -> Iterator[ImuSample]:
        """IMU samples with their mounting on the base; nothing where there is none, or none that TF places."""
        topic = self._imu_topic()
        return iter(()) if topic is None else in_order(self._imu(topic), self._note_late("IMU samples"))

    def detection_stamps_ns(self, camera_id: str | None = None) -> IntArray:
        """(n,) int64 stamps of a camera's images that recorded detections belong to (`header.stamp`), ascending."""
        camera = self._camera(camera_id)
        topic = camera.plan.topic("detections")
        if topic is None:
            return np.zeros(0, np.int64)
        stamps = {stamp_ns for stamp_ns, _ in self._of_camera(camera, [topic.name])}
        self._check_joined(camera, topic)
        return np.array(sorted(stamps), np.int64)

    def detections(self, camera_id: str | None = None) -> Iterator[Detections]:
        """Recorded detections of a camera with their masks, in the order of their images' stamps."""
        return join_masks(self._detection_arrivals(self._camera(camera_id)), _LATE_NS)

    def _camera(self, camera_id: str | None) -> OpenedCamera:
        """A camera by its id (`None`: the main one). Raises `ValueError` if there is none of that id."""
        for camera in self._cameras:
            if camera_id in {None, camera.camera_id}:
                return camera
        raise ValueError(f"no camera {camera_id!r} among {self.cameras}")

    def _note_late(self, what: str) -> Callable[[int, int], None]:
        def note(count: int, stamp_ns: int) -> None:
            self._opened.notes.note(
                f"late {what}",
                f"{self._opened.place(what, stamp_ns)}: the stamp lies before those of much earlier messages; {count} "
                f"such {what} left out",
            )

        return note

    def _messages(self, topics: Sequence[str], margin_ns: int) -> Iterator[RawMessage]:
        return self._opened.storage.messages(topics, *self._opened.rig.window.log_range(margin_ns))

    def _sweeps(self, lidar: Topic) -> Iterator[Sweep]:
        opened = self._opened
        transforms = opened.transforms(opened.rig.base_frame, {lidar.frame_id})
        left_out, broken, sound, shift_ns = 0, 0, 0, opened.shift_ns(lidar.name)
        for raw in self._messages([lidar.name], MARGIN_NS):
            place = opened.place(lidar.name, raw.log_ns + opened.rig.window.offset_ns)
            try:
                read = read_points(raw, opened.decoder)
            except MessageError as error:
                broken += 1
                opened.decoder.leave_out(raw, error)
                if broken > _MOST_BROKEN and not sound:
                    raise RecordingError(
                        f"none of the first {broken} LiDAR sweeps can be read: {error.what}",
                        where=place,
                        cure="name another LiDAR topic with --topic lidar=/...",
                    ) from error
                continue
            sound += 1
            if not len(read.points):
                continue
            if read.foreign_clock:
                opened.notes.note("clock of points", f"{place}: point times are of another clock, taken as relative")
            stamp_ns = read.stamp_ns + shift_ns
            T_base_lidar = transforms.lookup(opened.rig.base_frame, lidar.frame_id, stamp_ns)
            if T_base_lidar is None:
                left_out += 1
                opened.notes.note(
                    "sweeps", f"{place}: TF does not place {lidar.frame_id!r}; {left_out} sweep(s) left out"
                )
            elif opened.rig.window.holds(stamp_ns, MARGIN_NS):
                point_stamps_ns = None if read.point_stamps_ns is None else read.point_stamps_ns + shift_ns
                points = read.points if lidar.point_scale == 1.0 else read.points * lidar.point_scale
                yield Sweep(stamp_ns, read.frame_id, points, point_stamps_ns, T_base_lidar)

    def _imu_topic(self) -> Topic | None:
        """The IMU, if TF says how it is turned against the base."""
        topic = self._opened.rig.plan.topic("imu")
        if topic is None:
            return None
        try:
            if self._opened.tree.connects(self._opened.rig.base_frame, topic.frame_id):
                return topic
        except CalibrationError:
            return None
        self._opened.notes.note(
            "imu",
            f"{self.path}, {topic.name}: TF does not connect {topic.frame_id!r} with the base, the IMU is left out",
        )
        return None

    def _imu(self, topic: Topic) -> Iterator[ImuSample]:
        opened = self._opened
        transforms = opened.transforms(opened.rig.base_frame, {topic.frame_id})
        for _, sample in opened.decoder.each(self._messages([topic.name], MARGIN_NS), messages.read_imu):
            stamp_ns = sample.stamp_ns + opened.shift_ns(topic.name)
            T_base_imu = transforms.lookup(opened.rig.base_frame, topic.frame_id, stamp_ns)
            finite = np.isfinite(sample.angular_rate).all() and np.isfinite(sample.specific_force).all()
            if T_base_imu is not None and finite and opened.rig.window.holds(stamp_ns, MARGIN_NS):
                yield ImuSample(stamp_ns, sample.angular_rate, sample.specific_force, T_base_imu)

    def _detection_stamps(self, camera: OpenedCamera) -> DetectionStamps:
        """By what a camera's detections belong to its images."""
        found = self._stamps.get(camera.camera_id)
        if found is None:
            opened, topic = self._opened, camera.plan.topic("detections")
            raws = iter(()) if topic is None else self._messages([topic.name], _LATE_NS)
            tolerance_ns = round(opened.request.detection_tolerance_s * 1e9)
            images_ns = self._frames[camera.camera_id].image_stamps_ns()
            shift_ns = 0 if topic is None else opened.shift_ns(topic.name)
            by_header = DetectionStamps(images_ns, tolerance_ns, shift_ns=shift_ns)
            given = topic is not None and topic.name in opened.request.clocks
            reference = None if given else camera.plan.color
            found = self._stamps[camera.camera_id] = find_stamps(raws, by_header, opened.decoder, reference)
            if found.clock is not None and found.clock.sure and topic is not None:
                opened.notes.note(f"clock {topic.name}", f"{self.path}, {topic.name}: {found.clock.note(topic.name)}")
            if found.own and topic is not None:
                opened.notes.note(
                    f"stamps {topic.name}",
                    f"{self.path}, {topic.name}: the arrays have not the stamps of images; those that their detections "
                    "bear count",
                )
        return found

    def _check_joined(self, camera: OpenedCamera, topic: Topic) -> None:
        """Raise `RecordingError` where no detections of a camera belong to any of its images."""
        stamps, decoder = self._detection_stamps(camera), self._opened.decoder
        problem = unjoined(self._messages([topic.name], _LATE_NS), stamps, decoder, f"{self.path}, {topic.name}")
        if problem is not None:
            raise problem
        self._box_scale(camera, topic)

    def _box_scale(self, camera: OpenedCamera, topic: Topic) -> BoxScale:
        """What brings a camera's boxes to its images. Raises `RecordingError` for boxes of some other images."""
        found = self._scales.get(camera.camera_id)
        if found is None:
            opened, model, where = self._opened, camera.rig.camera, f"{self.path}, {topic.name}"
            reader = partial(_detections_of, stamp_ns=0, camera_id=camera.camera_id, limits=opened.decoder.limits)
            raws = (raw for _, raw in self._of_camera(camera, [topic.name]))
            read = (detections for _, detections in opened.decoder.each(raws, reader))
            size = (model.width, model.height)
            found = find_box_scale(islice(read, _BOXES_OF), size, image_sizes(opened.rig.topics), where)
            self._scales[camera.camera_id] = found
            if found.why:
                opened.notes.note(f"boxes {topic.name}", f"{where}: {found.why}")
        return found

    def _of_camera(self, camera: OpenedCamera, topics: Sequence[str]) -> Iterator[tuple[int, RawMessage]]:
        """(stamp, message) of detections or masks in the window, without those that bear another camera's frame."""
        opened = self._opened
        others = self._frames_of_other_cameras(camera)
        stamp_of = self._detection_stamps(camera).of
        for stamp_ns, raw in opened.decoder.stamped(self._messages(topics, _LATE_NS), stamp_of):
            if not opened.rig.window.holds(stamp_ns):
                continue
            if others and (header := opened.decoder.read(raw, messages.header_of)) and header[1] in others:
                continue
            yield stamp_ns, raw

    def _frames_of_other_cameras(self, camera: OpenedCamera) -> frozenset[str]:
        """Frames of colour images that are not this camera's; where the user named the detections, only those of the
        cameras that are mapped.
        """
        plan, named = camera.plan, camera.plan.choices.get("detections")
        roles = ("color", "depth", "camera_info", "depth_camera_info")
        own = {topic.frame_id for role in roles if (topic := plan.topic(role)) is not None}
        frames = {other.plan.recorded_frame_id or other.plan.frame_id for other in self._cameras}
        if named is not None and not named.named and plan.frame_id:
            frames |= {topic.frame_id for topic in self._opened.rig.topics if shows_a_camera(topic)}
        return frozenset(frames - own - {plan.recorded_frame_id, plan.frame_id, ""})

    def _detection_arrivals(self, camera: OpenedCamera) -> Iterator[DetectionArrival]:
        opened = self._opened
        arrays, masks = camera.plan.topic("detections"), camera.plan.topic("masks")
        if arrays is None:
            return
        names = [arrays.name] if masks is None else [arrays.name, masks.name]
        scale, outside = self._box_scale(camera, arrays), 0
        for stamp_ns, raw in self._of_camera(camera, names):
            arrived_ns = raw.log_ns + opened.rig.window.offset_ns
            if raw.channel.topic == arrays.name:
                reader = partial(
                    _detections_of, stamp_ns=stamp_ns, camera_id=camera.camera_id, limits=opened.decoder.limits
                )
                if (detections := opened.decoder.read(raw, reader)) is not None:
                    scaled, strays = scale.apply(detections)
                    if outside := outside + strays:
                        opened.notes.note(
                            f"outside {arrays.name}",
                            f"{self.path}, {arrays.name}: {outside} boxes outside their images left out",
                        )
                    yield DetectionArrival(stamp_ns, arrived_ns, detections=scaled)
                continue
            if (image := opened.decoder.read(raw, messages.read_image)) is None:
                continue
            place = opened.place(raw.channel.topic, stamp_ns)
            try:
                numbers = decode_numbers(image, opened.decoder.limits)
            except ValueError as error:
                opened.notes.note(f"masks {camera.camera_id}", f"{place}: {error}, left out")
                continue
            except RecordingError as error:
                raise RecordingError(error.what, where=place, cure=error.cure) from error
            numbers = scaled_numbers(numbers, scale.image_size)
            yield DetectionArrival(stamp_ns, arrived_ns, numbers=numbers)


def _detections_of(message: Any, _: int, *, stamp_ns: int, camera_id: str, limits: Limits) -> Detections:
    return read_detections(message, stamp_ns, camera_id, limits)
