"""Colour and depth images synchronised by their stamps, decoded, and placed on the robot."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.se3 import inverse
from supermap_cli.recordings.clock_faults import StepForward, outliers, step_back, step_forward
from supermap_cli.recordings.color_depth_fit import fitted_rig
from supermap_cli.recordings.decoding import MessageError
from supermap_cli.recordings.images import decode_color
from supermap_cli.recordings.messages import read_image
from supermap_cli.recordings.opening import OpenedCamera, OpenedRecording
from supermap_cli.recordings.registration import DepthRegistration, SameCentre, ZBuffer
from supermap_cli.recordings.rig import CameraRig, DepthRig
from supermap_cli.recordings.roles import role_name
from supermap_cli.recordings.storage import RawMessage
from supermap_cli.types.sensing import CameraFrame

_MARGIN_NS = 1_000_000_000
"""ns of log time about the window in which images whose stamps lie in it may have been recorded."""

_CUT = "cut the recording there and build its parts one after the other; their order is kept"
"""The cure for a clock that was set while recording."""


def pair_stamps(color_ns: IntArray, depth_ns: IntArray, tolerance_ns: int) -> list[tuple[int, int]]:
    """Pairs of ascending stamps that are each other's nearest and no further apart than the tolerance."""
    if not len(color_ns) or not len(depth_ns):
        return []
    to_depth, to_color = _nearest(color_ns, depth_ns), _nearest(depth_ns, color_ns)
    mutual = to_color[to_depth] == np.arange(len(color_ns))
    close = np.abs(depth_ns[to_depth] - color_ns) <= tolerance_ns
    kept = np.flatnonzero(mutual & close)
    return [(int(color_ns[index]), int(depth_ns[to_depth[index]])) for index in kept]


def _nearest(of: IntArray, among: IntArray) -> IntArray:
    """For each stamp the index of the nearest among ascending ones (the earlier of two equally near)."""
    after = np.searchsorted(among, of).clip(1, max(1, len(among) - 1))
    if len(among) == 1:
        return np.zeros(len(of), np.int64)
    earlier = of - among[after - 1] <= among[after] - of
    return np.where(earlier, after - 1, after)


class ImageTimes:
    """The stamps of all cameras' images, by one pass over the headers alone."""

    def __init__(self, opened: OpenedRecording) -> None:
        self._opened = opened
        topics = (topic for camera in opened.rig.cameras for topic in (camera.color, camera.depth))
        self._topics = tuple(dict.fromkeys(topic for topic in topics if topic is not None))

    @cached_property
    def _times_ns(self) -> dict[str, IntArray]:
        times: dict[str, list[tuple[int, int]]] = {topic: [] for topic in self._topics}
        raws = self._opened.storage.messages(self._topics, *self._opened.rig.window.log_range(_MARGIN_NS))
        for stamp_ns, raw in self._opened.stamped(raws):
            times[raw.channel.topic].append((stamp_ns, raw.log_ns))
        return {topic: np.array(pairs, np.int64).reshape(-1, 2) for topic, pairs in times.items()}

    def of_topic(self, topic: str) -> IntArray:
        """(n, 2) int64 stamps and log times of a topic's images about the window, in the order of recording."""
        return self._times_ns[topic]


