"""The presence of an instance at one time, as far as the map knows: present, absent or unknown.

Presence is unknown between the last support and the first contradiction, and between the last time a place was seen
empty and the first support after it. An instance that was not in view is never taken to be gone, and one that was first
seen later never to have come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.clock import Clock
from supermap_cli.types.memory import StateRecord

PresenceValue = Literal["present", "absent", "unknown"]
PresenceCause = Literal["stands", "left", "came", "gone", "not yet", "not yet seen", "not seen since"]


@dataclass(frozen=True)
class PresenceAt:
    """The presence of one instance at one time, with its cause.

    - present, "stands": supported at the time, or before it and never contradicted. At the end of a traversal also what
      that traversal saw and did not see leave; the bounds then tell when it was later seen to have left. (An object
      that came to a place that this traversal saw empty is absent.)
    - unknown, "left" or "came": it left `state`, or came to it, within the bounds, which contain the time.
    - unknown, "not yet seen": first seen later, and its place had not been seen empty before.
    - unknown, "not seen since": lost without a contradiction.
    - absent, "gone": it had left `state`, within the bounds. "not yet": it came to `state` later, within the bounds.

    `state` is the state that the statement is about.
    """

    value: PresenceValue
    cause: PresenceCause
    state: StateRecord
    not_before_ns: int | None
    not_after_ns: int | None


@dataclass(frozen=True)
class PresenceView:
    """A presence in a document; `words` explain it."""

    presence: PresenceValue
    words: str
    not_before_ns: int | None
    not_after_ns: int | None


def presence_at(instance: StoredInstance, at_ns: int, since_ns: int | None = None) -> PresenceAt | None:
    """The presence of an instance at a time, or at the end of a traversal that began at `since_ns`; `None` for an
    instance without states.
    """
    states = sorted(instance.states, key=lambda state: state.index)
    if not states:
        return None
    states_begun = [state for state in states if state.first_seen_ns <= at_ns]
    last = states_begun[-1] if states_begun else None
    if last is not None and at_ns <= last.last_seen_ns:
        return PresenceAt("present", "stands", last, None, None)
    after = states[len(states_begun)] if len(states_begun) < len(states) else None
    lost = instance.presence == "absent"
    presence = _before(states[0], at_ns) if last is None else _after(last, after, at_ns, lost=lost)
    return presence if since_ns is None else _as_seen_since(presence, since_ns)


def state_held_at(states: Sequence[StateRecord], at_ns: int) -> StateRecord | None:
    """The last state begun by a time, unless it is known to have ended by then."""
    states_begun = [state for state in states if state.first_seen_ns <= at_ns]
    last = max(states_begun, key=lambda state: state.index, default=None)
    return None if last is None or (last.gone_ns is not None and last.gone_ns <= at_ns) else last


def _as_seen_since(presence: PresenceAt, since_ns: int) -> PresenceAt:
    """At the end of a traversal, what it saw is present, and what it saw empty is absent."""
    empty_ns = presence.state.empty_before_ns
    if presence.cause == "left" and presence.state.last_seen_ns >= since_ns:
        return replace(presence, value="present", cause="stands")
    if presence.cause == "came" and empty_ns is not None and empty_ns >= since_ns:
        return replace(presence, value="absent", cause="not yet")
    return presence


def _before(first: StateRecord, at_ns: int) -> PresenceAt:
    """The presence at a time before the first state."""
    empty_ns = first.empty_before_ns
    if empty_ns is None:
        return PresenceAt("unknown", "not yet seen", first, None, first.first_seen_ns)
    if at_ns <= empty_ns:
        return PresenceAt("absent", "not yet", first, empty_ns, first.first_seen_ns)
    return PresenceAt("unknown", "came", first, empty_ns, first.first_seen_ns)


def _after(last: StateRecord, after: StateRecord | None, at_ns: int, *, lost: bool) -> PresenceAt:
    """The presence at a time after the last support of a state and before the next state."""
    gone_ns = last.gone_ns
    if gone_ns is None and after is None:
        cause: PresenceCause = "not seen since" if lost else "stands"
        return PresenceAt("unknown" if lost else "present", cause, last, last.last_seen_ns if lost else None, None)
    ends_ns = [end_ns for end_ns in (gone_ns, None if after is None else after.first_seen_ns) if end_ns is not None]
    if at_ns < min(ends_ns):
        return PresenceAt("unknown", "left", last, last.last_seen_ns, min(ends_ns))
    if after is None:
        return PresenceAt("absent", "gone", last, last.last_seen_ns, gone_ns)
    empty_ns = after.empty_before_ns
    if empty_ns is not None and at_ns <= empty_ns:
        return PresenceAt("absent", "gone", last, last.last_seen_ns, gone_ns)
    came_after_ns = last.last_seen_ns if empty_ns is None else max(empty_ns, last.last_seen_ns)
    return PresenceAt("unknown", "came", after, came_after_ns, after.first_seen_ns)


def presence_view(presence: PresenceAt, at_ns: int, clock: Clock) -> PresenceView:
    """A presence as a view."""
    words = describe_presence(presence, at_ns, clock)
    return PresenceView(presence.value, words, presence.not_before_ns, presence.not_after_ns)


def describe_presence(presence: PresenceAt, at_ns: int, clock: Clock) -> str:
    """A presence in words, with the reason why no more is known."""
    first_ns, seen_ns = presence.state.first_seen_ns, presence.state.last_seen_ns
    between = clock.between(presence.not_before_ns, presence.not_after_ns)
    after_support, left_later = at_ns > seen_ns, presence.not_after_ns is not None
    stands = f"last seen {clock.text(seen_ns)}, " + (
        f"left {between}" if left_later else "and nothing said since that it left"
    )
    words: dict[PresenceCause, str] = {
        "stands": stands if after_support else "stands there",
        "left": f"left {between}; nobody can say for {clock.text(at_ns)}",
        "came": f"came {between}; nobody can say for {clock.text(at_ns)}",
        "not yet seen": f"first seen {clock.text(first_ns)}; nobody had seen its place empty before",
        "not seen since": f"last seen {clock.text(seen_ns)}, not seen since",
        "gone": f"gone {between}",
        "not yet": f"came {between}",
    }
    return words[presence.cause]
