"""LiDARs whose stamps lie seconds before the camera's: another clock, or recorded late, by how it turned."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.bag_recording import BagRecording
from supermap_cli.recordings.clock_by_motion import turn_between
from supermap_cli.recordings.inspection import inspect_recording
from support import bags

FRAME = "camera_optical_frame"
FRAMES = 250
WALLS_M = np.array([-2.0, 3.5, -1.5, 2.5])
"""x from, x to, y from, y to of the room, the robot at its origin."""


def heading(index: float, *, turns: bool = True) -> float:
    """Radians, of frame `index`: it looks about, now faster and now slower."""
    return 1.2 * np.sin(index / 19) + 0.5 * np.sin(index / 7.3) if turns else 0.0


def turned(yaw: float) -> np.ndarray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return make_transform([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], [0, 0, 0])


def sweep(yaw: float) -> np.ndarray:
    """(n, 3) the room's walls from its middle, as a LiDAR sees them that is turned by `yaw`; two degrees apart."""
    azimuths = np.deg2rad(np.arange(0, 360, 2.0))
    x, y = np.cos(azimuths + yaw), np.sin(azimuths + yaw)
    with np.errstate(divide="ignore", over="ignore"):
        to_x = np.abs(np.where(x > 0, WALLS_M[1], WALLS_M[0]) / x)
        reach = np.minimum(to_x, np.abs(np.where(y > 0, WALLS_M[3], WALLS_M[2]) / y))
    rings = np.array([-0.2, 0.0, 0.2])
    return np.concatenate(
        [np.column_stack([reach * np.cos(azimuths), reach * np.sin(azimuths), reach * ring]) for ring in rings]
    )


def write(path: Path, *, clock_s: float = 0.0, late_s: float = 0.01, turns: bool = True, tf: bool = False) -> Path:
    """A robot that looks about, its LiDAR stamped by a clock that is off, or recorded late."""
    with bags.BagWriter(path) as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        bag.transform(bags.START_NS, "base_link", "lidar", np.eye(4), static=True)
        for index in range(FRAMES):
            at, yaw = bags.stamp(index), heading(index, turns=turns)
            if index % 5 == 0:
                bags.write_images(bag, index)
            if tf:
                bag.transform(at, "odom", "base_link", turned(yaw))
            else:
                bag.odometry("/odom", at, turned(yaw))
            stamp_ns, log_ns = at + round(clock_s * 1e9), at + round(late_s * 1e9)
            points = np.zeros(540, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
            points["x"], points["y"], points["z"] = sweep(yaw).T
            bag.points("/points", stamp_ns, "lidar", points, log_ns=log_ns)
    return path


def open_(path: Path, **request: object) -> BagRecording:
    return open_bag_recording(path, RecordingRequest(**request))


@pytest.mark.parametrize("tf", [False, True])
@pytest.mark.parametrize("late_s", [1.7, 12.0])
def test_sweeps_that_are_recorded_late_keep_their_stamps(tmp_path: Path, late_s: float, tf: bool) -> None:
    recording = open_(write(tmp_path / "run.mcap", late_s=late_s, tf=tf))
    assert next(recording.sweeps()).stamp_ns == bags.stamp(0)
    assert any("are recorded late" in line for line in recording.warnings)


@pytest.mark.parametrize("clock_s", [-1.7, -12.0])
def test_sweeps_of_another_clock_are_brought_onto_the_cameras(tmp_path: Path, clock_s: float) -> None:
    recording = open_(write(tmp_path / "run.mcap", clock_s=clock_s))
    assert next(recording.sweeps()).stamp_ns == pytest.approx(bags.stamp(0), abs=20_000_000)
    assert any("are added to its stamps" in line for line in recording.warnings)


@pytest.mark.parametrize("late_s", [1.7, 12.0])
def test_without_turns_the_user_decides(tmp_path: Path, late_s: float) -> None:
    path = write(tmp_path / "run.mcap", late_s=late_s, turns=False)
    (problem,) = inspect_recording(path, RecordingRequest()).problems
    assert "recorded late" in problem.what
    assert problem.cure is not None
    assert "--clock /points=0" in problem.cure
    assert f"--clock /points={late_s:.1f}" in problem.cure
    assert next(open_(path, clocks={"/points": 0.0}).sweeps()).stamp_ns == bags.stamp(0)


@settings(max_examples=25, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-0.7, 0.7))
def test_the_turn_between_two_sweeps_is_measured_to_a_degree(yaw: float, turn: float) -> None:
    assert turn_between(sweep(yaw), sweep(yaw + turn)) == pytest.approx(turn, abs=np.deg2rad(1.0))


def test_a_round_room_tells_no_turn() -> None:
    azimuths = np.deg2rad(np.arange(360.0))
    circle = np.column_stack([3 * np.cos(azimuths), 3 * np.sin(azimuths), np.zeros(360)])
    assert turn_between(circle, circle) is None


def test_turns_of_several_sweeps_add_up() -> None:
    yaws = [0.1, 0.4, 0.2, 0.5]
    added = sum(turn_between(sweep(a), sweep(b)) or 0.0 for a, b in pairwise(yaws))
    assert added == pytest.approx(turn_between(sweep(yaws[0]), sweep(yaws[-1])), abs=np.deg2rad(2.0))
