"""The part of the map to export: by label, presence, and traversal or time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TypeVar

from sqlalchemy import select

from supermap_cli.errors import QueryError
from supermap_cli.exporting.exported_instance import ExportedInstance, export_as_of, export_current
from supermap_cli.memory.labelled_observations import LabelledObservations
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.streaming import survivors_of_merged
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.presence_at import PresenceAt, presence_at
from supermap_cli.query.time_points import TimePoint, find_traversal, parse_time_point
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.types.memory import StateRecord
from supermap_schema.models import PRESENCES, Instance, State

Item = TypeVar("Item")

PRESENT = frozenset({"present"})
BELIEVED = frozenset({"present", "absent"})
ALL_PRESENCES = frozenset(PRESENCES)
POSSIBLY_PRESENT = frozenset({"present", "unknown"})
ANY_PRESENCE_AT = frozenset({"present", "unknown", "absent"})
OBSERVATION_BATCH = 50
"""Instances whose observations are read at a time."""


@dataclass(frozen=True)
class Selection:
    """What to export.

    `labels`: empty for all. `traversal`: the states that it supported. `at`: the state of each instance at that time,
    known or possible; `labels` and `presences` are as of then. Neither: the newest state if only present instances are
    selected, else all states.
    """

    labels: frozenset[str] = frozenset()
    presences: frozenset[str] = ALL_PRESENCES
    traversal: StoredTraversal | None = None
    at: TimePoint | None = None

    def states(self, instance: StoredInstance) -> tuple[StateRecord, ...]:
        """The exported states of an instance, oldest first, if no time is selected; empty if it is not selected."""
        if instance.presence not in self.presences or not self.has_label(instance.label):
            return ()
        if self._selector is not None:
            return self._selector.states(instance)
        return instance.states[-1:] if self.presences == PRESENT else instance.states

    def presence_then(self, instance: StoredInstance) -> PresenceAt | None:
        """The presence of an instance at the selected time; `None` if it is not selected. Demoted instances ("doubted")
        never are.
        """
        if self.at is None or instance.presence == "doubted":
            return None
        known = presence_at(instance, self.at.at_ns, self.at.traversal_start_ns)
        return known if known is not None and known.value in self.presences else None

    def has_label(self, label: str) -> bool:
        """Whether a label is selected."""
        return not self.labels or label.casefold() in self.labels

    @property
    def at_ns(self) -> int | None:
        """The selected time."""
        return None if self.at is None else self.at.at_ns

    @property
    def keyframes(self) -> tuple[int | None, int | None]:
        """Limits on the exported keyframes and their observations: a traversal's id, and a latest time."""
        return None if self.traversal is None else self.traversal.id, self.at_ns

    def includes_traversal(self, traversal: StoredTraversal) -> bool:
        """Whether a traversal is exported: the selected one, or any that had begun by the time."""
        if self.traversal is not None:
            return traversal.id == self.traversal.id
        return self.at_ns is None or traversal.start_ns <= self.at_ns

    def includes_interval(self, since_ns: int, until_ns: int | None) -> bool:
        """Whether an edge that held in [since_ns, until_ns) is exported."""
        if self.traversal is not None:
            return since_ns <= self.traversal.end_ns and (until_ns is None or until_ns > self.traversal.start_ns)
        if self.at_ns is not None:
            return since_ns <= self.at_ns and (until_ns is None or until_ns > self.at_ns)
        return until_ns is None or self.presences != PRESENT

    def includes_event(self, traversal_id: int, not_after_ns: int) -> bool:
        """Whether an event is exported."""
        if self.traversal is not None:
            return traversal_id == self.traversal.id
        return self.at_ns is None or not_after_ns <= self.at_ns

    @cached_property
    def _selector(self) -> TimeSelector | None:
        if self.traversal is None:
            return None
        span = (self.traversal.start_ns, self.traversal.end_ns)
        return TimeSelector("traversal", f"in {self.traversal.name}", *span, self.traversal)


