"""The instances that a noun phrase may mean, in the states that a moment speaks of: read a part at a time."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from typing import Protocol

from supermap_cli.memory.as_of import AsOf
from supermap_cli.memory.finding import BELIEVED
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.query.views import RelationView
from supermap_cli.types.memory import StateRecord

BATCH_SIZE = 100
"""How many instances are read at a time."""


@dataclass(frozen=True)
class InstanceCandidate:
    """An instance in one of its states, and the relations by which it fits."""

    instance: StoredInstance
    state: StateRecord
    relations: tuple[RelationView, ...] = ()

    @property
    def key(self) -> tuple[int, int]:
        """The instance's number and the state's index."""
        return self.instance.number, self.state.index


@dataclass(frozen=True)
class MatchCount:
    """How many instances fit, and how many of them surely stood there."""

    total: int
    certain: int


class CandidateSource(Protocol):
    """Candidates, as many as there are, without holding all of them."""

    def size(self) -> float:
        """About how many instances there are."""

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All of them; those seen last come first."""

    def numbers(self) -> Iterator[list[int]]:
        """Numbers among which all that fit are, a part at a time; those seen last come first."""

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """Those with one of the given numbers, in order."""


@dataclass(frozen=True)
class CandidateList:
    """A pool that was found already."""

    candidates: list[InstanceCandidate]

    def size(self) -> float:
        """How many there are."""
        return len(self.candidates)

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All at once."""
        yield self.candidates

    def numbers(self) -> Iterator[list[int]]:
        """All at once."""
        yield list(dict.fromkeys(candidate.instance.number for candidate in self.candidates))

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """Those with one of the given numbers."""
        wanted = set(numbers)
        return [candidate for candidate in self.candidates if candidate.instance.number in wanted]


@dataclass(frozen=True)
class LabelCandidates:
    """All that are called by one of `labels` (`None`: whatever they are called), or the one with a `number`.

    - as what is asked for: their states at the moment, each called so in that state;
    - `as_reference`: the states that others may stand in relation to (`Moment.reference_states`);
    - `ever`: what was called so in any of its states, in the newest that the moment speaks of.
    """

    reader: MapReader
    selector: TimeSelector
    labels: frozenset[str] | None
    number: int | None = None
    as_reference: bool = False
    any_state: bool = False

    def size(self) -> float:
        """How many are called so today."""
        if self.number is not None:
            return 1
        if self.labels is None:
            return math.inf
        return self.reader.finder.count(self.labels, ["present"] if self.selector.kind == "now" else BELIEVED)

    def match_count(self) -> MatchCount | None:
        """How many fit, where the database can count them without reading them."""
        kind = self.selector.kind
        if self.number is not None or kind not in {"now", "last", "at"}:
            return None
        if kind == "at":
            tally = self.as_of().tally(self.labels)
            return MatchCount(tally.fits, tally.sure)
        count = self.reader.finder.count(self.labels, ["present"] if kind == "now" else BELIEVED)
        return MatchCount(count, count)

    def as_of(self) -> AsOf:
        """Everything at the moment, which is one time."""
        return self.reader.as_of(int(self.selector.low_ns), self.selector.since_ns)

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All of them; those seen last come first."""
        for part in self.numbers():
            found = self._candidates_by_number(part)
            yield [candidate for number in part for candidate in found.get(number, ())]

    def numbers(self) -> Iterator[list[int]]:
        """Numbers among which all that fit are, a part at a time; those seen last come first."""
        numbers = iter(self._all_numbers())
        while part := list(islice(numbers, BATCH_SIZE)):
            yield part

    def instances(self) -> Iterator[StoredInstance]:
        """All that were ever called so, whether they have a state at the moment or not."""
        numbers = iter(self._all_numbers())
        while part := list(islice(numbers, BATCH_SIZE)):
            instances = self.reader.lives_of(part)
            believed = (
                instances[number] for number in part if number in instances and instances[number].presence != "doubted"
            )
            yield from (instance for instance in believed if self.labels is None or had_label(instance, self.labels))

    def smallest_numbers(self, limit: int) -> list[int]:
        """The smallest numbers of all that were ever called so, and may have a state at the moment."""
        if self.number is not None:
            return [self.number]
        labelled_now = self.reader.finder.first_called(self.labels, limit)
        labelled_before = [] if self.labels is None else self.reader.finder.once_called(self.labels)
        return sorted({*labelled_now, *labelled_before})[:limit]

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """Those with one of the given numbers, in order."""
        wanted = set(numbers) if self.number is None else {self.number} & set(numbers)
        if self.labels is not None:
            wanted = self.reader.finder.ever_called(wanted, self.labels)
        return [candidate for _, found in sorted(self._candidates_by_number(wanted).items()) for candidate in found]

    def _candidates_by_number(self, numbers: Collection[int]) -> dict[int, list[InstanceCandidate]]:
        traversal = self.selector.traversal
        instances = self.reader.lives_of(numbers, () if traversal is None else (traversal.id,))
        return {
            number: self._candidates_of(instance)
            for number, instance in instances.items()
            if instance.presence != "doubted"
        }

    def _candidates_of(self, instance: StoredInstance) -> list[InstanceCandidate]:
        if self.any_state:
            labelled = self.labels is None or had_label(instance, self.labels)
            return [InstanceCandidate(instance, state) for state in self.selector.states(instance)[-1:] if labelled]
        states = self.selector.reference_states(instance) if self.as_reference else self.selector.states(instance)
        return [
            InstanceCandidate(instance, state)
            for state in states
            if self.labels is None or label_in_state(instance, state) in self.labels
        ]

    def _all_numbers(self) -> Iterable[int]:
        """Numbers among which all that fit are."""
        finder, labels = self.reader.finder, self.labels
        if self.number is not None:
            return [self.number]
        if labels is not None and not labels:
            return []
        kind = self.selector.kind
        if kind == "now" and not self.any_state:
            return finder.called(labels, ["present"])
        if kind == "last" and not self.as_reference and not self.any_state:
            return finder.called(labels)
        if self.selector.traversal is not None and not self.as_reference:
            seen = self.reader.survivors.of(finder.seen_in(self.selector.traversal.id, labels))
            return sorted(set(seen.values()))
        begun_ns = self.selector.low_ns if kind == "at" and not (self.as_reference or self.any_state) else math.inf
        labelled_now = finder.called(labels, begun_ns=begun_ns)
        return labelled_now if labels is None else chain(labelled_now, finder.once_called(labels))


def label_in_state(instance: StoredInstance, state: StateRecord) -> str:
    """What an instance is called in one of its states: in the newest, what it is called today."""
    return instance.label if state is instance.states[-1] else state.label


def had_label(instance: StoredInstance, labels: Collection[str]) -> bool:
    """Whether an instance is called so, or was in one of its states."""
    return instance.label in labels or any(state.label in labels for state in instance.states)
