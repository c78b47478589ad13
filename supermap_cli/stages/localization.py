"""Every frame gets its depth and its place in the map: pose, placement of the traversal, drift correction.

Paper, section IV-A: P_t = T_WC = T_WB T_BC, from an odometry that is not part of the map. Ours drifts, so the map
corrects it (`mapping.drift`), and a traversal has an odometry frame of its own, which is registered in the map.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

from supermap_cli.errors import AlignmentError, SessionError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse
from supermap_cli.geometry.trajectory import TimedPose, Trajectory
from supermap_cli.mapping.drift import DriftCorrection, DriftMark
from supermap_cli.mapping.structure import coarse_depth
from supermap_cli.stages.map_registration import MapRegistration, Placement
from supermap_cli.stages.motion_compensation import move_depth
from supermap_cli.stages.sweep_buffer import HALF_WINDOW_NS, LONGEST_SWEEP_NS, SweepBuffer
from supermap_cli.timing import StageClock
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.sensing import CameraFrame, ImuSample, Sweep
from supermap_cli.types.session import LocalizationState

MAX_POSE_WAIT_NS = 1_000_000_000
"""ns; a frame waits so long for a pose: the longest gap that is bridged (`Trajectory.max_gap_s`)."""

MAX_PLACING_NS = 300_000_000_000
"""ns; a traversal that is not placed yet is placed by no more than its last five minutes: 2 MB of poses at 100 Hz."""

REGISTRATION_RETRY = 2.0
"""Factor by which the time grows after which an unsuccessful placement is tried again, with all seen since."""

MAX_WAITING = 240
"""Frames kept while the traversal is being placed (2 MB each at 640 x 480); of more, every second is left out."""


@dataclass(frozen=True)
class LocalizationMark:
    """Where localization was after a frame: a build that goes on from there starts with it."""

    drift: DriftMark | None
    without_pose: int


@dataclass(frozen=True)
class LocatedFrame:
    """A frame with depth in the sensors' time, and the keyframe it is in the map and its time.

    `awaits_detections` says that its detections are to come; `sweep` is the LiDAR's nearest in time.
    """

    frame: CameraFrame
    keyframe: Keyframe
    awaits_detections: bool
    sweep: Sweep | None
    mark: LocalizationMark


@dataclass(frozen=True)
class _PendingFrame:
    frame: CameraFrame
    awaits_detections: bool
    T_odom_base: FloatArray | None = None
    sweep: Sweep | None = None


class Localizer:
    """Sensors are pushed in, frames with a place come out, in the order of their stamps.

    `registration` places a traversal whose placement is not known: after `placing_s` of it, and again later where that
    fails. Frames of that time wait. Every push locates what it can, so that places do not depend on when the frames are
    taken out; until then they are held.
    """

    def __init__(
        self,
        placement: Placement | None,
        registration: MapRegistration,
        drift: DriftCorrection | None,
        clock: StageClock,
        *,
        placing_s: float,
        clock_shift_ns: int = 0,
        without_pose: int = 0,
    ) -> None:
        self.placement = placement
        self.drift = drift
        self.clock = clock
        self.clock_shift_ns = clock_shift_ns
        self.without_pose = without_pose
        self.thinned = 0
        self.state: LocalizationState = "placing" if placement is None else "mapping"
        self.trajectory: Trajectory = registration.trajectory
        self.registration = registration
        self._structure = registration.parameters.structure
        self._sweeps = SweepBuffer(self.trajectory)
        self._newest_frame_ns: int | None = None
        self._newest_by_camera: dict[str, int] = {}
        self._frames: deque[_PendingFrame] = deque()
        self._unplaced: list[_PendingFrame] = []
        self._located: deque[LocatedFrame] = deque()
        self._unposed_sweeps: deque[Sweep] = deque()
        self._first_ns: int | None = None
        self._now_ns = 0
        self._retry_ns = round(placing_s * 1e9)

    @property
    def waiting(self) -> int:
        """How many frames wait for the traversal to be placed."""
        return len(self._unplaced)

    def add_pose(self, pose: TimedPose) -> None:
        """The next pose. Raises `OdometryError` where it does not go forward in time."""
        self.trajectory.append(pose)
        self._reach(pose.stamp_ns)

    def add_imu(self, sample: ImuSample) -> None:
        """The next IMU sample; it helps to place the traversal."""
        if self.placement is None:
            self.registration.add_imu(sample)
        self._reach(sample.stamp_ns)

    def add_sweep(self, sweep: Sweep) -> None:
        """The next LiDAR sweep."""
        self._sweeps.add(sweep)
        if self.placement is None:
            self._unposed_sweeps.append(sweep)
            if len(self._unposed_sweeps) > MAX_WAITING:
                self._unposed_sweeps.popleft()
        self._reach(sweep.stamp_ns)

    def add_frame(self, frame: CameraFrame, *, awaits_detections: bool) -> None:
        """The next frame, not older than the last one; without depth it takes that of the sweeps about it.

        Raises `SessionError` for an older one.
        """
        if self._newest_frame_ns is not None and frame.stamp_ns < self._newest_frame_ns:
            raise SessionError(
                f"the frame at {frame.stamp_ns} ns is {(self._newest_frame_ns - frame.stamp_ns) / 1e9:.3f} s older "
                "than the one before it",
                cure="push the frames of all cameras in the order of their stamps",
            )
        if self._newest_by_camera.get(frame.camera_id) == frame.stamp_ns:
            raise SessionError(
                f"a second frame of camera {frame.camera_id!r} at {frame.stamp_ns} ns", cure="push each frame once"
            )
        self._newest_frame_ns = self._newest_by_camera[frame.camera_id] = frame.stamp_ns
        self._frames.append(_PendingFrame(frame, awaits_detections))
        self._first_ns = frame.stamp_ns if self._first_ns is None else self._first_ns
        self._reach(frame.stamp_ns)

    def located(self, *, closing: bool = False) -> Iterator[LocatedFrame]:
        """The frames that have a place by now, each once. `closing`: nothing comes any more.

        Raises `AlignmentError` when closing and the traversal cannot be placed.
        """
        if closing:
            self._advance(closing=True)
        while self._located:
            yield self._located.popleft()

    def mark(self) -> LocalizationMark:
        """Where it is now."""
        return LocalizationMark(None if self.drift is None else self.drift.mark(), self.without_pose)

    # -- pose and depth

    def _reach(self, stamp_ns: int) -> None:
        self._now_ns = max(self._now_ns, stamp_ns)
        if not self._frames:
            self._forget()
        self._advance()

    def _advance(self, *, closing: bool = False) -> None:
        """Locate the frames that need wait no longer; all of them when closing."""
        while self._frames and (closing or self._is_ready(self._frames[0].frame)):
            posed = self._with_pose(self._frames.popleft())
            if posed is None:
                self.without_pose += 1
                self.state = "placing" if self.placement is None else "lost"
            elif self.placement is None:
                self._hold(posed)
            else:
                self.state = "mapping"
                self._located.append(self._locate(posed, self.placement))
            self._forget()
        if self.placement is None and self._unplaced and (closing or self._is_time_to_place()):
            self._place(closing=closing)

    def _is_ready(self, frame: CameraFrame) -> bool:
        """Whether the pose at a frame's stamp, and its depth, are as well known as they will ever be."""
        waited_ns = self._now_ns - frame.stamp_ns
        if frame.depth_m is not None:
            newest_ns, last_ns = self.trajectory.newest_ns, max(frame.stamp_ns, frame.depth_stamp_ns or 0)
            return waited_ns > MAX_POSE_WAIT_NS or (newest_ns is not None and newest_ns >= last_ns)
        longest_ns = MAX_POSE_WAIT_NS + HALF_WINDOW_NS + LONGEST_SWEEP_NS
        return waited_ns > longest_ns or self._sweeps.is_complete(frame.stamp_ns)

    def _with_pose(self, waiting: _PendingFrame) -> _PendingFrame | None:
        frame = waiting.frame
        with self.clock.stage("odometry"):
            T_odom_base = self.trajectory.at(frame.stamp_ns)
        if T_odom_base is None:
            return None
        sweep = self._sweeps.nearest(frame.stamp_ns)
        if frame.depth_m is None:
            with self.clock.stage("depth"):
                frame = self._sweeps.complete(frame)
        elif frame.depth_stamp_ns not in {None, frame.stamp_ns}:
            with self.clock.stage("depth"):
                frame = self._with_depth_moved(frame, T_odom_base)
        return _PendingFrame(frame, waiting.awaits_detections, T_odom_base, sweep)

    def _with_depth_moved(self, frame: CameraFrame, T_odom_base: FloatArray) -> CameraFrame:
        """The frame with its depth as from where the camera stood at the frame's own stamp."""
        T_odom_base_then = None if frame.depth_stamp_ns is None else self.trajectory.at(frame.depth_stamp_ns)
        if T_odom_base_then is None or frame.depth_m is None:
            return frame
        T_color_depth = inverse(T_odom_base @ frame.T_base_camera) @ (T_odom_base_then @ frame.T_base_camera)
        depth_m = move_depth(frame.camera, frame.depth_m, T_color_depth)
        return replace(frame, depth_m=depth_m, depth_stamp_ns=frame.stamp_ns)

    def _forget(self) -> None:
        """Drop what no frame to come needs; while the traversal is being placed, levelling needs all poses."""
        oldest_ns = self._frames[0].frame.stamp_ns if self._frames else self._now_ns - 2 * MAX_POSE_WAIT_NS
        self._sweeps.forget_before(min(oldest_ns, self._now_ns - 2 * MAX_POSE_WAIT_NS))
        kept_ns = 2 * MAX_POSE_WAIT_NS if self.placement is not None else MAX_PLACING_NS
        self.trajectory.forget_before(oldest_ns - kept_ns)

    # -- the place of the traversal

    def _hold(self, posed: _PendingFrame) -> None:
        self._unplaced.append(posed)
        if posed.T_odom_base is not None:
            self.registration.add_frame(posed.frame, posed.T_odom_base)
        newest_pose_ns = self.trajectory.newest_ns or 0
        while self._unposed_sweeps and self._unposed_sweeps[0].stamp_ns <= newest_pose_ns:
            self.registration.add_sweep(self._unposed_sweeps.popleft())
        if len(self._unplaced) > MAX_WAITING:
            kept = set(sorted({pending.frame.stamp_ns for pending in self._unplaced})[::2])
            before = len(self._unplaced)
            self._unplaced = [pending for pending in self._unplaced if pending.frame.stamp_ns in kept]
            self.thinned += before - len(self._unplaced)

    def _is_time_to_place(self) -> bool:
        return self._first_ns is not None and self._now_ns - self._first_ns >= self._retry_ns

    def _place(self, *, closing: bool) -> None:
        try:
            with self.clock.stage("place"):
                placement = self.registration.place()
        except AlignmentError:
            if closing:
                raise
            self._retry_ns = max(round(self._retry_ns * REGISTRATION_RETRY), MAX_POSE_WAIT_NS)
            self.state = "lost"
            return
        self.placement, self.state = placement, "mapping"
        waiting, self._unplaced = self._unplaced, []
        self._unposed_sweeps.clear()
        self._located.extend(self._locate(posed, placement) for posed in waiting)

    def _locate(self, posed: _PendingFrame, placement: Placement) -> LocatedFrame:
        frame, T_odom_base = posed.frame, posed.T_odom_base
        if T_odom_base is None or frame.depth_m is None:
            raise ValueError("a keyframe needs a pose and depth")
        with self.clock.stage("drift"):
            T_map_base = self._drift_corrected(frame, placement.T_map_odom @ T_odom_base)
        keyframe = Keyframe(
            frame.stamp_ns + self.clock_shift_ns,
            frame.rgb,
            frame.depth_m,
            frame.camera,
            T_map_base @ frame.T_base_camera,
            T_map_base,
            frame.returns_camera,
            frame.camera_id,
        )
        return LocatedFrame(frame, keyframe, posed.awaits_detections, posed.sweep, self.mark())

    def _drift_corrected(self, frame: CameraFrame, T_map_base: FloatArray) -> FloatArray:
        view = None if self.drift is None else coarse_depth(frame, T_map_base, parameters=self._structure)
        return T_map_base if self.drift is None or view is None else self.drift.register(view, T_map_base)
