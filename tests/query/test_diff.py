"""Changes between two traversals or times, and what is never reported as a change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.labelled_observations import LabelledObservations
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.diff import ObjectChange, diff
from supermap_cli.query.object_history import object_history
from supermap_cli.types.memory import InstanceRecord, MapDelta, StateRecord, Visit
from support import kitchen
from support import memories as m


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


def test_every_instance_has_a_change_kind(reader: MapReader) -> None:
    found = diff(reader)
    assert {change.id: change.kind for change in found.changes} == {
        "vase-1": "appeared",
        "cup-1": "disappeared",
        "chair-1": "moved",
        "dining-table-1": "unchanged",
        "tv-1": "unchanged",
        "potted-plant-1": "unchanged",
        "chair-2": "not observed again",
        "book-1": "not observed again",
        "lamp-1": "first observed",
    }
    assert found.counts["unchanged"] == 3


def test_changes_have_bounds_distances_and_evidence(reader: MapReader) -> None:
    changes = {change.id: change for change in diff(reader).changes}
    cup, chair, vase = changes["cup-1"], changes["chair-1"], changes["vase-1"]
    assert (cup.not_before_ns, cup.not_after_ns, cup.confidence) == (m.ns(90), m.ns(1005), 0.9)
    assert (cup.evidence_before.observation_count, cup.evidence_after.contradicted) == (3, 3)
    assert (chair.distance_m, chair.position_before) == (pytest.approx(3.6056), (0.0, 1.0, 0.5))
    assert (vase.not_before_ns, vase.not_after_ns) == (m.ns(90), m.ns(1001))
    assert [(candidate.id, candidate.probability) for candidate in vase.may_be] == [("cup-1", 0.2)]


def test_reasons_tell_whether_the_place_was_in_view(reader: MapReader) -> None:
    reasons = {change.id: change.reason for change in diff(reader).changes}
    assert "never in view in tuesday" in reasons["book-1"]
    assert "in view in 2 keyframes and never seen empty" in reasons["chair-2"]
    assert reasons["lamp-1"] == "nobody had seen its place empty in monday"


def test_traversals_are_named_by_name_or_number_and_put_in_order(reader: MapReader) -> None:
    for names in ((None, None), ("monday", "tuesday"), ("2", "1"), ("Monday", None)):
        found = diff(reader, *names)
        assert (found.before.name, found.after.name) == ("monday", "tuesday")


@pytest.mark.parametrize("names", [("monday", "monday"), ("sunday", None), ("1", "3")])
def test_a_diff_needs_two_known_traversals(reader: MapReader, names: tuple[str, str | None]) -> None:
    with pytest.raises(QueryError):
        diff(reader, *names)


def only_change(
    path: Path,
    states: tuple[StateRecord, ...],
    visits: tuple[Visit | None, Visit | None],
    instance: InstanceRecord | None = None,
    deltas: tuple[MapDelta, MapDelta] = (MapDelta(), MapDelta()),
) -> ObjectChange | None:
    """The change of one chair with a visit in each of two traversals (0-10 s and 100-110 s)."""
    chair = instance or m.instance(1, "chair", seen=(1, 105))
    with open_store(str(path), create=True) as store:
        for at, name, visit, delta in zip((0, 100), ("a", "b"), visits, deltas, strict=True):
            traversal_id = store.begin_traversal(m.start(name, (at, at + 10)))
            store.commit(traversal_id, MapDelta(instances=(chair,), visits=() if visit is None else (visit,)))
            store.commit(traversal_id, delta)
            if name == "b":
                store.commit(traversal_id, MapDelta(states=states))
            store.finish_traversal(traversal_id)
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        changes = diff(reader).changes
    return changes[0] if changes else None


SEEN = m.visit(1, 3, 3)
NOT_VISITED = None
IN_VIEW = m.visit(1, 0, 2)
CONTRADICTED_ONCE = m.visit(1, 0, 3, 1)


@pytest.mark.parametrize(
    ("states", "visits", "kind"),
    [
        ((m.state(1, 0, (1, 105)),), (SEEN, SEEN), "unchanged"),
        ((m.state(1, 0, (1, 9)),), (SEEN, NOT_VISITED), "not observed again"),
        ((m.state(1, 0, (1, 9)),), (SEEN, IN_VIEW), "not observed again"),
        ((m.state(1, 0, (1, 9)),), (SEEN, CONTRADICTED_ONCE), "not observed again"),
        ((m.state(1, 0, (1, 9), gone=101),), (SEEN, IN_VIEW), "disappeared"),
        ((m.state(1, 0, (1, 5), gone=8),), (SEEN, IN_VIEW), "at neither"),
        ((m.state(1, 0, (1, 105), gone=107),), (SEEN, SEEN), "disappeared"),
        ((m.state(1, 0, (1, 9), gone=200),), (SEEN, IN_VIEW), "not observed again"),
        ((m.state(1, 0, (101, 105)),), (NOT_VISITED, SEEN), "first observed"),
        ((m.state(1, 0, (101, 105)),), (IN_VIEW, SEEN), "first observed"),
        ((m.state(1, 0, (101, 105), empty_before=9),), (IN_VIEW, SEEN), "appeared"),
        ((m.state(1, 0, (101, 105), empty_before=100.5),), (NOT_VISITED, SEEN), "appeared"),
        ((m.state(1, 0, (101, 105), empty_before=-50),), (NOT_VISITED, SEEN), "appeared"),
        ((m.state(1, 0, (1, 5), gone=6), m.state(1, 1, (101, 105), (3, 0, 0.5))), (SEEN, SEEN), "moved"),
        ((m.state(1, 0, (1, 5), gone=6), m.state(1, 1, (101, 105))), (SEEN, SEEN), "appeared"),
        ((m.state(1, 0, (1, 5), gone=50), m.state(1, 1, (101, 105))), (SEEN, SEEN), "unchanged"),
        ((m.state(1, 0, (-90, -80)), m.state(1, 1, (101, 105), (3, 0, 0.5))), (NOT_VISITED, SEEN), "moved"),
        ((m.state(1, 0, (-90, 105)),), (NOT_VISITED, SEEN), "unchanged"),
        ((m.state(1, 0, (1, 205)),), (SEEN, NOT_VISITED), "unchanged"),
        ((m.state(1, 0, (1, 9), gone=101),), (NOT_VISITED, NOT_VISITED), "disappeared"),
        ((m.state(1, 0, (102, 103), gone=104),), (NOT_VISITED, SEEN), "disappeared"),
        ((m.state(1, 0, (102, 103), gone=104, empty_before=5),), (NOT_VISITED, SEEN), "at neither"),
        ((m.state(1, 0, (-90, -80)),), (NOT_VISITED, NOT_VISITED), "not looked at"),
        ((m.state(1, 0, (-90, -80), gone=-70),), (NOT_VISITED, NOT_VISITED), None),
    ],
)
def test_the_change_kind_follows_from_states_and_visits(
    tmp_path: Path, states: tuple[StateRecord, ...], visits: tuple[Visit | None, Visit | None], kind: str | None
) -> None:
    change = only_change(tmp_path / "map.db", states, visits)
    assert (change and change.kind) == kind


def test_readings_are_compared_only_where_both_traversals_are_sure(tmp_path: Path) -> None:
    def labelled(label: str, start: float, n: int) -> MapDelta:
        stamps = [start + 1 + i for i in range(n)]
        return MapDelta(keyframes=m.keyframes(stamps), observations=tuple(m.observation(1, at, label) for at in stamps))

    for n, labels in ((3, ("chair", "bench")), (2, ("chair", "chair"))):
        deltas = (labelled("chair", 0, n), labelled("bench", 100, n))
        change = only_change(tmp_path / f"{n}.db", (m.state(1, 0, (1, 105)),), (SEEN, SEEN), deltas=deltas)
        assert change is not None
        assert (change.kind, (change.label_before, change.label_after)) == ("unchanged", labels)
        assert ("another reading" in change.reason) == (n == 3)


def test_one_traversal_cannot_be_compared(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    with (
        open_store(str(path), read_only=True) as store,
        store.reader() as reader,
        pytest.raises(QueryError, match="holds only 'monday'"),
    ):
        diff(reader)


def test_people_are_left_out_of_diffs(tmp_path: Path) -> None:
    states = (m.state(1, 0, (1, 5), gone=105),)
    assert only_change(tmp_path / "chair.db", states, (SEEN, IN_VIEW)) is not None
    person = m.instance(1, "person", seen=(1, 5))
    assert only_change(tmp_path / "person.db", states, (SEEN, IN_VIEW), person) is None


def test_what_was_split_off_did_not_appear(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    deltas = (
        MapDelta(
            keyframes=m.keyframes([1]),
            instances=(m.instance(1, "chair", seen=(1, 1), observations=1),),
            observations=(m.observation(1, 1),),
            visits=(m.visit(1, 1, 1, 0, (1, 1)),),
            states=(m.state(1, 0, (1, 1)),),
        ),
        MapDelta(
            keyframes=m.keyframes([103]),
            instances=(
                m.instance(1, "chair", seen=(1, 103), observations=2),
                m.instance(2, "chair", (1, 0, 0.5), seen=(103, 103), observations=1),
            ),
            observations=(m.observation(1, 103, "chair"), m.observation(2, 103, "chair")),
            visits=(m.visit(1, 1, 1, 0, (103, 103)), m.visit(2, 1, 1, 0, (103, 103))),
            states=(m.state(1, 0, (1, 103)), m.state(2, 0, (103, 103), (1, 0, 0.5))),
            temporal_edges=(m.temporal("split", (1, 0), (2, 0), 1, 103),),
        ),
    )
    m.make_memory(path, ("a", (0, 10), deltas[0]), ("b", (100, 110), deltas[1]))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        changes = {change.id: change for change in diff(reader).changes}
        problems = check(reader)
        events = [(event.kind, event.from_id, event.to_id) for event in object_history(reader, "chair-2").events]
    assert (changes["chair-1"].kind, changes["chair-2"].kind) == ("unchanged", "first observed")
    assert changes["chair-2"].reason == "was one with chair-1 until the two were told apart"
    assert problems == []
    assert events == [("split", "chair-1", "chair-2")]


def test_two_times_are_compared_as_well_as_traversals(reader: MapReader) -> None:
    by_time = diff(reader, "09:02", "2026-01-05T09:18:20Z")
    kinds = {change.id: change.kind for change in by_time.changes}
    assert kinds == {change.id: change.kind for change in diff(reader).changes}
    cup = next(change for change in by_time.changes if change.id == "cup-1")
    assert (cup.not_before_ns, cup.not_after_ns, cup.perhaps_before) == (m.ns(90), m.ns(1005), True)
    assert (by_time.before.traversal, by_time.before.at_ns) == (None, m.ns(120))


def test_within_a_gap_nothing_has_changed_yet(reader: MapReader) -> None:
    kinds = {change.id: change for change in diff(reader, "60 s", "09:10").changes}
    assert kinds["cup-1"].kind == "not observed again"
    assert kinds["cup-1"].reason.endswith("nobody can say for this time")
    assert {change.kind for change in kinds.values()} == {"unchanged", "not observed again"}


def test_a_time_is_compared_with_a_traversal(reader: MapReader) -> None:
    found = diff(reader, "tuesday", "2026-01-05T09:01:00Z")
    assert (found.before.at_ns, found.after.name) == (m.ns(60), "tuesday")
    assert found.notes == ("the two were put in the order of time",)
    assert found.counts["disappeared"] == 1


def test_each_side_names_its_best_crop(tmp_path: Path) -> None:
    def seen(at: float, crop: bytes | None) -> MapDelta:
        picture = replace(m.observation(1, at), crop_jpeg=crop)
        return MapDelta(keyframes=m.keyframes([at]), observations=(picture,))

    deltas = seen(2, b"first"), seen(102, None)
    change = only_change(tmp_path / "map.db", (m.state(1, 0, (1, 105)),), (SEEN, SEEN), deltas=deltas)
    assert change is not None
    assert (change.crop_before, change.crop_after) == (1, None)


def test_what_came_and_went_in_between_stood_at_neither(tmp_path: Path) -> None:
    path = tmp_path / "map.db"
    delta = MapDelta(
        keyframes=m.keyframes([103]),
        instances=(m.instance(1, "chair", seen=(102, 103), presence="absent"),),
        visits=(SEEN,),
        states=(m.state(1, 0, (102, 103), gone=104, empty_before=5),),
    )
    m.make_memory(path, ("a", (0, 10), MapDelta()), ("b", (100, 110), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        found = diff(reader)
    assert [(change.kind, change.reason) for change in found.changes] == [
        ("at neither", "came and went between a and b")
    ]


def test_a_diff_does_not_depend_on_the_batch_size(reader: MapReader, monkeypatch: pytest.MonkeyPatch) -> None:
    sides = ((None, None), ("60 s", "09:18:20"), ("monday", "09:18:20"))
    whole = [diff(reader, *pair) for pair in sides]
    monkeypatch.setattr("supermap_cli.query.diff.batches", lambda numbers: batches(numbers, 1))
    monkeypatch.setattr("supermap_cli.memory.labelled_observations.batches", lambda numbers: batches(numbers, 1))
    assert [diff(reader, *pair) for pair in sides] == whole


@pytest.mark.parametrize("traversal_ids", [None, [1], [2, 3], [3, 1]])
def test_observations_of_some_traversals_equal_those_read_singly(
    tmp_path: Path, traversal_ids: list[int] | None
) -> None:
    def delta_at(at: float) -> MapDelta:
        pictures = [replace(m.observation(number, at), crop_jpeg=b"jpeg" if at > 100 else None) for number in (1, 2)]
        chairs = tuple(m.instance(number, "chair", seen=(1, at)) for number in (1, 2, 3))
        chairs = (chairs[0], replace(chairs[1], merged_into=1), chairs[2])
        return MapDelta(keyframes=m.keyframes([at]), observations=tuple(pictures), instances=chairs)

    path = tmp_path / "map.db"
    with open_store(str(path), create=True) as store:
        for number in (1, 2, 3):
            m.add_traversal(
                store,
                str(number),
                (100 * number, 100 * number + 10),
                *map(delta_at, (100 * number, 100.0 * number + 5)),
            )
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        instances = reader.instances
        found = LabelledObservations(reader, traversal_ids).of(instances)
        expected = {
            instance.number: [
                seen
                for seen in reader.observations(instance)
                if traversal_ids is None or seen.traversal_id in traversal_ids
            ]
            for instance in instances
        }
    assert expected[1]
    assert {
        number: [
            (observation.id, observation.traversal_id, observation.stamp_ns, observation.label, observation.score)
            for observation in observations
        ]
        for number, observations in found.items()
    } == {
        number: [
            (observation.id, observation.traversal_id, observation.stamp_ns, observation.label, observation.score)
            for observation in observations
        ]
        for number, observations in expected.items()
        if observations
    }
    assert all(
        observation.has_crop == (observation.stamp_ns > m.ns(100))
        for observations in found.values()
        for observation in observations
    )


@pytest.mark.parametrize("empty_before", [None, 4.0])
def test_what_was_lost_and_then_found_elsewhere_has_moved_not_appeared(
    tmp_path: Path, empty_before: float | None
) -> None:
    """Whether or not its new place had been seen empty before; in history and in every diff it is one event."""
    delta = MapDelta(
        keyframes=m.keyframes((1, 2, 5, 8)),
        instances=(m.instance(1, "suitcase", (3, 0, 0.5), seen=(1, 8)),),
        observations=(m.observation(1, 1, "suitcase"), m.observation(1, 8, "suitcase")),
        states=(
            m.state(1, 0, (1, 2), (0, 0, 0.5), gone=5, label="suitcase"),
            m.state(1, 1, (8, 8), (3, 0, 0.5), empty_before=empty_before, label="suitcase"),
        ),
        visits=(m.visit(1, 3, 4, 1, seen=(1, 8)),),
        temporal_edges=(
            m.temporal("disappeared", (1, 0), (1, 0), 2, 5),
            m.temporal("moved", (1, 0), (1, 1), 2, 8, distance_m=3.0),
        ),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        (change,) = diff(reader, "09:00:06", "09:00:09").changes
        assert (change.kind, change.distance_m) == ("moved", 3.0)
        assert (change.not_before_ns, change.not_after_ns) == (m.ns(2), m.ns(8))
        assert [event.kind for event in object_history(reader, "suitcase-1").events] == ["moved"]
