"""Point clouds in other units than metres, without points, and without coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.bag_recording import BagRecording
from supermap_cli.recordings.inspection import inspect_recording
from support import bags

FRAME = "camera_optical_frame"


def grid(scale: float = 1.0, kind: str = "<f4") -> np.ndarray:
    """A wall 3 m ahead of the LiDAR."""
    y, z = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-1, 1, 21))
    records = np.zeros(y.size, np.dtype([("x", kind), ("y", kind), ("z", kind)]))
    for axis, values in (("x", np.full(y.size, 3.0)), ("y", y.ravel()), ("z", z.ravel())):
        records[axis] = np.round(values * scale) if kind[1] == "i" else values * scale
    return records


def write(path: Path, clouds: dict[str, np.ndarray]) -> Path:
    with bags.BagWriter(path) as bag:
        bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
        bag.transform(bags.START_NS, "base_link", "lidar", np.eye(4), static=True)
        for index in range(12):
            at = bags.stamp(index)
            bags.write_images(bag, index)
            bag.odometry("/odom", at, bags.pose_at(index))
            for topic, records in clouds.items():
                bag.points(topic, at, "lidar", records)
    return path


def open_(path: Path) -> BagRecording:
    return open_bag_recording(path, RecordingRequest())


@pytest.mark.parametrize(
    ("scale", "kind", "unit"),
    [
        (1.0, "<f4", None),
        (1.0, "<f8", None),
        (1e3, "<f4", "millimetres"),
        (1e3, "<i4", "millimetres"),
        (1e2, "<i2", "centimetres"),
    ],
)
def test_points_are_brought_to_metres_and_that_is_said(
    tmp_path: Path, scale: float, kind: str, unit: str | None
) -> None:
    recording = open_(write(tmp_path / "run.mcap", {"/points": grid(scale, kind)}))
    np.testing.assert_allclose(np.ptp(next(recording.sweeps()).points_lidar, axis=0), [0, 4, 2], atol=0.02)
    assert next(recording.sweeps()).points_lidar[0, 0] == pytest.approx(3.0)
    said = [line for line in recording.warnings if "brought to metres" in line]
    assert (bool(said), unit is None or unit in said[0]) == (unit is not None, True)


def test_clouds_without_coordinates_are_no_lidar_where_there_is_another(tmp_path: Path) -> None:
    intensity = np.zeros(100, np.dtype([("intensity", "<f4"), ("ring", "<u2")]))
    path = write(tmp_path / "run.mcap", {"/a_points": intensity, "/points": grid()})
    assert [role.topic for role in inspect_recording(path, RecordingRequest()).roles if role.role == "lidar"] == [
        "/points"
    ]
    alone = inspect_recording(write(tmp_path / "alone.mcap", {"/a_points": intensity}), RecordingRequest())
    assert alone.can_build
    assert any("/a_points: left out" in line and "without x, y, z" in line for line in alone.warnings)


def test_clouds_of_nothing_but_nan_are_named(tmp_path: Path) -> None:
    empty = grid()
    for axis in "xyz":
        empty[axis] = np.nan
    recording = open_(write(tmp_path / "run.mcap", {"/points": empty}))
    assert list(recording.sweeps()) == []
    assert any("none of the 3 clouds looked at holds a point" in line for line in recording.warnings)
