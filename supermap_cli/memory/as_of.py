"""How many things stood at a time, and which those are: judged by the database itself, from states alone.

The judgement is that of `supermap_cli.query.presence_at`, and a test holds the two together.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection
from dataclasses import dataclass
from itertools import islice
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, and_, case, false, func, literal, null, or_, select
from sqlalchemy.orm import aliased

from supermap_cli.memory.finding import BELIEVED
from supermap_schema import models

Instance = models.Instance
Last, Next, Begun = (aliased(models.State, name=name) for name in ("last_begun", "next_state", "begun"))


@dataclass(frozen=True)
class Tally:
    """How many were in a state of some labels that was not known to have ended, and how many of those surely stood
    there; of how many that ever were called so nobody can say, and how many of those do not fit.
    """

    fits: int
    sure: int
    unsure: int
    besides: int


class AsOf:
    """One time, or the end of a traversal that began at `since_ns`; what is doubted or merged is not spoken of."""

    def __init__(self, connection: Connection, at_ns: int, since_ns: int | None = None) -> None:
        self._connection = connection
        self._at_ns = at_ns
        self._known = _known(at_ns, since_ns)
        self._tallies: dict[frozenset[str] | None, Tally] = {}

    def counts(self) -> dict[tuple[str, str], int]:
        """How many were present, absent, unknown, by what they are called in their last state until then."""
        statement = self._judged(self._known.label("known"), _CALLED.label("called"), func.count())
        found = self._connection.execute(statement.where(self._known.is_not(None)).group_by("known", "called"))
        return {(known, called or ""): count for known, called, count in found}

    def first(self, known: str, limit: int) -> list[int]:
        """The numbers of the first so many of which this is known, those seen last first."""
        statement = self._judged(Instance.last_seen_ns, Instance.number).where(self._known == known)
        ordered = statement.order_by(Instance.last_seen_ns.desc(), Instance.number.desc()).limit(limit)
        runs = (
            [
                (-seen_ns, -number)
                for seen_ns, number in self._connection.execute(ordered.where(Instance.presence == presence))
            ]
            for presence in BELIEVED
        )
        return [-number for _, number in islice(heapq.merge(*runs), limit)]

    def tally(self, labels: frozenset[str] | None) -> Tally:
        """How many things of some labels (or all) there were: counted once."""
        if labels not in self._tallies:
            self._tallies[labels] = self._tally(labels)
        return self._tallies[labels]

    def _tally(self, labels: Collection[str] | None) -> Tally:
        fits, unsure = self._fits(labels), self._known == "unknown"
        each = fits, and_(fits, ~unsure), unsure, and_(~fits, unsure)
        counts = (func.count().filter(which) for which in each)
        return Tally(*self._connection.execute(self._called(labels, *counts)).one())

    def unsure(self, labels: Collection[str] | None, limit: int, but: Collection[str] = ()) -> list[int]:
        """The smallest numbers of those ever called so of which nobody can say, but for those with the given ids."""
        statement = self._called(labels, Instance.number).where(self._known == "unknown", Instance.id.not_in(but))
        return list(self._connection.execute(statement.order_by(Instance.number).limit(limit)).scalars())

    def _fits(self, labels: Collection[str] | None) -> ColumnElement[bool]:
        """In a state called so, as far as anybody knew (`presence_at.state_held_at`)."""
        held = and_(Last.id.is_not(None), or_(Last.gone_ns.is_(None), Last.gone_ns > self._at_ns))
        return held if labels is None else and_(held, _CALLED.in_(labels))

    def _called(self, labels: Collection[str] | None, *wanted: Any) -> Select[Any]:
        """Of all that are called so, or were in one of their states."""
        statement = self._judged(*wanted)
        if labels is None:
            return statement
        today = select(Instance.number).where(Instance.merged_into.is_(None), Instance.label.in_(labels))
        once = select(models.State.instance_number).where(models.State.label.in_(labels))
        return statement.where(Instance.number.in_(today.union(once)))

    def _judged(self, *wanted: Any) -> Select[Any]:
        """Of all instances with the last state that had begun and the one after it, by index from instance to state."""
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


_CALLED = case((Next.id.is_(None), Instance.label), else_=Last.label)
"""What a thing is called in the last state that had begun: in its newest, what it is called today."""


def _known(at_ns: int, since_ns: int | None) -> ColumnElement[Any]:
    """`presence_at.presence_at` as an expression: "present", "absent", "unknown", or NULL for what has no state."""
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
