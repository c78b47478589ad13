"""Which present things stored edges relate to which others: a join over the edges, without reading the things."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Select, or_, select
from sqlalchemy.orm import aliased

from supermap_cli.memory.reading import MapReader
from supermap_schema import models

Edge = models.SpatialEdge
Subject, Object = aliased(models.Instance, name="subject"), aliased(models.Instance, name="object")


@dataclass(frozen=True)
class End:
    """What stands at one end of an edge: present things of some labels (`None`: of any), or the one with a `number`."""

    labels: frozenset[str] | None
    number: int | None = None

    def of(self, instance: type[models.Instance]) -> Iterator[ColumnElement[bool]]:
        """As conditions on a row."""
        yield instance.merged_into.is_(None)
        yield instance.presence == "present"
        if self.number is not None:
            yield instance.number == self.number
        if self.labels is not None:
            yield instance.label.in_(self.labels)


@dataclass(frozen=True)
class Linked:
    """Edges between two kinds of things that hold after a time; `turned`: the candidate is the object of an edge."""

    reader: MapReader
    candidates: End
    references: End
    after_ns: int

    def numbers(self, relation: str, *, turned: bool) -> set[int]:
        """The candidates that have such an edge of their own, and not of a part of them."""
        return set(self.reader.connection.execute(self._edges(relation, turned).distinct()).scalars())

    def any(self, relation: str, *, turned: bool) -> bool:
        """Whether there is one."""
        return self.reader.connection.execute(self._edges(relation, turned).limit(1)).first() is not None

    def merged(self, relations: Collection[str]) -> set[int]:
        """All things, candidates or not, between which an edge is that was written for a part of one of them."""
        parts = select(models.Instance.number).where(models.Instance.merged_into.is_not(None))
        found: set[int] = set()
        for end in (Edge.subject_number, Edge.object_number):
            statement = select(Edge.subject_number, Edge.object_number).where(end.in_(parts))
            pairs = self.reader.connection.execute(statement.where(Edge.relation.in_(relations)))
            found.update(number for pair in pairs for number in pair)
        return set(self.reader.survivors.of(found).values())

    def _edges(self, relation: str, turned: bool) -> Select[Any]:
        subject, obj = (self.references, self.candidates) if turned else (self.candidates, self.references)
        holds = or_(Edge.until_ns.is_(None), Edge.until_ns > self.after_ns)
        ends: Iterable[ColumnElement[bool]] = (*subject.of(Subject), *obj.of(Object))
        return (
            select(Object.number if turned else Subject.number)
            .select_from(Edge)
            .join(Subject, Subject.number == Edge.subject_number)
            .join(Object, Object.number == Edge.object_number)
            .where(Edge.relation == relation, holds, *ends)
        )
