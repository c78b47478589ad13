"""Pushes a recorded bag into a mapping session, and does what needs the whole of it: which images are mapped, where the
traversal stands in the map by images spread over all of it, and perception one keyframe ahead of mapping.
"""

from __future__ import annotations

import heapq
from collections.abc import Generator, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from itertools import groupby

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.backends import Backends
from supermap_cli.drivers.keyframe_choice import choose_frames
from supermap_cli.drivers.late_detections import DelayModel, LateDetections
from supermap_cli.drivers.perception import Perceived, Perception
from supermap_cli.drivers.placing import Feed, place_recording
from supermap_cli.geometry.trajectory import PackedPose
from supermap_cli.lookahead import LookAhead
from supermap_cli.parameters import MethodParameters
from supermap_cli.protocols import Recording
from supermap_cli.session import MappingSession
from supermap_cli.stages.localization import Localizer, LocatedFrame
from supermap_cli.stages.map_registration import EarlierTraversals, Placement
from supermap_cli.stages.sweep_buffer import HALF_WINDOW_NS, LONGEST_SWEEP_NS
from supermap_cli.timing import StageClock
from supermap_cli.types.memory import MapDelta
from supermap_cli.types.sensing import Sweep

Position = tuple[int, str]
"""Where a build is in a recording: stamp (ns, the recording's own) and camera of the frame mapped last."""


class BagDriver:
    """Pushes one recording, as fast as it can be read."""

    def __init__(
        self, recording: Recording, backends: Backends, config: BuildConfig, clock: StageClock, *, look_ahead: bool
    ) -> None:
        """Without `look_ahead` one stage runs at a time."""
        self.recording = recording
        self.backends = backends
        self.late = LateDetections(DelayModel(config.perception.delay_s, config.perception.dropped))
        self.frames = 0
        self.parameters = MethodParameters.from_overrides(config.parameters).mapping
        self._config = config
        self._clock = clock
        self._look_ahead = look_ahead
        self._perception = Perception(backends.detector, backends.segmenter, clock)

    def place(self, request: str, earlier: EarlierTraversals) -> Placement:
        """Where the recording's odometry stands in the map, by images spread over all of it.

        Raises `AlignmentError` if it cannot be told with confidence.
        """
        return place_recording(self.recording, self.backends.trajectory, request, earlier, self.parameters)

    def push_into(self, session: MappingSession, after: Position | None = None) -> Generator[Iterator[MapDelta]]:
        """Push everything (after a position) and close the session: what the keyframes that can be mapped after each
        push change, mapped as they are asked for. Frames of one stamp are pushed together.
        """
        with self._run_ahead(self._perceived(session.localizer, after)) as perceived:
            for together in self._together(perceived):
                for located, detections in together:
                    if detections is not None:
                        self.late.send(detections)
                    self._deliver(session, located.frame.stamp_ns)
                    session.add_located(replace(located, awaits_detections=detections is not None))
                yield session.mapped()
        while (arrival_ns := self.late.next_arrival_ns) is not None:
            self._deliver(session, arrival_ns)
            yield session.mapped()
        yield session.closing()

    def _deliver(self, session: MappingSession, until_ns: int) -> None:
        """The detections that arrive up to a time, each at its own."""
        while (arrival_ns := self.late.next_arrival_ns) is not None and arrival_ns <= until_ns:
            session.advance(arrival_ns)
            for arrived in self.late.arrived(arrival_ns):
                session.add_detections(arrived)

    # -- pushing

    def _perceived(self, localizer: Localizer, after: Position | None) -> Iterator[Perceived]:
        return self._perception.perceive(self._located(localizer, after))

    def _located(self, localizer: Localizer, after: Position | None) -> Iterator[LocatedFrame]:
        """Poses, sweeps and frames go to the localizer in the order of time; frames with a place come out."""
        recording, chosen = self.recording, choose_frames(self.recording, self.backends.detector, self._config)
        self.frames = sum(len(recording.frame_stamps_ns(camera_id)) for camera_id in recording.cameras)
        if after is not None:
            order = {camera_id: index for index, camera_id in enumerate(recording.cameras)}
            chosen = {
                camera_id: choice.after(after[0] if order[camera_id] <= order[after[1]] else after[0] - 1)
                for camera_id, choice in chosen.items()
            }
        poses: Feed[PackedPose] = Feed(self.backends.trajectory.poses())
        with_depth = "depth" in recording.streams
        sweeps: Feed[Sweep] = Feed(iter(()) if with_depth else recording.sweeps())
        streams = [recording.frames(choice.mapped.__contains__, camera_id) for camera_id, choice in chosen.items()]
        frames = heapq.merge(*streams, key=lambda frame: frame.stamp_ns) if len(streams) > 1 else streams[0]
        while True:
            with self._clock.stage("decode"):
                frame = next(frames, None)
            if frame is None:
                break
            ahead_ns = 0 if with_depth else HALF_WINDOW_NS + LONGEST_SWEEP_NS
            for pose in poses.until(frame.stamp_ns + ahead_ns):
                localizer.add_pose(pose)
            for sweep in sweeps.until(frame.stamp_ns + HALF_WINDOW_NS):
                if sweep.stamp_ns >= frame.stamp_ns - HALF_WINDOW_NS - LONGEST_SWEEP_NS:
                    localizer.add_sweep(sweep)
            perceived = frame.stamp_ns in chosen[frame.camera_id].perceived
            localizer.add_frame(frame, awaits_detections=perceived)
            yield from localizer.located()
        yield from localizer.located(closing=True)

    def _run_ahead(self, perceived: Iterator[Perceived]) -> AbstractContextManager[Iterable[Perceived]]:
        return LookAhead(perceived) if self._look_ahead else nullcontext(perceived)

    def _together(self, perceived: Iterable[Perceived]) -> Iterator[list[Perceived]]:
        if len(self.recording.cameras) == 1:
            return ([one] for one in perceived)
        return (list(group) for _, group in groupby(perceived, key=lambda one: one[0].frame.stamp_ns))
