"""The presence of an instance at one time: present, absent or unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.clock import Clock
from supermap_cli.query.presence_at import describe_presence, presence_at, state_held_at
from supermap_cli.query.traversal_spans import TraversalSpan
from supermap_cli.types.memory import StateRecord
from support import memories as m
from support.random_instances import instance_with_states, instances

CLOCK = Clock((TraversalSpan(1, "monday", m.ns(0), m.ns(1000)),))


def instance_with(*states: StateRecord, presence: str = "present") -> StoredInstance:
    """An instance with the given states."""
    return replace(instance_with_states(states), presence=presence)  # type: ignore[arg-type]


LEFT = instance_with(m.state(1, 0, (10, 21), gone=40))
CAME = instance_with(m.state(1, 0, (30, 50), empty_before=20))
FOUND = instance_with(m.state(1, 0, (30, 50)))
AWAY = instance_with(m.state(1, 0, (10, 20), gone=30), m.state(1, 1, (60, 70), (3, 0, 0.5), empty_before=50))
CARRIED = instance_with(m.state(1, 0, (10, 20)), m.state(1, 1, (60, 70), (3, 0, 0.5)))
LOST = instance_with(m.state(1, 0, (10, 20)), presence="absent")


@pytest.mark.parametrize(
    ("instance", "at", "presence", "cause", "bounds"),
    [
        (LEFT, 10, "present", "stands", (None, None)),
        (LEFT, 21, "present", "stands", (None, None)),
        (LEFT, 30, "unknown", "left", (21, 40)),
        (LEFT, 40, "absent", "gone", (21, 40)),
        (LEFT, 90, "absent", "gone", (21, 40)),
        (CAME, 20, "absent", "not yet", (20, 30)),
        (CAME, 25, "unknown", "came", (20, 30)),
        (CAME, 90, "present", "stands", (None, None)),
        (FOUND, 5, "unknown", "not yet seen", (None, 30)),
        (AWAY, 25, "unknown", "left", (20, 30)),
        (AWAY, 40, "absent", "gone", (20, 30)),
        (AWAY, 55, "unknown", "came", (50, 60)),
        (AWAY, 60, "present", "stands", (None, None)),
        (CARRIED, 40, "unknown", "left", (20, 60)),
        (LOST, 15, "present", "stands", (None, None)),
        (LOST, 25, "unknown", "not seen since", (20, None)),
    ],
)
def test_presence_and_cause_over_time(
    instance: StoredInstance, at: float, presence: str, cause: str, bounds: tuple[float | None, float | None]
) -> None:
    presence_then = presence_at(instance, m.ns(at))
    assert presence_then is not None
    assert (presence_then.value, presence_then.cause) == (presence, cause)
    assert (presence_then.not_before_ns, presence_then.not_after_ns) == tuple(map(m.maybe_ns, bounds))


def test_presence_is_described_in_words() -> None:
    presence_then = presence_at(LEFT, m.ns(30))
    assert presence_then is not None
    assert describe_presence(presence_then, m.ns(30), CLOCK) == (
        "left between 2026-01-05T09:00:21.0Z and 2026-01-05T09:00:40.0Z; nobody can say for 2026-01-05T09:00:30.0Z"
    )


@given(instances(), st.floats(-10, 210))
def test_absence_needs_a_contradiction_or_a_place_seen_empty(instance: StoredInstance, at: float) -> None:
    at_ns = m.ns(at)
    presence_then = presence_at(instance, at_ns)
    assert presence_then is not None
    in_support = any(state.first_seen_ns <= at_ns <= state.last_seen_ns for state in instance.states)
    if in_support:
        assert presence_then.value == "present"
    if presence_then.value == "absent":
        contradicted = [state for state in instance.states if state.gone_ns is not None and state.gone_ns <= at_ns]
        seen_empty = [
            state for state in instance.states if state.empty_before_ns is not None and state.empty_before_ns >= at_ns
        ]
        assert contradicted or seen_empty
    if presence_then.cause in {"left", "came"}:
        assert presence_then.not_before_ns is not None
        assert presence_then.not_after_ns is not None
        assert presence_then.not_before_ns <= at_ns < presence_then.not_after_ns
    assert describe_presence(presence_then, at_ns, CLOCK)


@given(instances(), st.floats(-10, 210))
def test_without_a_contradiction_nothing_is_absent(instance: StoredInstance, at: float) -> None:
    unseen = replace(
        instance,
        states=tuple(replace(state, gone_ns=None, empty_before_ns=None) for state in instance.states),
        presence="present",
    )
    presence_then = presence_at(unseen, m.ns(at))
    assert presence_then is not None
    assert presence_then.value != "absent"


@given(instances(), st.floats(-10, 210))
def test_the_held_state_agrees_with_presence(instance: StoredInstance, at: float) -> None:
    presence_then, held = presence_at(instance, m.ns(at)), state_held_at(instance.states, m.ns(at))
    assert presence_then is not None
    if presence_then.value == "present":
        assert held is presence_then.state
    if presence_then.cause == "gone":
        assert held is None or not np.array_equal(held.centroid_map, presence_then.state.centroid_map)
