"""A recording pushed into a session as a live robot would give it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from supermap_cli.drivers.source import push_source
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.session import MappingSession
from supermap_cli.stages.session_state import SessionBackends
from supermap_cli.types.memory import coalesce
from supermap_kiss_icp import KissIcpOptions
from supermap_kiss_icp.odometry import KissIcpOdometry
from support import fakes as f
from support.synthetic_room import write_visit


@pytest.mark.parametrize("rig", ["rgbd", "lidar"])
def test_what_a_rig_gives_becomes_a_map(tmp_path: Path, rig: str) -> None:
    """The LiDAR rig has no poses: LiDAR odometry makes them while the traversal is mapped."""
    truth = write_visit(tmp_path / "room.mcap", 1, rig=rig, seconds=5.0)  # type: ignore[arg-type]
    recording = open_bag_recording(tmp_path / "room.mcap", RecordingRequest())
    odometry = KissIcpOdometry(cast("Any", recording), KissIcpOptions()) if rig == "lidar" else None
    session = MappingSession(f.config(), SessionBackends(f.FakeTracker, odometry=odometry))
    whole = coalesce(push_source(session, recording))
    assert session.state == "mapping"
    assert session.placement is not None
    assert "floor at z = 0" in session.placement.method
    assert session.statistics.without_pose <= 3
    assert len(whole.keyframes) == session.statistics.keyframes > 12
    labels = [instance.label for instance in whole.instances if instance.presence == "present"]
    true_labels = {obj.label for obj in truth.objects}
    assert len(set(labels) & true_labels) >= 3
