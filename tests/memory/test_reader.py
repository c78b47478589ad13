"""What questions read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from supermap_cli.memory import open_store
from supermap_cli.types.memory import MapDelta
from support import memories as m

MERGED = MapDelta(
    keyframes=(m.keyframe(1, x=0.5), m.keyframe(2, x=1.5)),
    instances=(m.instance(1, "chair"), m.instance(2, "chair", merged_into=1), m.instance(3, "table")),
    observations=(m.observation(1, 1), m.observation(2, 2), m.observation(3, 2)),
    states=(m.state(1, 0, (1, 2)), m.state(3, 0, (2, 2))),
    visits=(m.visit(1, 1, 2, 0, (1, 1)), m.visit(2, 1, 1, 0, (2, 2))),
    spatial_edges=(m.spatial(2, "near", 3, 1), m.spatial(1, "near", 2, 1)),
)


def test_what_was_merged_counts_for_its_survivor(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MERGED))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        chair, table = reader.instances
        assert (chair.id, chair.numbers, table.id) == ("chair-1", (1, 2), "table-1")
        visit = chair.visit(1)
        assert (visit.supported, visit.in_view) == (2, 3)
        assert (visit.first_support_ns, visit.last_support_ns) == (m.ns(1), m.ns(2))
        assert [observation.stamp_ns for observation in reader.observations(chair)] == [m.ns(1), m.ns(2)]
        assert [(e.subject, e.object) for e in reader.edges_of([3])] == [(1, 3)]
        named = reader.instance("Chair-2")
        assert named is not None
        assert (named.number, named.visits) == (chair.number, chair.visits)
        assert reader.instance("piano-1") is None


def test_what_was_merged_counts_for_its_survivor_where_both_are_named(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MERGED))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert reader.parts_of([1, 2, 3]) == reader.parts_of([2, 3, 1]) == {1: 1, 2: 1, 3: 3}
        chair = reader.instances_by_number([1, 2], [1])[1]
        assert (chair.visit(1).supported, chair.visit(1).in_view) == (2, 3)


def test_a_relation_that_only_the_merged_part_lost_is_kept(tmp_path: Path) -> None:
    edges = (m.spatial(1, "near", 3, 1), m.spatial(2, "near", 3, 1, 2))
    for order in (edges, edges[::-1]):
        path = m.make_memory(
            tmp_path / f"{order[0].subject}.db", ("monday", (0, 10), replace(MERGED, spatial_edges=order))
        )
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            assert [(e.subject, e.object, e.until_ns) for e in reader.edges_of([3])] == [(1, 3, None)]


def test_the_trajectory_is_where_the_robot_was(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MERGED))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        stamps_ns, positions = reader.trajectory(1)
        assert reader.now_ns == m.ns(2)
    np.testing.assert_array_equal(stamps_ns, [m.ns(1), m.ns(2)])
    np.testing.assert_array_equal(positions, [[0.5, 0, 0], [1.5, 0, 0]])
