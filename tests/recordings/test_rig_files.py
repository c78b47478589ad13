"""A robot described once: a rig's TOML file, a URDF, and how to record one like it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.commands.rig_file import read_rig
from supermap_cli.errors import ConfigError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.opening import open_recording
from supermap_cli.recordings.record_profile import record_profile
from support import bags
from support.cli import supermap

FRAME = "camera_optical_frame"
URDF = """<?xml version="1.0"?>
<robot name="rover" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"/><link name="camera_link"/><link name="camera_optical_frame"/><link name="wheel"/>
  <joint name="wheel" type="continuous"><parent link="base_link"/><child link="wheel"/></joint>
  <joint name="mast" type="fixed">
    <parent link="base_link"/><child link="camera_link"/><origin xyz="0.1 0 1.2" rpy="0 0.2 0"/>
  </joint>
  <joint name="optical" type="fixed">
    <parent link="camera_link"/><child link="camera_optical_frame"/><origin rpy="-1.5707963 0 -1.5707963"/>
  </joint>
</robot>
"""


JOINTS = f"""[fixed_joints]
camera_link = "base_link 0.1 0 1.2 0 0.2 0"
{FRAME} = "camera_link 0 0 0 -1.5707963 0 -1.5707963"
"""


def record(path: Path, *, mounted: bool = False) -> Path:
    with bags.BagWriter(path) as bag:
        for index in range(6):
            bags.write_images(bag, index)
            bag.odometry("/odom", bags.stamp(index), bags.pose_at(index))
        if mounted:
            bag.transform(bags.START_NS, "base_link", FRAME, bags.T_BASE_OPTICAL, static=True)
    return path


def mounting(path: Path, **request: object) -> np.ndarray:
    recording = open_bag_recording(path, RecordingRequest(**request))  # type: ignore[arg-type]
    return next(recording.frames()).T_base_camera


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return record(tmp_path / "run.mcap")


def test_a_urdf_says_where_sensors_sit_that_tf_does_not_place(run: Path, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(URDF)
    T = mounting(run, **read_rig(tmp_path / "robot.urdf"))
    assert np.allclose(T[:3, 3], [0.1, 0, 1.2])
    assert np.allclose(T[:3, 2], [np.cos(0.2), 0, -np.sin(0.2)], atol=1e-6)


def test_the_cure_of_a_missing_mounting_names_the_urdf_and_it_works(run: Path, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(URDF)
    refused = supermap("inspect", run)
    assert refused.exit_code == 1
    assert "--rig robot.urdf" in " ".join(refused.output.split())
    mended = supermap("inspect", run, "--rig", tmp_path / "robot.urdf")
    assert mended.exit_code == 0, mended.output
    assert "TF lacks base_link -> camera_link" in " ".join(mended.output.split())


def test_tf_counts_before_a_urdf(tmp_path: Path) -> None:
    run = record(tmp_path / "run.mcap", mounted=True)
    (tmp_path / "robot.urdf").write_text(URDF)
    assert np.allclose(mounting(run, **read_rig(tmp_path / "robot.urdf")), bags.T_BASE_OPTICAL)


@pytest.mark.parametrize(
    "text",
    [
        '[mounts]\ncamera = "0.1 0 1.2 0 0.2 0"\n',
        '[mount]\ncamera = "0.1 0 1.2 0 0.2 0"\n',
        '[build.recording.mounts]\ncamera = "0.1 0 1.2 0 0.2 0"\n',
        'urdf = "robot.urdf"\n',
        JOINTS,
    ],
    ids=["mounts", "mount", "supermap.toml", "urdf", "fixed joints"],
)
def test_a_rig_says_what_the_options_say(run: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "robot.urdf").write_text(URDF)
    (tmp_path / "rig.toml").write_text(text)
    wanted = mounting(run, mounts={"camera": "0.1 0 1.2 0 0.2 0"})
    assert np.allclose(mounting(run, **read_rig(tmp_path / "rig.toml")), wanted, atol=1e-6)


def test_options_are_laid_over_the_rig(run: Path, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text('robot = "r9"\n[mounts]\ncamera = "9 9 9 0 0 0"\n')
    told = supermap("inspect", run, "--rig", tmp_path / "rig.toml", "--mount", "camera=0.1 0 1.2 0 0.2 0")
    assert "9 9 9" not in told.output
    assert "r9" in str(told.exception) + told.output


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("rig.toml", "mounts = 3\n", "mounts: "),
        ("rig.toml", "wings = 2\n", "wings: .*topics, frames, mounts"),
        ("rig.toml", "[mounts\n", "not a TOML file"),
        ("rig.toml", '[mounts]\ncamera = "a b c"\n', "is not understood"),
        ("rig.toml", 'urdf = "none.urdf"\n', "the URDF cannot be read"),
        ("rig.toml", "build = 3\n", "build: "),
        ("robot.urdf", "<robot>", "no XML"),
        ("robot.urdf", "<sdf/>", "begins with <sdf>"),
        ("robot.urdf", "<robot/>", "no fixed joint"),
        ("robot.urdf", '<robot><joint name="a" type="fixed"/></robot>', "'a' has no parent link"),
        ("robot.urdf", '<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "declares entities"),
        ("robot.urdf.xacro", '<robot><xacro:include filename="x"/></robot>', r"xacro FILE > robot.urdf"),
        ("robot.urdf", URDF.replace("0.1 0 1.2", "0.1 0"), "fixed_joints: camera_link.*is not understood"),
    ],
)
def test_a_bad_rig_is_one_line(run: Path, tmp_path: Path, name: str, text: str, what: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigError, match=what):
        mounting(run, **read_rig(tmp_path / name))


def test_a_rig_that_is_not_there_is_one_line(run: Path, tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path / "none.urdf", tmp_path):
        assert isinstance(supermap("inspect", run, "--rig", path).exception, ConfigError)


# Recording one like it -----------------------------------------------------------------------------------------------


def test_a_profile_names_the_topics_that_a_build_uses_and_no_others(tmp_path: Path) -> None:
    run = record(tmp_path / "run.mcap", mounted=True)
    profile = record_profile(open_recording(run, RecordingRequest()))
    assert {"/odom", "/tf_static"} <= set(profile.topics)
    assert not profile.ros1
    assert profile.latched == ("/tf_static",)
    assert "/tf" not in profile.topics, "the motion is odometry's, and the mounting static"


def test_a_profile_is_a_script_that_a_shell_understands(tmp_path: Path) -> None:
    run = record(tmp_path / "run.mcap", mounted=True)
    script = supermap("record-profile", run).stdout
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "ros2").write_text('#!/bin/sh\nprintf "%s\\n" "$@" > said.txt\n')
    (tmp_path / "bin" / "ros2").chmod(0o755)
    path = f"{tmp_path / 'bin'}:/usr/bin:/bin"
    subprocess.run(["/bin/sh", "-c", script], check=True, cwd=tmp_path, env={"PATH": path}, timeout=60)
    said = (tmp_path / "said.txt").read_text().split("\n")
    assert said[:4] == ["bag", "record", "--storage", "mcap"]
    assert "/odom" in said
    assert (tmp_path / "record_qos.yaml").read_text().startswith("/tf_static:\n  history: keep_all\n")


def test_what_the_recording_lacks_is_said(run: Path) -> None:
    told = supermap("record-profile", run)
    assert "/tf_static" in told.stdout, "recorded in any case"
    assert "this recording has no /tf_static" in told.stderr


def test_a_ros_1_robot_is_recorded_with_rosbag(tmp_path: Path) -> None:
    told = supermap("record-profile", record(tmp_path / "run.bag", mounted=True))
    assert told.stdout.startswith("rosbag record --lz4 /")
    assert "qos" not in told.stdout
