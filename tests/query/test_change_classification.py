"""Properties of change classification over random instances: what is never reported, and how diffs add up."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.change_classification import (
    MIN_MOVE_M,
    ChangeClassification,
    StateComparison,
    compared_times,
    state_distance_m,
)
from supermap_cli.query.presence_at import presence_at, state_held_at
from supermap_cli.query.time_points import TimePoint
from support import memories as m
from support import random_instances

times = st.integers(-5, random_instances.END_S + 5)


def between(instance: StoredInstance, a: float, b: float) -> ChangeClassification | None:
    """The classification between two plain times."""
    first, second = (TimePoint(str(at), m.ns(at), m.ns(at)) for at in sorted((a, b)))
    return StateComparison(instance, compared_times(first, second, ())).classify()


def of_visits(instance: StoredInstance, first: int, second: int) -> ChangeClassification | None:
    """The classification between two of the traversals of `random_instances`."""
    a, b = (random_instances.TRAVERSALS[at] for at in sorted((first, second)))
    ends = [TimePoint(traversal.name, traversal.end_ns, traversal.start_ns, traversal) for traversal in (a, b)]
    return StateComparison(instance, compared_times(ends[0], ends[1], random_instances.TRAVERSALS)).classify()


def check_claims(instance: StoredInstance, found: ChangeClassification | None, a_ns: int, b_ns: int) -> None:
    """A disappearance needs a contradiction in between, an appearance a place seen empty before."""
    if found is None:
        return
    if found.kind == "disappeared":
        assert found.not_before_ns is not None
        assert any(
            state.gone_ns == found.not_after_ns and state.last_seen_ns == found.not_before_ns
            for state in instance.states
        )
        assert found.not_after_ns is not None
        assert a_ns < found.not_after_ns <= b_ns
    if found.kind == "appeared":
        seen_empty = {
            ns for state in instance.states for ns in (state.gone_ns, state.empty_before_ns) if ns is not None
        }
        assert found.not_before_ns in seen_empty
    if found.kind in {"appeared", "moved", "first observed"}:
        assert found.after is not None
        assert a_ns < found.after.first_seen_ns <= b_ns
    if found.kind in {"appeared", "moved", "disappeared"}:
        assert found.not_before_ns is not None
        assert found.not_after_ns is not None
        assert found.not_before_ns < found.not_after_ns
    if found.kind == "moved":
        assert found.before is not None
        assert found.after is not None
        assert state_distance_m(found.before, found.after) >= MIN_MOVE_M


@given(random_instances.instances(), times, times)
def test_changes_between_times_need_evidence(instance: StoredInstance, a: int, b: int) -> None:
    low, high = sorted((a, b))
    if low < high:
        check_claims(instance, between(instance, low, high), m.ns(low), m.ns(high))


@given(random_instances.visited_instances(), st.sampled_from([(0, 1), (1, 2), (0, 2)]))
def test_changes_between_traversals_need_evidence(instance: StoredInstance, which: tuple[int, int]) -> None:
    a, b = (random_instances.TRAVERSALS[index] for index in which)
    check_claims(instance, of_visits(instance, *which), a.end_ns, b.end_ns)


@given(random_instances.visited_instances(), times, times)
def test_without_a_contradiction_nothing_disappears_or_appears(instance: StoredInstance, a: int, b: int) -> None:
    states = tuple(replace(state, gone_ns=None, empty_before_ns=None) for state in instance.states)
    unseen = replace(instance, states=states, presence="present")
    found = [of_visits(unseen, 0, 1), of_visits(unseen, 1, 2), of_visits(unseen, 0, 2)]
    if a != b:
        found.append(between(unseen, a, b))
    assert all(change is None or change.kind not in {"disappeared", "appeared"} for change in found)


@given(random_instances.instances(), times, times)
def test_certain_presence_at_both_times_decides_the_change(instance: StoredInstance, a: int, b: int) -> None:
    low, high = sorted((a, b))
    before, after = presence_at(instance, m.ns(low)), presence_at(instance, m.ns(high))
    assert before is not None
    assert after is not None
    if low == high or "unknown" in {before.value, after.value}:
        return
    found = between(instance, low, high)
    kind = None if found is None else found.kind
    match before.value, after.value:
        case "present", "absent":
            assert kind == "disappeared"
        case "absent", "present":
            assert kind in {"appeared", "moved"}
        case "absent", "absent":
            assert kind is None
        case "present", "present":
            same = state_distance_m(before.state, after.state) < MIN_MOVE_M
            assert kind in ({"unchanged", "not observed again"} if same else {"moved"})


@pytest.mark.parametrize("traversals", [False, True])
@given(instance=random_instances.visited_instances(), a=times, b=times, c=times)
def test_diffs_add_up(traversals: bool, instance: StoredInstance, a: int, b: int, c: int) -> None:
    low, middle, high = sorted((a, b, c))
    if not low < middle < high:
        return
    if traversals:
        first, second, whole = (of_visits(instance, *pair) for pair in ((0, 1), (1, 2), (0, 2)))
    else:
        first, second, whole = (between(instance, *pair) for pair in ((low, middle), (middle, high), (low, high)))
    kinds = tuple(None if change is None else change.kind for change in (first, second))
    kind = None if whole is None else whole.kind
    match kinds:
        case "disappeared", None if first is not None and first.before is not None:
            assert kind == "disappeared"
        case "appeared", "disappeared":
            assert kind is None
        case "appeared", "unchanged" | "moved" | "not observed again":
            assert kind in {"appeared", "moved"}  # moved: from a place that it had left before
        case "first observed", "unchanged" | "moved" | "not observed again":
            assert kind == "first observed"
        case "moved", "unchanged":
            assert kind in {"moved", "unchanged"}
        case "unchanged" | "not observed again", "moved" | "disappeared":
            assert kind == kinds[1]
        case "unchanged", "unchanged":
            assert kind == "unchanged"
        case ("moved", "moved") | ("disappeared", "appeared" | "moved"):
            assert kind in {"moved", "unchanged", "appeared", "first observed"}


def test_what_moved_and_moved_back_is_unchanged() -> None:
    states = (
        m.state(1, 0, (1, 10), gone=20),
        m.state(1, 1, (30, 40), (3, 0, 0.5), gone=50),
        m.state(1, 2, (60, 70)),
    )
    instance = replace(random_instances.instance_with_states(states), presence="present")
    found = between(instance, 5, 65)
    assert found is not None
    assert (found.kind, found.reason) == ("unchanged", "seen in its place in both, moved in between")
    assert [change.kind for change in (between(instance, 5, 35), between(instance, 35, 65)) if change] == [
        "moved",
        "moved",
    ]
    assert state_held_at(instance.states, m.ns(25)) is None
