"""Which instances questions are about: by what they are called, when and where they stood; each by an index.

What was merged into another stands for itself nowhere here; what is doubted is not believed, and never found.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterator

from sqlalchemy import ColumnElement, Connection, and_, column, exists, func, or_, select, table, text

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.databases.dialects import dialect_of
from supermap_cli.memory.numbers import batches
from supermap_cli.types.memory import Presence
from supermap_schema import models

BELIEVED: tuple[Presence, ...] = ("present", "absent")

ROUNDED_M = 0.001
"""By so much less boxes may be apart in the index of boxes than they are."""

Instance, State, Visit = models.Instance, models.State, models.Visit

_BOX = table("state_box", *map(column, ("state_id", "min_x", "max_x", "min_y", "max_y", "min_z", "max_z")))

_OWN, _OTHER = _BOX.alias("own"), _BOX.alias("other")
_HERE, _THERE = (State.__table__.alias(name) for name in ("here", "there"))

_LABELS_TODAY = text(
    """
    WITH RECURSIVE called(label) AS (
      SELECT min(label) FROM instance WHERE merged_into IS NULL
      UNION ALL
      SELECT (SELECT min(label) FROM instance WHERE merged_into IS NULL AND label > called.label)
      FROM called WHERE called.label IS NOT NULL)
    SELECT label FROM called WHERE EXISTS (
      SELECT 1 FROM instance WHERE merged_into IS NULL AND instance.label = called.label
      AND presence IN ('present', 'absent'))
    """
)
_LABELS_ONCE = text(
    """
    WITH RECURSIVE called(label) AS (
      SELECT min(label) FROM state
      UNION ALL
      SELECT (SELECT min(label) FROM state WHERE label > called.label) FROM called WHERE called.label IS NOT NULL)
    SELECT label FROM called WHERE EXISTS (
      SELECT 1 FROM state JOIN instance ON instance.number = state.instance_number
      WHERE state.label = called.label AND instance.merged_into IS NULL AND instance.presence IN ('present', 'absent'))
    """
)
"""From one label to the next, however many there are of each."""


class Finder:
    """Numbers of instances that are believed; merged ones never."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def labels(self) -> frozenset[str]:
        """All that anything is called, or was called in one of its states."""
        return self.labels_today() | frozenset(self._connection.execute(_LABELS_ONCE).scalars())

    def labels_today(self) -> frozenset[str]:
        """All that anything is called today."""
        return frozenset(self._connection.execute(_LABELS_TODAY).scalars())

    def count(self, labels: Collection[str] | None, presences: Collection[Presence] = BELIEVED) -> int:
        """How many are called so today."""
        statement = select(func.count()).select_from(Instance).where(*_stands(presences))
        if labels is not None:
            statement = statement.where(Instance.label.in_(labels))
        return self._connection.execute(statement).scalar_one()

    def counts(self) -> dict[str, int]:
        """How many are present of each label."""
        counts = {label: self.count([label], ["present"]) for label in sorted(self.labels_today())}
        return {label: count for label, count in counts.items() if count}

    def called(
        self, labels: Collection[str] | None, presences: Collection[Presence] = BELIEVED, *, begun_ns: float = math.inf
    ) -> Iterator[int]:
        """Those called so today (or all), of which something was seen by `begun_ns`: the last seen first."""
        asked = [
            (presence, label) for presence in presences for label in ([None] if labels is None else sorted(labels))
        ]
        runs = [self._run(presence, label, begun_ns) for presence, label in asked]
        return (-number for _, number in heapq.merge(*runs))

    def once_called(self, labels: Collection[str]) -> list[int]:
        """Those called so in one of their states, but not today, in order."""
        today = select(Instance.number).where(Instance.merged_into.is_(None), Instance.label.in_(labels))
        states = select(State.instance_number).where(State.label.in_(labels), State.instance_number.not_in(today))
        statement = select(Instance.number).where(Instance.number.in_(states), *_stands(BELIEVED))
        return list(self._connection.execute(statement.order_by(Instance.number)).scalars())

    def ever_called(self, numbers: Collection[int], labels: Collection[str]) -> set[int]:
        """Those of the given that are called so today, or were in one of their states."""
        found: set[int] = set()
        for batch in batches(sorted(numbers)):
            today = select(Instance.number).where(Instance.number.in_(batch), Instance.label.in_(labels))
            once = select(State.instance_number).where(State.instance_number.in_(batch), State.label.in_(labels))
            found.update(self._connection.execute(today.union(once)).scalars())
        return found

    def seen_in(self, traversal_id: int, labels: Collection[str] | None) -> list[int]:
        """All that a traversal saw, but those that are surely not called so; numbers of merged parts are among them."""
        statement = select(Visit.instance_number).where(Visit.traversal_id == traversal_id, Visit.supported > 0)
        if labels is not None:
            state = exists().where(State.instance_number == Instance.number, State.label.in_(labels))
            perhaps = or_(Instance.merged_into.is_not(None), Instance.label.in_(labels), state)
            statement = statement.join(Instance, Instance.number == Visit.instance_number).where(perhaps)
        return list(self._connection.execute(statement.order_by(Visit.instance_number)).scalars())

    def first_called(self, labels: Collection[str] | None, limit: int) -> list[int]:
        """Those with the smallest numbers that are called so today (or all), and stood somewhere."""
        stood = exists().where(State.instance_number == Instance.number)
        statement = select(Instance.number).where(*_stands(BELIEVED), stood)
        if labels is not None:
            statement = statement.where(Instance.label.in_(labels))
        return list(self._connection.execute(statement.order_by(Instance.number).limit(limit)).scalars())

    def beliefs(self, names: Collection[str]) -> Iterator[tuple[int, str]]:
        """What may have one of the names, whatever its ending, and stood somewhere: its labels with their probabilities
        as JSON, by number.
        """
        dialect, found = dialect_of(self._connection), set[int]()
        for name in sorted(names):
            stood = exists().where(State.instance_number == Instance.number)
            named = Instance.number.in_(dialect.labelled(name))
            statement = select(Instance.number, Instance.label_belief).where(named, *_stands(BELIEVED), stood)
            for number, belief in self._connection.execute(statement):
                if number not in found:
                    found.add(number)
                    yield number, belief

    def near(
        self, numbers: Collection[int], reach: Reach, labels: Collection[str] | None = None, *, turned: bool = False
    ) -> set[tuple[int, int]]:
        """Pairs of one of the given and another instance of which states may lie within reach, the given one's above
        (`turned`: the other's), the other's called by one of the labels; some are farther apart, and neither time nor
        belief is looked at.
        """
        own, other, here, there = _OWN, _OTHER, _HERE, _THERE
        floor, height = reach.floor_m, reach.height_m
        within = [
            other.c.min_x <= own.c.max_x + floor,
            other.c.max_x >= own.c.min_x - floor,
            other.c.min_y <= own.c.max_y + floor,
            other.c.max_y >= own.c.min_y - floor,
        ]
        if not math.isinf(height):
            within += [other.c.min_z <= own.c.max_z + height, other.c.max_z >= own.c.min_z - height]
        if not math.isinf(reach.rise_m):
            upper, lower = (other, own) if turned else (own, other)
            within.append(upper.c.min_z >= lower.c.max_z + reach.rise_m - ROUNDED_M)
        pairs: set[tuple[int, int]] = set()
        for batch in batches(sorted(numbers)):
            statement = (
                select(here.c.instance_number, there.c.instance_number)
                .select_from(here)
                .join(own, own.c.state_id == here.c.id)
                .join(other, and_(*within))
                .join(there, there.c.id == other.c.state_id)
                .where(here.c.instance_number.in_(batch), there.c.instance_number != here.c.instance_number)
            )
            if labels is not None:
                called = or_(Instance.label.in_(labels), there.c.label.in_(labels))
                statement = statement.join(Instance, Instance.number == there.c.instance_number).where(called)
            pairs.update((a, b) for a, b in self._connection.execute(statement))
        return pairs

    def _run(self, presence: Presence, label: str | None, begun_ns: float) -> Iterator[tuple[int, int]]:
        """One label's, ordered, as keys that grow."""
        statement = select(Instance.last_seen_ns, Instance.number).where(*_stands([presence]))
        if label is not None:
            statement = statement.where(Instance.label == label)
        if begun_ns < math.inf:
            statement = statement.where(Instance.first_seen_ns <= int(begun_ns))
        ordered = statement.order_by(Instance.last_seen_ns.desc(), Instance.number.desc())
        for last_seen_ns, number in self._connection.execute(ordered):
            yield -last_seen_ns, -number


def _stands(presences: Collection[Presence]) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return Instance.merged_into.is_(None), Instance.presence.in_(presences)