def select_part(
    reader: MapReader,
    labels: Collection[str] = (),
    *,
    presences: frozenset[str] = ALL_PRESENCES,
    traversal: str | None = None,
    at: str | None = None,
) -> Selection:
    """A selection from texts. Raises `QueryError` for an unknown label, traversal or time."""
    if traversal is not None and at is not None:
        raise QueryError("a traversal and a time cannot be asked for at once", cure="give --traversal or --at")
    found = None if traversal is None else find_traversal(reader.traversals, traversal)
    instant = None if at is None else parse_time_point(at, reader, clock_of(reader))
    return Selection(_known_labels(reader, labels, any_state=at is not None), presences, found, instant)


def _known_labels(reader: MapReader, labels: Collection[str], *, any_state: bool) -> frozenset[str]:
    """The labels in lower case; with `any_state` also those of earlier states. Raises `QueryError` for unknown ones."""
    wanted = frozenset(label.casefold() for label in labels)
    columns = (Instance.label, State.label) if any_state else (Instance.label,)
    known = {
        label.casefold()
        for column in columns
        for label in reader.connection.execute(select(column).distinct()).scalars()
    }
    for label in sorted(wanted - known):
        there_are = ", ".join(sorted(known)) or "none"
        raise QueryError(f"there is nothing labelled {label!r} in the map", cure=f"the labels are: {there_are}")
    return wanted


class ExportSource:
    """A map and the selected part of it; it holds at most one number per instance in memory."""

    def __init__(
        self, reader: MapReader, selection: Selection, progress: Callable[[str, int], None] | None = None
    ) -> None:
        """`progress` is called from time to time with a table's name and the number of rows written."""
        self.reader = reader
        self.selection = selection
        self._progress = progress
        self.clock: Clock = clock_of(reader)
        self.traversals = tuple(filter(selection.includes_traversal, reader.traversals))
        self.traversal_names = {traversal.id: traversal.name for traversal in reader.traversals}

    def instances(self, *, visits: bool = False, named: bool = True) -> Iterator[ExportedInstance]:
        """Every selected instance; visits are read only if wanted.

        Its label as of a time needs all of its observations: without `named` it gets the label of its state, and no
        counts.
        """
        selection = self.selection
        if selection.at is not None:
            yield from self._as_of(selection.at, visits=visits, named=named or bool(selection.labels))
            return
        for instance in self.reader.iter_instances(visits=visits or selection.traversal is not None):
            states = selection.states(instance)
            if states:
                yield export_current(instance, states)

    def _as_of(self, at: TimePoint, *, visits: bool, named: bool) -> Iterator[ExportedInstance]:
        observation_reader = LabelledObservations(self.reader)
        in_selection = (
            (instance, presence_then)
            for instance in self.reader.iter_instances(visits=visits)
            if (presence_then := self.selection.presence_then(instance)) is not None
        )
        while batch := list(islice(in_selection, OBSERVATION_BATCH)):
            observations = observation_reader.of([instance for instance, _ in batch]) if named else {}
            for instance, presence_then in batch:
                exported = export_as_of(instance, presence_then, at.at_ns, observations.get(instance.number, ()))
                if self.selection.has_label(exported.label):
                    yield exported

    def with_progress(self, name: str, items: Iterable[Item]) -> Iterator[Item]:
        """The items, reporting progress every thousand."""
        for index, item in enumerate(items):
            if self._progress is not None and index % 1000 == 0:
                self._progress(name, index)
            yield item

    def current_id(self, number: int, own_id: str) -> str | None:
        """The id of an instance, or of the one it was merged into; `None` if that is not selected."""
        number, text_id = self._survivors.get(number, (number, own_id))
        return None if self._selected_numbers is not None and number not in self._selected_numbers else text_id

    @cached_property
    def _survivors(self) -> dict[int, tuple[int, str]]:
        return survivors_of_merged(self.reader)

    @cached_property
    def _selected_numbers(self) -> frozenset[int] | None:
        """The numbers of selected instances; `None` for all."""
        if self.selection == Selection():
            return None
        return frozenset(instance.number for instance in self.instances(named=False))
