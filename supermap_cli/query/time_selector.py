"""The time words of questions: which states of an instance they select, and over which time relations count."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.presence_at import PresenceAt, presence_at, state_held_at
from supermap_cli.query.time_points import TimePoint
from supermap_cli.types.memory import StateRecord

TimeKind = Literal["now", "earlier", "first", "last", "traversal", "at", "during"]


@dataclass(frozen=True)
class TimeSelector:
    """A time word and its meaning.

    - "now": the current state of present instances. "last": the newest state, present or not. "first": the oldest.
    - "earlier": states that ended, or held before `high_ns` (start of the latest traversal; with one traversal: now).
    - "traversal": states supported in `traversal`. "at": states that held at `low_ns` = `high_ns`. "during": states
      supported between `low_ns` and `high_ns`.

    `note` tells how an ambiguous time was understood; `since_ns` is the start of a traversal that is given by its end.
    """

    kind: TimeKind
    text: str
    low_ns: float = -math.inf
    high_ns: float = math.inf
    traversal: StoredTraversal | None = None
    note: str | None = None
    since_ns: int | None = None

    def states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:  # noqa: PLR0911 - one case a kind
        """The selected states of an instance, oldest first."""
        states = instance.states
        match self.kind:
            case "now":
                return states[-1:] if instance.presence == "present" else ()
            case "last":
                return states[-1:]
            case "first":
                return states[:1]
            case "earlier":
                return tuple(state for state in states if state.first_seen_ns < self.high_ns or state is not states[-1])
            case "traversal":
                assert self.traversal is not None  # noqa: S101 - its maker gives one
                seen = instance.visit(self.traversal.id).supported > 0
                return tuple(
                    state for state in states if seen and self._overlaps(state.first_seen_ns, state.last_seen_ns)
                )
            case "during":
                return tuple(state for state in states if self._overlaps(state.first_seen_ns, state.last_seen_ns))
            case "at":
                state = state_held_at(states, int(self.low_ns))
                return () if state is None else (state,)

    def departure_gap(self, instance: StoredInstance) -> tuple[int, int] | None:
        """For a single time within the gap in which an instance left: the gap's bounds, both known."""
        for state in self.states(instance) if self.kind == "at" else ():
            end_ns = state_end_ns(state, instance.states)
            seen_then = self.since_ns is not None and state.last_seen_ns >= self.since_ns
            if state.last_seen_ns < self.low_ns < end_ns < math.inf and not seen_then:
                return state.last_seen_ns, int(end_ns)
        return None

    def presence(self, instance: StoredInstance) -> PresenceAt | None:
        """The presence of an instance if the selector is a single time, else `None`."""
        return presence_at(instance, int(self.low_ns), self.since_ns) if self.kind == "at" else None

    def reference_states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:
        """The states that other instances may be related to; overlap in time is checked later (`span_of`)."""
        return self.states(instance) if self.kind == "now" else instance.states

    def span_of(
        self, first: tuple[StateRecord, StoredInstance], second: tuple[StateRecord, StoredInstance]
    ) -> TimeSpan | None:
        """When two states hold at the same time within the selected time; `None` if never."""
        low = max(float(first[0].first_seen_ns), float(second[0].first_seen_ns))
        high = min(state_end_ns(first[0], first[1].states), state_end_ns(second[0], second[1].states))
        if self.kind == "now":
            low = max(low, self.low_ns)
        elif self.kind == "earlier":
            high = high if high < math.inf else self.high_ns
        elif self.kind in {"traversal", "at", "during"}:
            low, high = max(low, self.low_ns), min(high, self.high_ns + 1)
        return TimeSpan(low, high) if low < high else None

    def _overlaps(self, first_ns: int, last_ns: int) -> bool:
        return first_ns <= self.high_ns and last_ns >= self.low_ns


@dataclass(frozen=True)
class TimeSpan:
    """A half-open interval of sensor time; infinite where open."""

    low_ns: float
    high_ns: float

    def overlaps(self, since_ns: int, until_ns: int | None) -> bool:
        """Whether a half-open interval overlaps this one."""
        return since_ns < self.high_ns and (until_ns is None or until_ns > self.low_ns)


def state_end_ns(state: StateRecord, states: Sequence[StateRecord]) -> float:
    """The latest possible end of a state: its contradiction, or the start of a later state; infinite while it holds."""
    later = [float(later_state.first_seen_ns) for later_state in states if later_state.index > state.index]
    return min([math.inf if state.gone_ns is None else float(state.gone_ns), *later])


def selector_at(time_point: TimePoint) -> TimeSelector:
    """The selector for an "as of" time point."""
    text, at_ns = f"as of {time_point.text}", time_point.at_ns
    return TimeSelector("at", text, at_ns, at_ns, note=time_point.note, since_ns=time_point.traversal_start_ns)
