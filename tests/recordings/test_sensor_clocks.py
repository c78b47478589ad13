"""The clocks of a robot's sensors: which are off, and which sensors are only recorded late."""

import numpy as np
import pytest

from supermap_cli.errors import ConfigError
from support import bags
from support.rigs import mount, open_, problems_of


def write_clocks(path, *, lidar_s=0.0, late_s=0.01, jitter_s=0.0):
    rng = np.random.default_rng(1)
    with bags.BagWriter(path) as bag:
        mount(bag)
        bag.transform(bags.START_NS, "base_link", "lidar", np.eye(4), static=True)
        for index in range(30):
            at = bags.stamp(index)
            bags.write_images(bag, index)
            bag.odometry("/odom", at, bags.pose_at(index))
            late_ns = round((late_s + jitter_s * rng.random()) * 1e9)
            bag.points("/points", at + round(lidar_s * 1e9), "lidar", bags.wall_points(index), log_ns=at + late_ns)
    return path


@pytest.mark.parametrize("apart_s", [37.0, 2.4, 7200.0, -37.0, -1_699_990_000.25])
def test_another_clock_is_brought_onto_the_cameras(tmp_path, apart_s):
    recording = open_(write_clocks(tmp_path / "run.mcap", lidar_s=apart_s))
    assert [sweep.stamp_ns for sweep in recording.sweeps()] == pytest.approx(
        [bags.stamp(index) for index in range(30)], abs=20_000_000
    )
    assert any("/points: its clock is" in line for line in recording.warnings)


@pytest.mark.parametrize(("late_s", "jitter_s"), [(1.5, 0.3), (2.0, 0.0), (12.0, 0.0)])
def test_a_sensor_that_is_recorded_late_is_refused_until_the_user_decides(tmp_path, late_s, jitter_s):
    path = write_clocks(tmp_path / "run.mcap", late_s=late_s, jitter_s=jitter_s)
    (problem,) = problems_of(path)
    assert "recorded late" in problem
    assert "--clock /points=0" in problem
    kept = open_(path, clocks={"/points": 0.0})
    assert next(kept.sweeps()).stamp_ns == bags.stamp(0)
    moved = open_(path, clocks={"/points": 0.5})
    assert next(moved.sweeps()).stamp_ns == bags.stamp(0) + 500_000_000


def test_a_slow_link_is_no_other_clock(tmp_path):
    recording = open_(write_clocks(tmp_path / "run.mcap", late_s=0.9, jitter_s=0.9))
    assert next(recording.sweeps()).stamp_ns == bags.stamp(0)


def test_a_clock_of_no_topic_is_an_error(tmp_path):
    path = write_clocks(tmp_path / "run.mcap")
    with pytest.raises(ConfigError, match=r"--clock /nothing: there are no messages"):
        open_(path, clocks={"/nothing": 1.0})
