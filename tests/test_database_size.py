"""A map is a small part of the recordings it was made of."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.recorder import record
from supermap_cli.simulation.rigs import rgbd_rig
from support import simulated_traversals
from support.cli import supermap

SHARE = 0.03


def test_a_map_takes_three_percent_of_its_recordings_at_most(tmp_path: Path) -> None:
    recordings = record(simulated_traversals.two_traversals(rgbd_rig()), tmp_path, errors=DetectorErrors()).recordings
    for recording in recordings:
        result = supermap("build", recording, "--db", tmp_path / "map.db")
        assert result.exit_code == 0, result.output
    recorded = sum(path.stat().st_size for path in recordings)
    assert (tmp_path / "map.db").stat().st_size <= SHARE * recorded
    assert not (tmp_path / "map.db-wal").exists()
