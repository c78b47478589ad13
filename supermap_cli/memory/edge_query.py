"""Which present instances are related by stored edges: a join over the edges that reads no instance."""

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
class EdgeEnd:
    """The condition on one end of an edge: a present instance with one of the labels (`None`: any), or a `number`."""

    labels: frozenset[str] | None
    number: int | None = None

    def conditions(self, instance: type[models.Instance]) -> Iterator[ColumnElement[bool]]:
        """As conditions on a row of `instance`."""
        yield instance.merged_into.is_(None)
        yield instance.presence == "present"
        if self.number is not None:
            yield instance.number == self.number
        if self.labels is not None:
            yield instance.label.in_(self.labels)


@dataclass(frozen=True)
class EdgeQuery:
    """Edges between candidates and references that hold after a time; `turned`: the candidate is the edge's object."""

    reader: MapReader
    candidates: EdgeEnd
    references: EdgeEnd
    after_ns: int

    def numbers(self, relation: str, *, turned: bool) -> set[int]:
        """The candidates with such an edge, edges of instances that were merged into them not included."""
        return set(self.reader.connection.execute(self._edges(relation, turned).distinct()).scalars())

    def any(self, relation: str, *, turned: bool) -> bool:
        """Whether there is such an edge."""
        return self.reader.connection.execute(self._edges(relation, turned).limit(1)).first() is not None

    def merged(self, relations: Collection[str]) -> set[int]:
        """The instances, candidates or not, with an edge that was written for an instance merged into one of them."""
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
        ends: Iterable[ColumnElement[bool]] = (*subject.conditions(Subject), *obj.conditions(Object))
        return (
            select(Object.number if turned else Subject.number)
            .select_from(Edge)
            .join(Subject, Subject.number == Edge.subject_number)
            .join(Object, Object.number == Edge.object_number)
            .where(Edge.relation == relation, holds, *ends)
        )
