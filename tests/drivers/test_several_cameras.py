"""A simulated robot with three cameras, recorded and built as a user would: one map of all that its cameras saw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.evaluation.objects import ObjectScores, score_objects
from supermap_cli.evaluation.reading import read_estimate
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.recorder import RecordedScenario, record
from support import databases, simulated_traversals
from support.cli import supermap

CAMERAS = ("front", "left", "right")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedScenario:
    scenario = simulated_traversals.two_traversals(simulated_traversals.small_three_camera_rig())
    monday = replace(scenario, traversals=scenario.traversals[:1])
    return record(monday, tmp_path_factory.mktemp("three"), errors=DetectorErrors.perfect())


def build(recorded: RecordedScenario, db: Path, *options: str) -> ObjectScores:
    result = supermap("build", recorded.recordings[0], "--db", db, "--rate", "5", *options)
    assert result.exit_code == 0, result.stderr
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        assert check(reader) == []
        return score_objects(read_estimate(reader, recorded.ground_truth), recorded.ground_truth)


def test_the_map_of_three_cameras_equals_or_beats_that_of_each(recorded: RecordedScenario, tmp_path: Path) -> None:
    scores = build(recorded, tmp_path / "three.db")
    assert scores.labelled.found >= 2
    keyframes = databases.query(tmp_path / "three.db", "SELECT camera_id, count(*) FROM keyframe GROUP BY camera_id")
    assert dict(keyframes) == dict.fromkeys(CAMERAS, keyframes[0][1])
    for camera_id in ("front", "left"):  # the right one sees but a wall
        topic = f"color=/camera_{camera_id}/color/image_raw/compressed"
        alone = build(recorded, tmp_path / f"{camera_id}.db", "--topic", topic)
        assert scores.labelled.found >= alone.labelled.found


def test_inspect_lists_the_cameras(recorded: RecordedScenario) -> None:
    told = supermap("inspect", recorded.recordings[0]).stdout
    assert all(f"color.{camera_id}" in told for camera_id in CAMERAS)
