"""Where a recording's odometry stands in the map, by images spread over all of it: what a build begins with, and what
`supermap localize` tells.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.backends import choose_odometry
from supermap_cli.drivers.prior_map import earlier_traversals
from supermap_cli.errors import AlignmentError, MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.trajectory import PackedPose, Trajectory
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.memory.store import MapStore
from supermap_cli.parameters import MethodParameters
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Recording
from supermap_cli.stages.map_registration import EarlierTraversals, MapRegistration, Placement
from supermap_cli.stages.sweep_buffer import HALF_WINDOW_NS, LONGEST_SWEEP_NS, SweepBuffer
from supermap_cli.types.sensing import CameraFrame, Sweep

SPREAD_FRAMES = 30
"""Images, spread over a recording and its cameras, by which it is levelled and aligned."""

T = TypeVar("T", PackedPose, Sweep)


@dataclass(frozen=True)
class LocalizedRecording:
    """A recording in a map: `T_map_odom` (4, 4) with how it was found, and the recording's last pose in the map,
    `T_map_base` (4, 4) at `last_ns` (the recording's own clock).
    """

    placement: Placement
    T_map_base: FloatArray
    last_ns: int
    odometry: str


def localize_recording(
    recording: Recording, plugins: Plugins, config: BuildConfig, store: MapStore, request: str = "auto"
) -> LocalizedRecording:
    """Where a further recording stands in a map, by the registration that a build does; nothing is written.

    Raises `MemoryStoreError` for an empty map, `AlignmentError` where it cannot be told with confidence.
    """
    parameters = MethodParameters.from_overrides(config.parameters).mapping
    earlier = earlier_traversals(store, parameters.structure)
    if not earlier.T_map_odom:
        raise MemoryStoreError("the map is empty: there is nothing to localize in", cure="supermap build it first")
    name, trajectory = choose_odometry(recording, plugins, config)
    placement = place_recording(recording, trajectory, request, earlier, parameters)
    last = None
    for last in trajectory.poses():  # noqa: B007 - the last one is wanted
        pass
    T_odom_base = None if last is None else trajectory.at(last.stamp_ns)
    if last is None or T_odom_base is None:
        raise AlignmentError(
            "the recording has no pose", where=str(recording.path), cure="see `supermap inspect` for its odometry"
        )
    return LocalizedRecording(placement, placement.T_map_odom @ T_odom_base, last.stamp_ns, name)


def place_recording(
    recording: Recording,
    trajectory: Trajectory,
    request: str,
    earlier: EarlierTraversals,
    parameters: MappingParameters,
) -> Placement:
    """Where a recording's odometry stands in the map. Raises `AlignmentError` if it cannot be told with confidence."""
    registration = MapRegistration(trajectory, request, earlier, parameters, max_sweeps=math.inf)
    sweeps = Feed(iter(()) if "depth" in recording.streams else recording.sweeps())
    buffer = SweepBuffer(trajectory)
    for frame in _spread_frames(recording):
        T_odom_base = trajectory.at(frame.stamp_ns)
        if T_odom_base is None:
            continue
        for sweep in sweeps.until(frame.stamp_ns + HALF_WINDOW_NS):
            registration.add_sweep(sweep)
            if sweep.stamp_ns >= frame.stamp_ns - HALF_WINDOW_NS - LONGEST_SWEEP_NS:
                buffer.add(sweep)
        seen = frame if "depth" in recording.streams else buffer.complete(frame)
        registration.add_frame(seen, T_odom_base)
        buffer.forget_before(frame.stamp_ns)
    return registration.place(recording.imu() if "imu" in recording.streams else ())


def _spread_frames(recording: Recording) -> Iterator[CameraFrame]:
    cameras = recording.cameras
    streams = []
    for camera_id in cameras:
        stamps = recording.frame_stamps_ns(camera_id)
        count = min(max(SPREAD_FRAMES // len(cameras), 1), len(stamps))
        spread = np.unique(np.linspace(0, len(stamps) - 1, count).astype(np.int64))
        streams.append(recording.frames(frozenset(stamps[spread].tolist()).__contains__, camera_id))
    return heapq.merge(*streams, key=lambda frame: frame.stamp_ns)


class Feed(Generic[T]):
    """A stream that is taken as far as a stamp, and one item beyond."""

    def __init__(self, items: Iterator[T]) -> None:
        self._items: Iterator[T] = items
        self._newest_ns: int | None = None

    def until(self, stamp_ns: int) -> Iterator[T]:
        """The items up to a stamp, and the first one after it."""
        while self._newest_ns is None or self._newest_ns <= stamp_ns:
            item = next(self._items, None)
            if item is None:
                return
            self._newest_ns = item.stamp_ns
            yield item