class CameraFrames:
    """The frames of one camera of an opened recording. Only the images of a few are in memory at a time."""

    def __init__(self, opened: OpenedRecording, camera: OpenedCamera, times: ImageTimes) -> None:
        self._opened = opened
        self._camera = camera
        self._times = times
        self._color = camera.color
        self._depth = camera.depth

    @cached_property
    def _rig(self) -> CameraRig:
        """The rig, checked on the images when the first frame is wanted."""
        return fitted_rig(self._opened, self._camera)

    @cached_property
    def _pairs(self) -> Sequence[tuple[int, int | None]]:
        """(colour stamp, depth stamp) of every usable frame."""
        topics = [self._color] if self._depth is None else [self._color, self._depth]
        stamps = {topic: self._going_forward(topic, self._times.of_topic(topic)) for topic in topics}
        color_ns = np.unique(stamps[self._color])
        color_ns = (
            color_ns[[self._opened.rig.window.holds(int(stamp)) for stamp in color_ns]] if len(color_ns) else color_ns
        )
        if not len(color_ns):
            raise RecordingError(
                "no camera images in the window", where=self._place(self._color), cure="widen --start/--end"
            )
        if self._depth is None:
            return [(int(stamp), None) for stamp in color_ns]
        return self._matched(color_ns, np.unique(stamps[self._depth]), self._depth)

    def _going_forward(self, topic: str, times_ns: IntArray) -> IntArray:
        """The stamps among (n, 2) stamps and log times of a topic, without those that cannot be true (noted).

        Raises `RecordingError` where the clock was set back: images of two times would stand in one; and where it was
        set forward by days, from no time at all to that of the day.
        """
        stamps_ns, log_ns = times_ns.T
        outlying = outliers(stamps_ns, log_ns)
        if outlying.any():
            first = self._opened.place(topic, int(log_ns[outlying][0]) + self._opened.rig.window.offset_ns)
            self._opened.notes.note(
                f"stray stamps {topic}",
                f"{first}: {outlying.sum()} of {len(outlying)} images have a stamp far off all others and are left out",
            )
        stamps_ns, log_ns = stamps_ns[~outlying], log_ns[~outlying]
        back = step_back(stamps_ns)
        if back is not None:
            raise RecordingError(
                f"its clock is set back by {back.by_ns / 1e9:.1f} s, at image {back.index + 1} of {len(stamps_ns)}",
                where=self._opened.place(topic, int(log_ns[back.index]) + self._opened.rig.window.offset_ns),
                cure=_CUT,
            )
        ahead = step_forward(stamps_ns, log_ns)
        if ahead is not None:
            self._set_forward(topic, ahead, log_ns)
        return np.asarray(stamps_ns, np.int64)

    def _set_forward(self, topic: str, ahead: StepForward, log_ns: IntArray) -> None:
        """Note that a clock was set forward. Raises `RecordingError` where that cannot be time that went by."""
        last_ns, next_ns = log_ns[ahead.index - 1 : ahead.index + 1].tolist()
        where = self._opened.place(topic, last_ns + self._opened.rig.window.offset_ns)
        what = f"its clock is set forward by {_length_text(ahead.by_ns)}, after image {ahead.index} of {len(log_ns)}"
        if not ahead.too_far:
            self._opened.notes.note(
                f"clock set {self._color}", f"{where}: {what}; in the map nobody looks in that time"
            )
            return
        begin_ns = self._opened.storage.start_ns
        end_s, start_s = (last_ns - begin_ns) // 10**9 + 1, (next_ns - begin_ns) // 10**9 - 1
        parts = f"build its parts one after the other, with --end {end_s} and with --start {start_s}"
        raise RecordingError(what, where=where, cure=parts if ahead.log_too else _CUT)

    def _matched(self, color_ns: IntArray, depth_ns: IntArray, depth: str) -> Sequence[tuple[int, int | None]]:
        tolerance_s = self._opened.request.sync_tolerance_s
        pairs = pair_stamps(color_ns, depth_ns, round(tolerance_s * 1e9))
        if not pairs:
            apart = (
                float(np.abs(depth_ns[_nearest(color_ns, depth_ns)] - color_ns).min()) / 1e9 if len(depth_ns) else None
            )
            raise RecordingError(
                f"no depth image within {tolerance_s:g} s of a colour image"
                + (f", the nearest is {apart:.3f} s off" if apart is not None else ""),
                where=self._place(depth),
                cure="raise sync_tolerance_s ([build.recording] in supermap.toml), or name another "
                f"--topic {self._role('depth')}=/...",
            )
        if len(pairs) < len(color_ns):
            self._opened.notes.note(
                f"pairs {self._color}",
                f"{self._place(self._color)}: {len(color_ns) - len(pairs)} of {len(color_ns)} images have no depth "
                f"within {tolerance_s:g} s and are left out",
            )
        return list(pairs)

    def image_stamps_ns(self) -> IntArray:
        """(n,) int64 stamps of all colour images about the window, usable or not, ascending."""
        return np.unique(self._times.of_topic(self._color)[:, 0])

    def stamps_ns(self) -> IntArray:
        """(n,) int64 stamps of the usable frames."""
        return np.array([color_ns for color_ns, _ in self._pairs], np.int64)

    def frames(self, selected: Callable[[int], bool] | None) -> Iterator[CameraFrame]:
        """Decoded frames in order; broken images are left out with a note. Raises if none is left."""
        builder = _FrameBuilder(self._opened, self._rig, self._camera)
        pairs = [pair for pair in self._pairs if selected is None or selected(pair[0])]
        count = 0
        for color, depth in self._raw_pairs(pairs):
            frame = builder.build(color, depth)
            if frame is not None:
                count += 1
                yield frame
        if pairs and not count and self._is_at_the_start(pairs):
            raise RecordingError(
                f"none of {len(pairs)} camera frames can be used ({builder.last_fault})",
                where=self._place(self._color),
                cure="record again, or name another topic with "
                f"--topic {self._role('color')}=/... or {self._role('depth')}=/...",
            )

    def _is_at_the_start(self, pairs: Sequence[tuple[int, int | None]]) -> bool:
        """Whether chosen pairs begin in the first half: what is left for a build that goes on may hold no sound one."""
        return pairs[0][0] <= self._pairs[len(self._pairs) // 2][0]

    def _raw_pairs(self, pairs: Sequence[tuple[int, int | None]]) -> Iterator[tuple[RawMessage, RawMessage | None]]:
        """The messages of each pair, in the order of the pairs, holding back what arrived before its partner."""
        queue = deque(pairs)
        missing = {self._color: {pair[0] for pair in pairs}}
        if self._depth is not None:
            missing[self._depth] = {pair[1] for pair in pairs if pair[1] is not None}
        arrived: dict[tuple[str, int], RawMessage] = {}
        raws = self._messages() if queue else ()
        for stamp_ns, raw in self._opened.stamped(raws):
            topic = raw.channel.topic
            if stamp_ns not in missing[topic]:
                continue
            missing[topic].remove(stamp_ns)
            arrived[topic, stamp_ns] = raw
            while queue and self._is_complete(queue[0], arrived):
                color_ns, depth_ns = queue.popleft()
                depth = None if self._depth is None or depth_ns is None else arrived.pop((self._depth, depth_ns))
                yield arrived.pop((self._color, color_ns)), depth
            if not queue:
                return

    def _is_complete(self, pair: tuple[int, int | None], arrived: dict[tuple[str, int], RawMessage]) -> bool:
        color_ns, depth_ns = pair
        has_depth = self._depth is None or depth_ns is None or (self._depth, depth_ns) in arrived
        return has_depth and (self._color, color_ns) in arrived

    def _messages(self) -> Iterator[RawMessage]:
        topics = [self._color] if self._depth is None else [self._color, self._depth]
        return self._opened.storage.messages(topics, *self._opened.rig.window.log_range(_MARGIN_NS))

    def _place(self, topic: str) -> str:
        return f"{self._opened.path}, {topic}"

    def _role(self, role: str) -> str:
        return role_name(role, self._camera.camera_id)


class _FrameBuilder:
    """Makes one frame after the other from a camera's raw messages."""

    def __init__(self, opened: OpenedRecording, rig: CameraRig, camera: OpenedCamera) -> None:
        self._opened = opened
        self._rig = rig
        self._camera_id = camera.camera_id
        self._color = camera.color
        self._dropped = 0
        self.last_fault = ""
        self._transforms = opened.transforms(
            rig.base_frame, {rig.color_frame, rig.depth.frame_id if rig.depth else rig.color_frame}
        )
        self._registration = _registration(rig)
        mask = rig.camera.valid_mask()
        self._blind = None if mask.all() else ~mask

    def build(self, color: RawMessage, depth: RawMessage | None) -> CameraFrame | None:
        """The frame, or `None` (with a note) if its images are broken or its place is unknown."""
        stamp_ns = self._opened.stamp_ns(color)
        try:
            T_base_camera = self._mounting(self._rig.color_frame, stamp_ns)
            if self._rig.depth is not None and self._rig.depth.T_color_depth is not None:
                T_base_camera = T_base_camera @ inverse(self._rig.depth.T_color_depth)
            rgb = self._rgb(color, stamp_ns)
            depth_m, depth_stamp_ns = None, None
            if depth is not None and self._rig.depth is not None:
                depth_m = self._registered_depth(depth, self._rig.depth, stamp_ns)
                depth_stamp_ns = self._opened.stamp_ns(depth)
        except ValueError as fault:
            self._drop(stamp_ns, str(fault))
            return None
        except MessageError as fault:
            self._drop(stamp_ns, fault.what)
            return None
        return CameraFrame(
            stamp_ns,
            self._rig.color_frame,
            rgb,
            depth_m,
            self._rig.camera,
            T_base_camera,
            camera_id=self._camera_id,
            depth_stamp_ns=depth_stamp_ns,
        )

    def _drop(self, stamp_ns: int, fault: str) -> None:
        self._dropped += 1
        self.last_fault = fault
        self._opened.notes.note(
            f"frames {self._color}",
            f"{self._opened.place(self._color, stamp_ns)}: {fault}; {self._dropped} camera frame(s) left out so far",
        )

    def _mounting(self, frame: str, stamp_ns: int) -> FloatArray:
        T = self._transforms.lookup(self._rig.base_frame, frame, stamp_ns)
        if T is None:
            raise ValueError(f"TF does not place {frame!r} at that time")
        return T

    def _rgb(self, raw: RawMessage, stamp_ns: int) -> UInt8Array:
        image = self._opened.decoder.read_strictly(raw, read_image)
        try:
            rgb = decode_color(image, self._opened.decoder.limits)
        except RecordingError as error:
            raise RecordingError(
                error.what, where=self._opened.place(self._color, stamp_ns), cure=error.cure
            ) from error
        size = (self._rig.camera.width, self._rig.camera.height)
        if (rgb.shape[1], rgb.shape[0]) != size:
            raise ValueError(f"the image has {rgb.shape[1]} x {rgb.shape[0]} pixels, most have {size[0]} x {size[1]}")
        return rgb

    def _registered_depth(self, raw: RawMessage, rig: DepthRig, stamp_ns: int) -> Float32Array:
        image = self._opened.decoder.read_strictly(raw, read_image)
        try:
            depth_m = self._opened.depth_m(image, raw.channel.topic)
        except RecordingError as error:
            raise RecordingError(
                error.what, where=self._opened.place(raw.channel.topic, stamp_ns), cure=error.cure
            ) from error
        camera = rig.camera
        if depth_m.shape != (camera.height, camera.width):
            raise ValueError(f"the depth image has shape {depth_m.shape}, expected {(camera.height, camera.width)}")
        if self._registration is not None:
            T_color_depth = rig.T_color_depth
            if T_color_depth is None:
                T_color_depth = inverse(self._mounting(self._rig.color_frame, stamp_ns)) @ self._mounting(
                    rig.frame_id, self._opened.stamp_ns(raw)
                )
            depth_m = self._registration.register(depth_m, T_color_depth)
        if self._blind is not None:
            depth_m[self._blind] = 0
        return depth_m


def _length_text(length_ns: int) -> str:
    days = length_ns / (24 * 3600 * 10**9)
    return f"{days:.0f} days" if days >= 1 else f"{length_ns / 1e9:.1f} s"


def _registration(rig: CameraRig) -> DepthRegistration | None:
    if rig.depth is None or rig.depth.aligned:
        return None
    if rig.depth.T_color_depth is None and rig.depth.frame_id == rig.color_frame:
        return SameCentre(rig.camera, rig.depth.camera)
    return ZBuffer(rig.camera, rig.depth.camera)
