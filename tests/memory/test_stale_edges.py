"""Relations whose ends stand too far apart: found by `db check`, ended by `db upgrade` when the end left."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.opening import mend_edges
from supermap_cli.types.memory import MapDelta, SpatialEdge
from support import memories as m
from support.cli import document, supermap

SUITCASE, PLANT, DESK = 1, 2, 3

MONDAY = MapDelta(
    keyframes=m.keyframes([1, 2]),
    observations=tuple(
        m.observation(number, at, label)
        for number, label in ((SUITCASE, "suitcase"), (PLANT, "potted plant"), (DESK, "desk"))
        for at in (1, 2)
    ),
    instances=(
        m.instance(SUITCASE, "suitcase", seen=(1, 2), observations=2),
        m.instance(PLANT, "potted plant", (0.8, 0, 0.5), seen=(1, 2), observations=2),
        m.instance(DESK, "desk", (0, 0.8, 0.5), seen=(1, 2), observations=2),
    ),
    states=(
        m.state(SUITCASE, 0, (1, 2), label="suitcase"),
        m.state(PLANT, 0, (1, 2), (0.8, 0, 0.5), label="potted plant"),
        m.state(DESK, 0, (1, 2), (0, 0.8, 0.5), label="desk"),
    ),
    visits=tuple(m.visit(number, 2, 2, 0, (1, 2)) for number in (SUITCASE, PLANT, DESK)),
    spatial_edges=(
        m.spatial(SUITCASE, "beside", PLANT, 1),
        m.spatial(DESK, "near", SUITCASE, 1),
        m.spatial(PLANT, "near", DESK, 1),
    ),
)
TUESDAY = MapDelta(
    keyframes=m.keyframes([21, 22]),
    observations=(m.observation(SUITCASE, 21, "suitcase"), m.observation(SUITCASE, 22, "suitcase")),
    instances=(m.instance(SUITCASE, "suitcase", (13, 0, 0.5), seen=(1, 22), observations=4),),
    states=(
        m.state(SUITCASE, 0, (1, 2), gone=21, label="suitcase"),
        m.state(SUITCASE, 1, (21, 22), (13, 0, 0.5), label="suitcase"),
    ),
    visits=(m.visit(SUITCASE, 2, 2, 0, (21, 22)),),
    temporal_edges=(m.temporal("moved", (SUITCASE, 0), (SUITCASE, 1), 2, 21, distance_m=13.0),),
)


@pytest.fixture
def stale(tmp_path: Path) -> Path:
    """A suitcase that stands 13 m away on Tuesday, and is beside Monday's plant for ever."""
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MONDAY), ("tuesday", (20, 30), TUESDAY))


def problems(path: Path) -> list[str]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return [f"{problem.row}: {problem.what}" for problem in check(reader) if problem.table == "spatial_edge"]


def edges(path: Path) -> set[SpatialEdge]:
    with open_store(str(path), read_only=True) as store:
        return set(store.load_spatial_edges(open_only=False))


def test_a_relation_across_metres_is_a_problem_and_one_nearby_is_none(stale: Path) -> None:
    found = " ".join(problems(stale))
    assert "suitcase-1 beside potted-plant-1" in found
    assert "desk-1 near suitcase-1" in found
    assert "potted-plant-1 near desk-1" not in found


def test_it_ends_when_the_thing_left_and_what_holds_goes_on(stale: Path) -> None:
    assert mend_edges(str(stale)) == 2
    assert problems(stale) == []
    until = {(edge.subject, edge.object): edge.until_ns for edge in edges(stale)}
    assert until == {(SUITCASE, PLANT): m.ns(21), (DESK, SUITCASE): m.ns(21), (PLANT, DESK): None}
    assert mend_edges(str(stale)) == 0


def test_the_upgrade_mends_a_map_of_this_version_too_and_says_so(stale: Path) -> None:
    done = supermap("db", "upgrade", "--db", stale)
    assert done.exit_code == 0
    assert "2 relations" in " ".join(done.stderr.split())
    assert problems(stale) == []
    assert document("db_upgrade", "db", "upgrade", "--db", stale, "--json")["ended_relations"] == 0
