"""The instances that a noun phrase may mean, in the states that a moment speaks of: read a part at a time."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from typing import Protocol

from supermap_cli.memory.instance_search import BELIEVED
from supermap_cli.memory.presence_query import PresenceQuery
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.moments import Moment
from supermap_cli.query.views import RelationView
from supermap_cli.types.memory import StateRecord

PART = 100
"""How many instances are read at a time."""


@dataclass(frozen=True)
class Candidate:
    """An instance in one of its states, and the relations by which it fits."""

    instance: StoredInstance
    state: StateRecord
    relations: tuple[RelationView, ...] = ()

    @property
    def key(self) -> tuple[int, int]:
        """The instance's number and the state's index."""
        return self.instance.number, self.state.index


@dataclass(frozen=True)
class Counted:
    """How many instances fit, and how many of them surely stood there."""

    fits: int
    sure: int


class Pool(Protocol):
    """Candidates, as many as there are, without holding all of them."""

    def size(self) -> float:
        """About how many instances there are."""

    def parts(self) -> Iterator[list[Candidate]]:
        """All of them; those seen last come first."""

    def numbers(self) -> Iterator[list[int]]:
        """Numbers among which all that fit are, a part at a time; those seen last come first."""

    def among(self, numbers: Collection[int]) -> list[Candidate]:
        """Those with one of the given numbers, in order."""


@dataclass(frozen=True)
class Listed:
    """A pool that was found already."""

    candidates: list[Candidate]

    def size(self) -> float:
        """How many there are."""
        return len(self.candidates)

    def parts(self) -> Iterator[list[Candidate]]:
        """All at once."""
        yield self.candidates

    def numbers(self) -> Iterator[list[int]]:
        """All at once."""
        yield list(dict.fromkeys(each.instance.number for each in self.candidates))

    def among(self, numbers: Collection[int]) -> list[Candidate]:
        """Those with one of the given numbers."""
        wanted = set(numbers)
        return [each for each in self.candidates if each.instance.number in wanted]


@dataclass(frozen=True)
class Called:
    """All that are called by one of `labels` (`None`: whatever they are called), or the one with a `number`.

    - as what is asked for: their states at the moment, each called so in that state;
    - `as_reference`: the states that others may stand in relation to (`Moment.reference_states`);
    - `ever`: what was called so in any of its states, in the newest that the moment speaks of.
    """

    reader: MapReader
    moment: Moment
    labels: frozenset[str] | None
    number: int | None = None
    as_reference: bool = False
    ever: bool = False

    def size(self) -> float:
        """How many are called so today."""
        if self.number is not None:
            return 1
        if self.labels is None:
            return math.inf
        return self.reader.search.count(self.labels, ["present"] if self.moment.kind == "now" else BELIEVED)

    def counted(self) -> Counted | None:
        """How many fit, where the database can count them without reading them."""
        kind = self.moment.kind
        if self.number is not None or kind not in {"now", "last", "at"}:
            return None
        if kind == "at":
            tally = self.as_of().counts_of(self.labels)
            return Counted(tally.matching, tally.certain)
        count = self.reader.search.count(self.labels, ["present"] if kind == "now" else BELIEVED)
        return Counted(count, count)

    def as_of(self) -> PresenceQuery:
        """Everything at the moment, which is one time."""
        return self.reader.presence_at(int(self.moment.low_ns), self.moment.since_ns)

    def parts(self) -> Iterator[list[Candidate]]:
        """All of them; those seen last come first."""
        for part in self.numbers():
            found = self._by_number(part)
            yield [candidate for number in part for candidate in found.get(number, ())]

    def numbers(self) -> Iterator[list[int]]:
        """Numbers among which all that fit are, a part at a time; those seen last come first."""
        numbers = iter(self._numbers())
        while part := list(islice(numbers, PART)):
            yield part

    def lives(self) -> Iterator[StoredInstance]:
        """All that were ever called so, whether they have a state at the moment or not."""
        numbers = iter(self._numbers())
        while part := list(islice(numbers, PART)):
            lives = self.reader.instances_by_number(part)
            believed = (lives[number] for number in part if number in lives and lives[number].presence != "doubted")
            yield from (each for each in believed if self.labels is None or is_called(each, self.labels))

    def first(self, limit: int) -> list[int]:
        """The smallest numbers of all that were ever called so, and may have a state at the moment."""
        if self.number is not None:
            return [self.number]
        today = self.reader.search.first_labelled(self.labels, limit)
        once = [] if self.labels is None else self.reader.search.formerly_labelled(self.labels)
        return sorted({*today, *once})[:limit]

    def among(self, numbers: Collection[int]) -> list[Candidate]:
        """Those with one of the given numbers, in order."""
        wanted = set(numbers) if self.number is None else {self.number} & set(numbers)
        if self.labels is not None:
            wanted = self.reader.search.ever_labelled(wanted, self.labels)
        return [candidate for _, found in sorted(self._by_number(wanted).items()) for candidate in found]

    def _by_number(self, numbers: Collection[int]) -> dict[int, list[Candidate]]:
        traversal = self.moment.traversal
        lives = self.reader.instances_by_number(numbers, () if traversal is None else (traversal.id,))
        return {number: self._states(life) for number, life in lives.items() if life.presence != "doubted"}

    def _states(self, life: StoredInstance) -> list[Candidate]:
        if self.ever:
            called = self.labels is None or is_called(life, self.labels)
            return [Candidate(life, state) for state in self.moment.states(life)[-1:] if called]
        states = self.moment.reference_states(life) if self.as_reference else self.moment.states(life)
        return [
            Candidate(life, state) for state in states if self.labels is None or label_in(life, state) in self.labels
        ]

    def _numbers(self) -> Iterable[int]:
        """Numbers among which all that fit are."""
        finder, labels = self.reader.search, self.labels
        if self.number is not None:
            return [self.number]
        if labels is not None and not labels:
            return []
        kind = self.moment.kind
        if kind == "now" and not self.ever:
            return finder.labelled(labels, ["present"])
        if kind == "last" and not self.as_reference and not self.ever:
            return finder.labelled(labels)
        if self.moment.traversal is not None and not self.as_reference:
            seen = self.reader.survivors.of(finder.seen_in(self.moment.traversal.id, labels))
            return sorted(set(seen.values()))
        begun_ns = self.moment.low_ns if kind == "at" and not (self.as_reference or self.ever) else math.inf
        today = finder.labelled(labels, begun_ns=begun_ns)
        return today if labels is None else chain(today, finder.formerly_labelled(labels))


def label_in(instance: StoredInstance, state: StateRecord) -> str:
    """What an instance is called in one of its states: in the newest, what it is called today."""
    return instance.label if state is instance.states[-1] else state.label


def is_called(instance: StoredInstance, labels: Collection[str]) -> bool:
    """Whether an instance is called so, or was in one of its states."""
    return instance.label in labels or any(state.label in labels for state in instance.states)
