"""Finds the instances that a question is about by label, time and place; every search uses an index.

Instances that were merged into others are not found, nor are those whose presence is "doubted" (demoted).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterator
from typing import Literal

from sqlalchemy import ColumnElement, Connection, TextClause, and_, case, column, exists, func, or_, select, table, text

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.databases.dialects import dialect_of
from supermap_cli.memory.numbers import batches
from supermap_cli.types.memory import Presence
from supermap_schema import models

SizeMeasure = Literal["volume", "height", "width"]
"""The volume of a box, its height, its longer horizontal side."""

BELIEVED: tuple[Presence, ...] = ("present", "absent")
"""The presences of all instances that were not demoted."""

ROUNDED_M = 0.001
"""Tolerance in metres: the R*Tree stores 32-bit floats, rounded outwards, so that boxes seem closer than they are."""

Instance, State, Visit = models.Instance, models.State, models.Visit

_BOX = table("state_box", *map(column, ("state_id", "min_x", "max_x", "min_y", "max_y", "min_z", "max_z")))

_OWN, _OTHER = _BOX.alias("own"), _BOX.alias("other")
_HERE, _THERE = (State.__table__.alias(name) for name in ("here", "there"))

_CURRENT_LABELS = text(
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
_STATE_LABELS = text(
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
_DOUBTED_LABELS = text(
    """
    WITH RECURSIVE called(label) AS (
      SELECT min(label) FROM instance WHERE merged_into IS NULL
      UNION ALL
      SELECT (SELECT min(label) FROM instance WHERE merged_into IS NULL AND label > called.label)
      FROM called WHERE called.label IS NOT NULL)
    SELECT label FROM called WHERE EXISTS (
      SELECT 1 FROM instance WHERE merged_into IS NULL AND instance.label = called.label AND presence = 'doubted')
    """
)
"""All step from one label to the next in the index, so that the number of rows does not matter."""


class InstanceSearch:
    """Searches over one connection; results are instance numbers."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._labels: dict[TextClause, frozenset[str]] = {}
        self._counts: dict[tuple[frozenset[str] | None, frozenset[Presence]], int] = {}

    def labels(self) -> frozenset[str]:
        """All labels that an instance has, or had in one of its states."""
        return self.current_labels() | self._listed(_STATE_LABELS)

    def current_labels(self) -> frozenset[str]:
        """All labels that an instance has today."""
        return self._listed(_CURRENT_LABELS)

    def doubted_labels(self) -> frozenset[str]:
        """All labels that an instance has which is believed in no more today."""
        return self._listed(_DOUBTED_LABELS)

    def _listed(self, statement: TextClause) -> frozenset[str]:
        """The labels that a statement lists, asked for once."""
        if statement not in self._labels:
            self._labels[statement] = frozenset(self._connection.execute(statement).scalars())
        return self._labels[statement]

    def ids_from(self, beginning: str, limit: int) -> list[str]:
        """The first ids, in the order of the alphabet, that begin so."""
        after = Instance.id >= beginning
        statement = select(Instance.id).where(after, Instance.id < f"{beginning}\U0010ffff").order_by(Instance.id)
        return list(self._connection.execute(statement.limit(limit)).scalars())

    def count(self, labels: Collection[str] | None, presences: Collection[Presence] = BELIEVED) -> int:
        """How many instances have one of the labels (`None`: any) today."""
        asked = None if labels is None else frozenset(labels), frozenset(presences)
        if asked not in self._counts:
            statement = select(func.count()).select_from(Instance).where(*_has_presence(presences))
            if labels is not None:
                statement = statement.where(Instance.label.in_(labels))
            self._counts[asked] = self._connection.execute(statement).scalar_one()
        return self._counts[asked]

    def counts(self) -> dict[str, int]:
        """How many instances of each label are present."""
        counts = {label: self.count([label], ["present"]) for label in sorted(self.current_labels())}
        return {label: count for label, count in counts.items() if count}

    def labelled(
        self, labels: Collection[str] | None, presences: Collection[Presence] = BELIEVED, *, begun_ns: float = math.inf
    ) -> Iterator[int]:
        """Instances that have one of the labels (`None`: any) today and were first seen by `begun_ns`, in the order of
        when they were last seen, the latest first.
        """
        keys = [(presence, label) for presence in presences for label in ([None] if labels is None else sorted(labels))]
        runs = [self._run(presence, label, begun_ns) for presence, label in keys]
        return (-number for _, number in heapq.merge(*runs))

    def formerly_labelled(self, labels: Collection[str]) -> list[int]:
        """Instances that had one of the labels in one of their states, but not today, ordered by number."""
        today = select(Instance.number).where(Instance.merged_into.is_(None), Instance.label.in_(labels))
        states = select(State.instance_number).where(State.label.in_(labels), State.instance_number.not_in(today))
        statement = select(Instance.number).where(Instance.number.in_(states), *_has_presence(BELIEVED))
        return list(self._connection.execute(statement.order_by(Instance.number)).scalars())

    def ever_labelled(self, numbers: Collection[int], labels: Collection[str]) -> set[int]:
        """Those of the given instances that have one of the labels today, or had it in one of their states."""
        found: set[int] = set()
        for batch in batches(sorted(numbers)):
            today = select(Instance.number).where(Instance.number.in_(batch), Instance.label.in_(labels))
            formerly = select(State.instance_number).where(State.instance_number.in_(batch), State.label.in_(labels))
            found.update(self._connection.execute(today.union(formerly)).scalars())
        return found

    def seen_in(self, traversal_id: int, labels: Collection[str] | None) -> list[int]:
        """Instances that a traversal saw, without those that never had one of the labels; merged ones are included."""
        statement = select(Visit.instance_number).where(Visit.traversal_id == traversal_id, Visit.supported > 0)
        if labels is not None:
            state = exists().where(State.instance_number == Instance.number, State.label.in_(labels))
            possible = or_(Instance.merged_into.is_not(None), Instance.label.in_(labels), state)
            statement = statement.join(Instance, Instance.number == Visit.instance_number).where(possible)
        return list(self._connection.execute(statement.order_by(Visit.instance_number)).scalars())

    def by_size(self, labels: Collection[str] | None, measure: SizeMeasure, limit: int, *, largest: bool) -> list[int]:
        """Present instances with one of the labels (`None`: any), the largest, or smallest, by a measure first."""
        wide = case((Instance.size_x > Instance.size_y, Instance.size_x), else_=Instance.size_y)
        value = {
            "volume": Instance.size_x * Instance.size_y * Instance.size_z,
            "height": Instance.size_z,
            "width": wide,
        }[measure]
        statement = select(Instance.number).where(*_has_presence(["present"]))
        if labels is not None:
            statement = statement.where(Instance.label.in_(labels))
        ordered = statement.order_by(value.desc() if largest else value, Instance.number)
        return list(self._connection.execute(ordered.limit(limit)).scalars())

    def first_labelled(self, labels: Collection[str] | None, limit: int) -> list[int]:
        """The smallest numbers of instances that have one of the labels (`None`: any) today, and a state."""
        has_state = exists().where(State.instance_number == Instance.number)
        statement = select(Instance.number).where(*_has_presence(BELIEVED), has_state)
        if labels is not None:
            statement = statement.where(Instance.label.in_(labels))
        return list(self._connection.execute(statement.order_by(Instance.number).limit(limit)).scalars())

    def label_beliefs(self, names: Collection[str]) -> Iterator[tuple[int, str]]:
        """Number and label belief (JSON) of instances that have a state, and one of the names among their labels.

        Names are compared by their stems.
        """
        dialect, found = dialect_of(self._connection), set[int]()
        for name in sorted(names):
            has_state = exists().where(State.instance_number == Instance.number)
            named = Instance.number.in_(dialect.matching_labels(name))
            statement = select(Instance.number, Instance.label_belief).where(named, *_has_presence(BELIEVED), has_state)
            for number, belief in self._connection.execute(statement):
                if number not in found:
                    found.add(number)
                    yield number, belief

    def near(
        self, numbers: Collection[int], reach: Reach, labels: Collection[str] | None = None, *, turned: bool = False
    ) -> set[tuple[int, int]]:
        """Pairs of a given instance and another one, with one of the labels, that may have states within reach.

        With a `rise_m` the given one's state is above the other's (`turned`: below), and with a share `covered` it lies
        over the other so far, by the boxes along the axes of the map. A superset: some pairs are farther
        apart, and neither time nor presence is compared.
        """
        own, other, here, there = _OWN, _OTHER, _HERE, _THERE
        covered: list[ColumnElement[bool]] = []
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
        if reach.covered > 0:
            subject = there if turned else here
            footprint_m2 = subject.c.size_x * subject.c.size_y
            shared_m2 = _shared(own.c.min_x, own.c.max_x, other.c.min_x, other.c.max_x) * _shared(
                own.c.min_y, own.c.max_y, other.c.min_y, other.c.max_y
            )
            covered.append(shared_m2 >= reach.covered * footprint_m2)
        pairs: set[tuple[int, int]] = set()
        for batch in batches(sorted(numbers)):
            statement = (
                select(here.c.instance_number, there.c.instance_number)
                .select_from(here)
                .join(own, own.c.state_id == here.c.id)
                .join(other, and_(*within))
                .join(there, there.c.id == other.c.state_id)
                .where(here.c.instance_number.in_(batch), there.c.instance_number != here.c.instance_number, *covered)
            )
            if labels is not None:
                has_label = or_(Instance.label.in_(labels), there.c.label.in_(labels))
                statement = statement.join(Instance, Instance.number == there.c.instance_number).where(has_label)
            pairs.update((a, b) for a, b in self._connection.execute(statement))
        return pairs

    def _run(self, presence: Presence, label: str | None, begun_ns: float) -> Iterator[tuple[int, int]]:
        """Sort keys (negated time and number, ascending) of the instances of one label."""
        statement = select(Instance.last_seen_ns, Instance.number).where(*_has_presence([presence]))
        if label is not None:
            statement = statement.where(Instance.label == label)
        if begun_ns < math.inf:
            statement = statement.where(Instance.first_seen_ns <= int(begun_ns))
        ordered = statement.order_by(Instance.last_seen_ns.desc(), Instance.number.desc())
        for last_seen_ns, number in self._connection.execute(ordered):
            yield -last_seen_ns, -number


def _shared(
    low: ColumnElement[float],
    high: ColumnElement[float],
    other_low: ColumnElement[float],
    other_high: ColumnElement[float],
) -> ColumnElement[float]:
    """The length that two intervals share; they are known to overlap."""
    return case((high < other_high, high), else_=other_high) - case((low > other_low, low), else_=other_low)


def _has_presence(presences: Collection[Presence]) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return Instance.merged_into.is_(None), Instance.presence.in_(presences)
