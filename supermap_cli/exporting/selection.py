"""Which part of the memory leaves: by label, by presence, and as of a traversal or a time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TypeVar

from sqlalchemy import select

from supermap_cli.errors import QueryError
from supermap_cli.exporting.leaving import Leaving, leaving_as_of, leaving_today
from supermap_cli.memory.labelled_observations import LabelledObservations
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.streaming import survivors_of_merged
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.instants import Instant, find_traversal, instant_of
from supermap_cli.query.moments import Moment
from supermap_cli.query.standing import Standing, standing_at
from supermap_cli.types.memory import StateRecord
from supermap_schema.models import PRESENCES, Instance, State

Item = TypeVar("Item")

PRESENT = frozenset({"present"})
BELIEVED = frozenset({"present", "absent"})
EVERYTHING = frozenset(PRESENCES)
PERHAPS_THERE = frozenset({"present", "unknown"})
KNOWN = frozenset({"present", "unknown", "absent"})
HEARD = 50
"""Instances of which it is read together what was ever said of them."""


@dataclass(frozen=True)
class Selection:
    """What is asked for, as it was understood.

    `labels` empty: all. `traversal`: the states that it supported. `at`: the state that each was in, or perhaps was, at
    that time; `labels` and `presences` are of then. Neither: the newest state of what is present, all states of all
    where not only that is asked for.
    """

    labels: frozenset[str] = frozenset()
    presences: frozenset[str] = EVERYTHING
    traversal: StoredTraversal | None = None
    at: Instant | None = None

    def states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:
        """The states of an instance that leave, oldest first, where no time is asked for; none where it stays."""
        if instance.presence not in self.presences or not self.is_called(instance.label):
            return ()
        if self._moment is not None:
            return self._moment.states(instance)
        return instance.states[-1:] if self.presences == PRESENT else instance.states

    def standing(self, instance: StoredInstance) -> Standing | None:
        """What is known of an instance at the time asked for; `None` where it stays.

        What is doubted today was, as far as anybody knows, never there.
        """
        if self.at is None or instance.presence == "doubted":
            return None
        known = standing_at(instance, self.at.at_ns, self.at.begun_ns)
        return known if known is not None and known.presence in self.presences else None

    def is_called(self, label: str) -> bool:
        """Whether a label is among those that leave."""
        return not self.labels or label.casefold() in self.labels

    @property
    def at_ns(self) -> int | None:
        """The time asked for."""
        return None if self.at is None else self.at.at_ns

    @property
    def keyframes(self) -> tuple[int | None, int | None]:
        """What leaves of keyframes, and of what was seen in them: those of one traversal, and those until a time."""
        return None if self.traversal is None else self.traversal.id, self.at_ns

    def has_traversal(self, traversal: StoredTraversal) -> bool:
        """Whether a traversal leaves: the one asked for, or those that had begun by the time."""
        if self.traversal is not None:
            return traversal.id == self.traversal.id
        return self.at_ns is None or traversal.start_ns <= self.at_ns

    def has_interval(self, since_ns: int, until_ns: int | None) -> bool:
        """Whether what held in [since_ns, until_ns) leaves."""
        if self.traversal is not None:
            return since_ns <= self.traversal.end_ns and (until_ns is None or until_ns > self.traversal.start_ns)
        if self.at_ns is not None:
            return since_ns <= self.at_ns and (until_ns is None or until_ns > self.at_ns)
        return until_ns is None or self.presences != PRESENT

    def has_event(self, traversal_id: int, not_after_ns: int) -> bool:
        """Whether something that happened leaves."""
        if self.traversal is not None:
            return traversal_id == self.traversal.id
        return self.at_ns is None or not_after_ns <= self.at_ns

    @cached_property
    def _moment(self) -> Moment | None:
        if self.traversal is None:
            return None
        span = (self.traversal.start_ns, self.traversal.end_ns)
        return Moment("traversal", f"in {self.traversal.name}", *span, self.traversal)


def select_part(
    reader: MapReader,
    labels: Collection[str] = (),
    *,
    presences: frozenset[str] = EVERYTHING,
    traversal: str | None = None,
    at: str | None = None,
) -> Selection:
    """A selection from words. Raises `QueryError` for a label, traversal or time that the map does not know."""
    if traversal is not None and at is not None:
        raise QueryError("a traversal and a time cannot be asked for at once", cure="give --traversal or --at")
    found = None if traversal is None else find_traversal(reader.traversals, traversal)
    instant = None if at is None else instant_of(at, reader, clock_of(reader))
    return Selection(_known_labels(reader, labels, ever=at is not None), presences, found, instant)


def _known_labels(reader: MapReader, labels: Collection[str], *, ever: bool) -> frozenset[str]:
    """The labels as they are compared; `ever` knows those, too, that things had in an earlier state."""
    wanted = frozenset(label.casefold() for label in labels)
    columns = (Instance.label, State.label) if ever else (Instance.label,)
    known = {
        label.casefold()
        for column in columns
        for label in reader.connection.execute(select(column).distinct()).scalars()
    }
    for label in sorted(wanted - known):
        there_are = ", ".join(sorted(known)) or "none"
        raise QueryError(f"there is nothing labelled {label!r} in the map", cure=f"the labels are: {there_are}")
    return wanted


class Source:
    """A map and the part of it that leaves; what it holds at once is a number for each instance at most."""

    def __init__(
        self, reader: MapReader, selection: Selection, progress: Callable[[str, int], None] | None = None
    ) -> None:
        """`progress` is told, now and then, how many of what have been written."""
        self.reader = reader
        self.selection = selection
        self._progress = progress
        self.clock: Clock = clock_of(reader)
        self.traversals = tuple(filter(selection.has_traversal, reader.traversals))
        self.traversal_names = {each.id: each.name for each in reader.traversals}

    def instances(self, *, visits: bool = False, named: bool = True) -> Iterator[Leaving]:
        """Every instance that leaves; its visits are read only if wanted.

        What it was called at a time takes reading all that was said of it: without `named` it has the label of its
        state, and nothing is counted.
        """
        selection = self.selection
        if selection.at is not None:
            yield from self._as_of(selection.at, visits=visits, named=named or bool(selection.labels))
            return
        for instance in self.reader.iter_instances(visits=visits or selection.traversal is not None):
            states = selection.states(instance)
            if states:
                yield leaving_today(instance, states)

    def _as_of(self, at: Instant, *, visits: bool, named: bool) -> Iterator[Leaving]:
        hearing = LabelledObservations(self.reader)
        stood = (
            (instance, standing)
            for instance in self.reader.iter_instances(visits=visits)
            if (standing := self.selection.standing(instance)) is not None
        )
        while part := list(islice(stood, HEARD)):
            said = hearing.of([instance for instance, _ in part]) if named else {}
            for instance, standing in part:
                leaving = leaving_as_of(instance, standing, at.at_ns, said.get(instance.number, ()))
                if self.selection.is_called(leaving.label):
                    yield leaving

    def counted(self, name: str, items: Iterable[Item]) -> Iterator[Item]:
        """The items while they are written; progress is told of every thousandth."""
        for index, item in enumerate(items):
            if self._progress is not None and index % 1000 == 0:
                self._progress(name, index)
            yield item

    def id_today(self, number: int, own_id: str) -> str | None:
        """The id under which an instance leaves: that of what it was merged into; `None` if it stays."""
        number, text_id = self._merged.get(number, (number, own_id))
        return None if self._chosen is not None and number not in self._chosen else text_id

    @cached_property
    def _merged(self) -> dict[int, tuple[int, str]]:
        return survivors_of_merged(self.reader)

    @cached_property
    def _chosen(self) -> frozenset[int] | None:
        """The numbers of what leaves; `None`: everything."""
        if self.selection == Selection():
            return None
        return frozenset(each.number for each in self.instances(named=False))
