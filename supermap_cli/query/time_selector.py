"""What a question's time word stands for: which states of an instance, and which span of time relations must touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.clock import Clock
from supermap_cli.query.grammar import TimeKind, TimePhrase
from supermap_cli.query.presence_at import PresenceAt, presence_at, state_held_at
from supermap_cli.query.time_points import TimePoint, find_traversal
from supermap_cli.types.memory import StateRecord


@dataclass(frozen=True)
class TimeSelector:
    """A time word with its meaning.

    - "now": what is present, as it stands. "last": the newest state, present or not. "first": the oldest.
    - "earlier": states that ended, or held before `high_ns` (the latest traversal's start; with one traversal: now).
    - "traversal": states that `traversal` supported. "at": states that held at `low_ns` = `high_ns`.

    `note`: what there is to say about how a written time was understood; `since_ns`: the start of the traversal of
    which it is the end.
    """

    kind: TimeKind
    text: str
    low_ns: float = -math.inf
    high_ns: float = math.inf
    traversal: StoredTraversal | None = None
    note: str | None = None
    since_ns: int | None = None

    def states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:
        """The states of an instance that the moment speaks of, oldest first."""
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
                assert self.traversal is not None  # noqa: S101 - `moment_of` gives one
                seen = instance.visit(self.traversal.id).supported > 0
                return tuple(
                    state for state in states if seen and self._overlaps(state.first_seen_ns, state.last_seen_ns)
                )
            case "at":
                held = state_held_at(states, int(self.low_ns))
                return () if held is None else (held,)

    def departure_gap(self, instance: StoredInstance) -> tuple[int, int] | None:
        """The span within which an instance left, if the moment is one time in it; both ends are certain."""
        for state in self.states(instance) if self.kind == "at" else ():
            end_ns = state_end_ns(state, instance.states)
            seen_then = self.since_ns is not None and state.last_seen_ns >= self.since_ns
            if state.last_seen_ns < self.low_ns < end_ns < math.inf and not seen_then:
                return state.last_seen_ns, int(end_ns)
        return None

    def presence(self, instance: StoredInstance) -> PresenceAt | None:
        """What is known of an instance at the moment, if that is one time."""
        return presence_at(instance, int(self.low_ns), self.since_ns) if self.kind == "at" else None

    def reference_states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:
        """The states that what is asked for may stand in relation to; that they hold together is checked later."""
        return self.states(instance) if self.kind == "now" else instance.states

    def span_of(
        self, first: tuple[StateRecord, StoredInstance], second: tuple[StateRecord, StoredInstance]
    ) -> TimeSpan | None:
        """When two states hold together within the moment; `None` if never."""
        low = max(float(first[0].first_seen_ns), float(second[0].first_seen_ns))
        high = min(state_end_ns(first[0], first[1].states), state_end_ns(second[0], second[1].states))
        if self.kind == "now":
            low = max(low, self.low_ns)
        elif self.kind == "earlier":
            high = high if high < math.inf else self.high_ns
        elif self.kind in {"traversal", "at"}:
            low, high = max(low, self.low_ns), min(high, self.high_ns + 1)
        return TimeSpan(low, high) if low < high else None

    def _overlaps(self, first_ns: int, last_ns: int) -> bool:
        return first_ns <= self.high_ns and last_ns >= self.low_ns


@dataclass(frozen=True)
class TimeSpan:
    """A half-open span of sensor time; infinite where open."""

    low_ns: float
    high_ns: float

    def overlaps(self, since_ns: int, until_ns: int | None) -> bool:
        """Whether a half-open interval has a part in it."""
        return since_ns < self.high_ns and (until_ns is None or until_ns > self.low_ns)


def state_end_ns(state: StateRecord, states: Sequence[StateRecord]) -> float:
    """When a state ended at the latest: contradicted, or seen elsewhere; infinite while it holds."""
    later = [float(later_state.first_seen_ns) for later_state in states if later_state.index > state.index]
    return min([math.inf if state.gone_ns is None else float(state.gone_ns), *later])


def selector_at(instant: TimePoint) -> TimeSelector:
    """The moment at which everything is asked for "as of" a time."""
    text, at_ns = f"as of {instant.text}", instant.at_ns
    return TimeSelector("at", text, at_ns, at_ns, note=instant.note, since_ns=instant.traversal_start_ns)


def selector_of_phrase(phrase: TimePhrase, reader: MapReader, clock: Clock) -> TimeSelector:
    """What a time phrase means in this map. Raises `QueryError` for a traversal or time it does not know."""
    match phrase.kind:
        case "now":
            return TimeSelector("now", "now", low_ns=reader.now_ns)
        case "earlier":
            starts = sorted(traversal.start_ns for traversal in reader.traversals)
            return TimeSelector("earlier", "earlier", high_ns=starts[-1] if len(starts) > 1 else reader.now_ns)
        case "traversal":
            traversal = find_traversal(reader.traversals, phrase.argument or "")
            text = f"in {traversal.name}"
            return TimeSelector("traversal", text, traversal.start_ns, traversal.end_ns, traversal)
        case "at":
            parsed = clock.parse(phrase.argument or "")
            return TimeSelector(
                "at", f"at {clock.text(parsed.stamp_ns)}", parsed.stamp_ns, parsed.stamp_ns, note=parsed.note
            )
        case kind:
            return TimeSelector(kind, kind)
