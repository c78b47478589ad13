"""What a build writes into the memory, and how it comes back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy.exc import IntegrityError

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import open_store
from supermap_cli.memory.values import Checkpoint
from supermap_cli.types.memory import MapDelta
from support import databases
from support import memories as m

CHAIR = MapDelta(
    keyframes=(m.keyframe(1), m.keyframe(2)),
    observations=(m.observation(7, 1), m.observation(7, 2)),
    instances=(m.instance(7, "chair"),),
    states=(m.state(7, 0, (1, 2)),),
    visits=(m.visit(7, 2, 2, 0, (1, 2)),),
)


def test_a_new_memory_is_empty_and_makes_no_file(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        assert store.traversals() == ()
        assert store.load_instances() == ()
        assert store.load_open_states() == ()
        assert store.load_spatial_edges() == ()
        assert list(store.keyframe_depths()) == []
        assert store.next_object_number() == 1
    assert list(tmp_path.iterdir()) == []


def test_a_traversal_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), CHAIR))

    with open_store(str(path)) as store:
        (traversal,) = store.traversals()
        (chair,) = store.load_instances()
        (state,) = store.load_states()
        frames = list(store.keyframe_depths([traversal.id]))

    assert (traversal.name, traversal.number, traversal.status, traversal.keyframes) == ("monday", 1, "complete", 2)
    assert traversal.mapped_ns == m.ns(2)
    assert traversal.timings == {"detect": 1.5}
    assert traversal.config == {"keyframes": {"rate_hz": 3.0}}
    assert (chair.number, chair.label, chair.label_belief) == (7, "chair", {"chair": 0.9, "other": 0.1})
    np.testing.assert_array_equal(chair.voxels.keys, m.voxels().keys)
    assert (state.index, state.first_seen_ns, state.gone_ns) == (0, m.ns(1), None)
    np.testing.assert_array_equal(state.box.size, m.SIZE)
    assert [frame.stamp_ns for frame in frames] == [m.ns(1), m.ns(2)]
    np.testing.assert_array_equal(frames[0].T_map_base, np.eye(4))


def test_a_state_replaces_the_one_under_its_key_and_keeps_its_row(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        m.add_traversal(
            store,
            "monday",
            (0, 10),
            CHAIR,
            MapDelta(states=(m.state(7, 0, (1, 3), gone=4), m.state(7, 1, (5, 6), (2, 0, 0.5)))),
        )
        assert [(s.index, s.last_seen_ns, s.gone_ns) for s in store.load_states([7])] == [
            (0, m.ns(3), m.ns(4)),
            (1, m.ns(6), None),
        ]
        assert [s.index for s in store.load_open_states()] == [1]


def test_overlapping_states_are_refused_and_nothing_of_the_batch_stays(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        traversal_id = store.begin_traversal(m.start("monday", (0, 10)))
        store.commit(traversal_id, CHAIR)
        with pytest.raises(IntegrityError, match="overlap"):
            store.commit(traversal_id, MapDelta(keyframes=(m.keyframe(3),), states=(m.state(7, 1, (2, 3)),)))
        assert len(list(store.keyframe_depths())) == 2


def test_an_edge_is_closed_under_its_key_and_one_that_never_held_goes(tmp_path: Path) -> None:
    objects = (m.instance(1, "cup"), m.instance(2, "table"))
    edges = (m.spatial(1, "on", 2, 1), m.spatial(1, "near", 2, 1))
    closed = (m.spatial(1, "on", 2, 1, 5), m.spatial(1, "near", 2, 1, 1))
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        m.add_traversal(store, "monday", (0, 10), MapDelta(instances=objects, spatial_edges=edges))
        m.add_traversal(store, "tuesday", (20, 30), MapDelta(spatial_edges=closed))
        assert store.load_spatial_edges() == ()
        assert [(e.relation, e.until_ns) for e in store.load_spatial_edges(open_only=False)] == [("on", m.ns(5))]


def test_text_ids_are_given_once_per_label_and_never_change(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        m.add_traversal(
            store,
            "monday",
            (0, 10),
            MapDelta(instances=(m.instance(3, "dining table"), m.instance(1, "chair"))),
            MapDelta(instances=(m.instance(3, "desk"), m.instance(5, "chair"), m.instance(6, "dining table"))),
        )
        assert store.instance_ids() == {1: "chair-1", 3: "dining-table-1", 5: "chair-2", 6: "dining-table-2"}
        assert store.next_object_number() == 7


def test_names_of_traversals_are_unique(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        for span in ((0, 10), (20, 30)):
            store.finish_traversal(store.begin_traversal(replace(m.start("monday", span), fingerprint=str(span))))
        assert [traversal.name for traversal in store.traversals()] == ["monday", "monday-2"]


def test_the_same_recording_is_refused(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), CHAIR))
    with open_store(str(path)) as store, pytest.raises(MemoryStoreError, match="already, as traversal 'monday'"):
        store.begin_traversal(m.start("monday", (0, 10)))


def test_a_discarded_traversal_leaves_the_map_as_it_was(tmp_path: Path) -> None:
    monday = MapDelta(
        keyframes=CHAIR.keyframes,
        observations=CHAIR.observations,
        instances=(*CHAIR.instances, m.instance(8, "table")),
        states=CHAIR.states,
        visits=CHAIR.visits,
        spatial_edges=(m.spatial(7, "near", 8, 1),),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), monday))
    before = databases.contents(path)
    tuesday = MapDelta(
        keyframes=(m.keyframe(21),),
        observations=(m.observation(7, 21), m.observation(9, 21)),
        instances=(m.instance(7, "sofa", merged_into=9), m.instance(9, "couch")),
        states=(m.state(7, 0, (1, 2), gone=21), m.state(9, 0, (21, 21))),
        visits=(m.visit(7, 1, 1),),
        spatial_edges=(m.spatial(7, "near", 8, 1, 21), m.spatial(9, "near", 8, 21)),
        temporal_edges=(m.temporal("moved", (7, 0), (9, 0), 2, 21, distance_m=1.0),),
    )
    with open_store(str(path)) as store:
        traversal_id = store.begin_traversal(m.start("tuesday", (20, 30)))
        store.commit(traversal_id, tuesday)
        assert databases.contents(path) != before
        store.discard_traversal(traversal_id)

    assert databases.contents(path) == before


def test_a_finished_traversal_is_not_discarded(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), CHAIR))
    with open_store(str(path)) as store, pytest.raises(MemoryStoreError, match="complete and stays"):
        store.discard_traversal(1)


@pytest.mark.parametrize("name", ["monday", "tuesday"])
def test_nothing_is_begun_beside_a_build_that_was_stopped(tmp_path: Path, name: str) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        store.commit(store.begin_traversal(m.start("monday", (0, 10))), CHAIR)
    with open_store(str(path)) as store:
        stopped = store.unfinished()
        assert stopped is not None
        assert stopped.mapped_ns == m.ns(2)
        with pytest.raises(MemoryStoreError, match="'monday' has not come to its end"):
            store.begin_traversal(m.start(name, (20, 30)))


def test_a_checkpoint_replaces_the_last_one_and_goes_with_the_build(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        traversal_id = store.begin_traversal(m.start("monday", (0, 10)))
        assert store.checkpoint(traversal_id) is None
        store.commit(traversal_id, CHAIR, Checkpoint(m.ns(1), {"engine": b"one", "tracker": b"two"}))
        store.commit(traversal_id, MapDelta(keyframes=(m.keyframe(3),)), Checkpoint(m.ns(3), {"engine": b"three"}))
        assert store.checkpoint(traversal_id) == Checkpoint(m.ns(3), {"engine": b"three"})
        store.finish_traversal(traversal_id)
        assert store.checkpoint(traversal_id) is None
        assert store.unfinished() is None


def test_what_a_build_warned_of_is_stored_with_its_traversal(tmp_path: Path) -> None:
    warnings = ("no IMU: sweeps are not deskewed", "12 frames without a pose")
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        store.finish_traversal(store.begin_traversal(m.start("monday", (0, 10))), {"detect": 1.5}, warnings)
        store.finish_traversal(store.begin_traversal(m.start("tuesday", (20, 30))))
        assert [traversal.warnings for traversal in store.traversals()] == [warnings, ()]


def test_a_recording_may_be_built_once_more(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), CHAIR))
    with open_store(str(path)) as store:
        store.finish_traversal(store.begin_traversal(m.start("monday", (20, 30)), again=True))
        assert [traversal.name for traversal in store.traversals()] == ["monday", "monday-2"]


def test_a_killed_build_is_taken_out_when_another_recording_follows(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        store.commit(store.begin_traversal(m.start("monday", (0, 10))), CHAIR)
    with open_store(str(path)) as store:
        assert store.roll_back_unfinished() == ("monday",)
        assert store.load_instances() == ()
        m.add_traversal(store, "tuesday", (20, 30))
        assert [(traversal.name, traversal.status) for traversal in store.traversals()] == [("tuesday", "complete")]


def test_a_database_made_in_vain_is_removed(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        store.commit(store.begin_traversal(m.start("monday", (0, 10))), CHAIR)
        assert store.discard_if_created()
    assert list(tmp_path.iterdir()) == []


def test_a_database_with_a_complete_traversal_is_never_removed(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        m.add_traversal(store, "monday", (0, 10), CHAIR)
        assert not store.discard_if_created()
    with open_store(str(tmp_path / "map.db"), read_only=True) as store:
        assert len(store.traversals()) == 1


def test_observations_are_never_changed_or_deleted(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), CHAIR))
    with pytest.raises(databases.refusals(), match="never changed"):
        m.run_sql(path, "UPDATE observation SET score = 1")
    with pytest.raises(databases.refusals(), match="never deleted"):
        m.run_sql(path, "DELETE FROM observation")


def test_an_observation_without_its_keyframe_is_a_bug(tmp_path: Path) -> None:
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        traversal_id = store.begin_traversal(m.start("monday", (0, 10)))
        with pytest.raises(ValueError, match="no keyframe"):
            store.commit(traversal_id, MapDelta(instances=CHAIR.instances, observations=CHAIR.observations))


def test_how_far_things_moved_is_what_their_places_say_in_the_end(tmp_path: Path) -> None:
    states = (m.state(7, 0, (1, 2), (0, 0, 0.5), gone=4), m.state(7, 1, (5, 6), (2, 0, 0.5)))
    moved = m.temporal("moved", (7, 0), (7, 1), 2, 5, distance_m=1.5)
    with open_store(str(tmp_path / "map.db"), create=True) as store:
        m.add_traversal(store, "monday", (0, 10), CHAIR, MapDelta(states=states, temporal_edges=(moved,)))
        with store.reader() as reader:
            assert [edge.distance_m for edge in reader.temporal_edges()] == [2.0]
        seen_again = m.state(7, 1, (5, 21), (2.25, 0, 0.5))
        m.add_traversal(
            store, "tuesday", (20, 30), MapDelta(states=(seen_again,), visits=(m.visit(7, 1, 1, seen=(21, 21)),))
        )
        with store.reader() as reader:
            assert [edge.distance_m for edge in reader.temporal_edges()] == [2.25]
