"""Which instances were present, absent or unknown at a time, decided in SQL from their states alone.

The rules are those of `supermap_cli.query.standing`; a test compares the two.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection
from dataclasses import dataclass
from itertools import islice
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, and_, case, false, func, literal, null, or_, select
from sqlalchemy.orm import aliased

from supermap_cli.memory.instance_search import BELIEVED
from supermap_schema import models

Instance = models.Instance
Last, Next, Begun = (aliased(models.State, name=name) for name in ("last_begun", "next_state", "begun"))
"""The last state that had begun at the time, the one after it, and any that had begun."""


@dataclass(frozen=True)
class PresenceCounts:
    """Numbers of instances with some labels at a time.

    `matching` were in a state with such a label that is not known to have ended by then; `certain` of these were surely
    there. `unknown` of all that ever had such a label are neither present nor absent for sure; `unknown_others` of
    these are not among `matching`.
    """

    matching: int
    certain: int
    unknown: int
    unknown_others: int


class PresenceQuery:
    """Presence at a time, or at the end of a traversal that began at `since_ns`; of instances not demoted or merged."""

    def __init__(self, connection: Connection, at_ns: int, since_ns: int | None = None) -> None:
        self._connection = connection
        self._at_ns = at_ns
        self._presence = _presence(at_ns, since_ns)
        self._counts: dict[frozenset[str] | None, PresenceCounts] = {}

    def counts(self) -> dict[tuple[str, str], int]:
        """How many were present, absent and unknown, by presence and the label of their last state until then."""
        statement = self._with_states(self._presence.label("presence_then"), _LABEL.label("label_then"), func.count())
        grouped = statement.where(self._presence.is_not(None)).group_by("presence_then", "label_then")
        return {(presence, label or ""): count for presence, label, count in self._connection.execute(grouped)}

    def last_seen(self, presence: str, limit: int) -> list[int]:
        """The numbers of at most `limit` instances with a presence, those seen last first."""
        statement = self._with_states(Instance.last_seen_ns, Instance.number).where(self._presence == presence)
        ordered = statement.order_by(Instance.last_seen_ns.desc(), Instance.number.desc()).limit(limit)
        runs = (
            [
                (-seen_ns, -number)
                for seen_ns, number in self._connection.execute(ordered.where(Instance.presence == today))
            ]
            for today in BELIEVED
        )
        return [-number for _, number in islice(heapq.merge(*runs), limit)]

    def counts_of(self, labels: frozenset[str] | None) -> PresenceCounts:
        """How many instances of some labels (`None`: of all) there were; cached."""
        if labels not in self._counts:
            self._counts[labels] = self._counts_of(labels)
        return self._counts[labels]

    def _counts_of(self, labels: Collection[str] | None) -> PresenceCounts:
        matching, unknown = self._matching(labels), self._presence == "unknown"
        conditions = matching, and_(matching, ~unknown), unknown, and_(~matching, unknown)
        counts = (func.count().filter(condition) for condition in conditions)
        return PresenceCounts(*self._connection.execute(self._ever_labelled(labels, *counts)).one())

    def unknown(self, labels: Collection[str] | None, limit: int, without: Collection[str] = ()) -> list[int]:
        """The smallest numbers of the unknown instances that ever had one of the labels, without the given text ids."""
        statement = self._ever_labelled(labels, Instance.number)
        statement = statement.where(self._presence == "unknown", Instance.id.not_in(without))
        return list(self._connection.execute(statement.order_by(Instance.number).limit(limit)).scalars())

    def _matching(self, labels: Collection[str] | None) -> ColumnElement[bool]:
        """In a state with one of the labels that is not known to have ended (`standing.held_at`)."""
        held = and_(Last.id.is_not(None), or_(Last.gone_ns.is_(None), Last.gone_ns > self._at_ns))
        return held if labels is None else and_(held, _LABEL.in_(labels))

    def _ever_labelled(self, labels: Collection[str] | None, *wanted: Any) -> Select[Any]:
        """Over the instances that have one of the labels today, or had it in one of their states."""
        statement = self._with_states(*wanted)
        if labels is None:
            return statement
        today = select(Instance.number).where(Instance.merged_into.is_(None), Instance.label.in_(labels))
        formerly = select(models.State.instance_number).where(models.State.label.in_(labels))
        return statement.where(Instance.number.in_(today.union(formerly)))

    def _with_states(self, *wanted: Any) -> Select[Any]:
        """Over all instances, each joined with its last state that had begun and the one after it."""
        begun = Begun.instance_number == Instance.number, Begun.first_seen_ns <= self._at_ns
        last = select(func.max(Begun.state_index)).where(*begun).correlate(Instance).scalar_subquery()
        return (
            select(*wanted)
            .select_from(Instance)
            .outerjoin(Last, and_(Last.instance_number == Instance.number, Last.state_index == last))
            .outerjoin(
                Next,
                and_(
                    Next.instance_number == Instance.number,
                    Next.state_index == func.coalesce(Last.state_index + 1, literal(0)),
                ),
            )
            .where(Instance.merged_into.is_(None), Instance.presence.in_(BELIEVED))
        )


_LABEL = case((Next.id.is_(None), Instance.label), else_=Last.label)
"""The label in the last state that had begun; in the newest state it is the instance's label."""


def _presence(at_ns: int, since_ns: int | None) -> ColumnElement[Any]:
    """`standing.standing_at` as SQL: "present", "absent", "unknown", or NULL for an instance without states."""
    seen_since = false() if since_ns is None else Last.last_seen_ns >= since_ns
    empty_since = false() if since_ns is None else Next.empty_before_ns >= since_ns
    never_left = and_(Last.gone_ns.is_(None), Next.id.is_(None))
    not_yet_left = or_(Last.gone_ns.is_(None), Last.gone_ns > at_ns)
    began = Last.id.is_not(None)
    return case(
        (and_(Last.id.is_(None), Next.id.is_(None)), null()),
        (and_(began, Last.last_seen_ns >= at_ns), "present"),
        (and_(began, never_left, Instance.presence == "absent"), "unknown"),
        (and_(began, never_left), "present"),
        (and_(began, not_yet_left, seen_since), "present"),
        (and_(began, not_yet_left), "unknown"),
        (Next.id.is_(None), "absent"),
        (Next.empty_before_ns.is_(None), "unknown"),
        (Next.empty_before_ns >= at_ns, "absent"),
        (empty_since, "absent"),
        else_="unknown",
    )
