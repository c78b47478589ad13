"""Where a thing stood at one time, as far as the memory knows: it stood there, it did not, or nobody can say.

Between the last support and the first contradiction the truth is unknown, and so it is between the last time a place
was seen empty and the first support after it. What was merely not looked at is never taken to be gone, and what was
first seen later never to have come.
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
    """What is known of one instance at one time, and why.

    - present, "stands": supported at the time, or before it and never contradicted. As of a traversal's end also what
      that traversal saw, and did not see leave; bounds then say when it was seen to have left later. (And what came
      to a place that it saw empty is absent.)
    - unknown, "left" or "came": it left `state`, or came to it, within the bounds, which hold the time.
    - unknown, "not yet seen": first seen later, and its place had not been seen empty before.
    - unknown, "not seen since": lost without a contradiction.
    - absent, "gone": it had left `state`, within the bounds. "not yet": it came to `state` later, within the bounds.

    `state` is the place spoken of.
    """

    value: PresenceValue
    cause: PresenceCause
    state: StateRecord
    not_before_ns: int | None
    not_after_ns: int | None


@dataclass(frozen=True)
class PresenceView:
    """A standing as it leaves the program; `words` say it in plain English."""

    presence: PresenceValue
    words: str
    not_before_ns: int | None
    not_after_ns: int | None


def presence_at(instance: StoredInstance, at_ns: int, since_ns: int | None = None) -> PresenceAt | None:
    """What is known of an instance at a time, or at the end of a traversal that began at `since_ns`; `None` for one
    without any state.
    """
    states = sorted(instance.states, key=lambda state: state.index)
    if not states:
        return None
    begun = [state for state in states if state.first_seen_ns <= at_ns]
    last = begun[-1] if begun else None
    if last is not None and at_ns <= last.last_seen_ns:
        return PresenceAt("present", "stands", last, None, None)
    after = states[len(begun)] if len(begun) < len(states) else None
    lost = instance.presence == "absent"
    known = _before(states[0], at_ns) if last is None else _after(last, after, at_ns, lost=lost)
    return known if since_ns is None else _as_seen_since(known, since_ns)


def state_held_at(states: Sequence[StateRecord], at_ns: int) -> StateRecord | None:
    """The state that an instance was last known to be in at a time: begun, and not yet known to have ended."""
    begun = [state for state in states if state.first_seen_ns <= at_ns]
    last = max(begun, key=lambda state: state.index, default=None)
    return None if last is None or (last.gone_ns is not None and last.gone_ns <= at_ns) else last


def _as_seen_since(known: PresenceAt, since_ns: int) -> PresenceAt:
    """At the end of a traversal: what it saw stands, and what it saw empty is empty."""
    empty_ns = known.state.empty_before_ns
    if known.cause == "left" and known.state.last_seen_ns >= since_ns:
        return replace(known, value="present", cause="stands")
    if known.cause == "came" and empty_ns is not None and empty_ns >= since_ns:
        return replace(known, value="absent", cause="not yet")
    return known


def _before(first: StateRecord, at_ns: int) -> PresenceAt:
    """A time before anything was seen of it."""
    empty_ns = first.empty_before_ns
    if empty_ns is None:
        return PresenceAt("unknown", "not yet seen", first, None, first.first_seen_ns)
    if at_ns <= empty_ns:
        return PresenceAt("absent", "not yet", first, empty_ns, first.first_seen_ns)
    return PresenceAt("unknown", "came", first, empty_ns, first.first_seen_ns)


def _after(last: StateRecord, after: StateRecord | None, at_ns: int, *, lost: bool) -> PresenceAt:
    """A time after the last support of a state, and before the next one's first."""
    gone_ns = last.gone_ns
    if gone_ns is None and after is None:
        cause: PresenceCause = "not seen since" if lost else "stands"
        return PresenceAt("unknown" if lost else "present", cause, last, last.last_seen_ns if lost else None, None)
    ended = [end_ns for end_ns in (gone_ns, None if after is None else after.first_seen_ns) if end_ns is not None]
    if at_ns < min(ended):
        return PresenceAt("unknown", "left", last, last.last_seen_ns, min(ended))
    if after is None:
        return PresenceAt("absent", "gone", last, last.last_seen_ns, gone_ns)
    empty_ns = after.empty_before_ns
    if empty_ns is not None and at_ns <= empty_ns:
        return PresenceAt("absent", "gone", last, last.last_seen_ns, gone_ns)
    came_after_ns = last.last_seen_ns if empty_ns is None else max(empty_ns, last.last_seen_ns)
    return PresenceAt("unknown", "came", after, came_after_ns, after.first_seen_ns)


def presence_view(presence: PresenceAt, at_ns: int, clock: Clock) -> PresenceView:
    """A standing as it leaves the program."""
    words = describe_presence(presence, at_ns, clock)
    return PresenceView(presence.value, words, presence.not_before_ns, presence.not_after_ns)


def describe_presence(presence: PresenceAt, at_ns: int, clock: Clock) -> str:
    """What is known, and why not more."""
    first_ns, seen_ns = presence.state.first_seen_ns, presence.state.last_seen_ns
    between = clock.between(presence.not_before_ns, presence.not_after_ns)
    lately, later = at_ns > seen_ns, presence.not_after_ns is not None
    stands = f"last seen {clock.text(seen_ns)}, " + (
        f"left {between}" if later else "and nothing said since that it left"
    )
    words: dict[PresenceCause, str] = {
        "stands": stands if lately else "stands there",
        "left": f"left {between}; nobody can say for {clock.text(at_ns)}",
        "came": f"came {between}; nobody can say for {clock.text(at_ns)}",
        "not yet seen": f"first seen {clock.text(first_ns)}; nobody had seen its place empty before",
        "not seen since": f"last seen {clock.text(seen_ns)}, not seen since",
        "gone": f"gone {between}",
        "not yet": f"came {between}",
    }
    return words[presence.cause]
