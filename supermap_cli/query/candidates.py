"""Candidate instances for a noun phrase, in the states that a time selector picks; read in batches."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, islice
from typing import Protocol

from supermap_cli.memory.instance_search import BELIEVED
from supermap_cli.memory.presence_query import PresenceQuery
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.query.views import RelationView
from supermap_cli.types.memory import StateRecord

BATCH_SIZE = 100
"""Instances read at a time."""
FEW = 20
"""Up to this many instances are read whatever they are called: asking for their labels first costs as much."""


@dataclass(frozen=True)
class InstanceCandidate:
    """An instance in one of its states, with the relations by which it matches."""

    instance: StoredInstance
    state: StateRecord
    relations: tuple[RelationView, ...] = ()

    @property
    def key(self) -> tuple[int, int]:
        """The instance's number and the state's index."""
        return self.instance.number, self.state.index


@dataclass(frozen=True)
class MatchCount:
    """How many instances match (`total`), and how many of them are known to have been present (`certain`)."""

    total: int
    certain: int


class CandidateSource(Protocol):
    """An iterable set of candidates that is never held in memory as a whole."""

    def size(self) -> float:
        """Approximate number of instances."""

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All candidates, in batches; most recently seen first."""

    def numbers(self) -> Iterator[list[int]]:
        """A superset of the matching instance numbers, in batches; most recently seen first."""

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """The candidates with the given instance numbers, in order."""


@dataclass(frozen=True)
class CandidateList:
    """A candidate source over a list that is already known."""

    candidates: list[InstanceCandidate]

    def size(self) -> float:
        """The number of candidates."""
        return len(self.candidates)

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All candidates as one batch."""
        yield self.candidates

    def numbers(self) -> Iterator[list[int]]:
        """All instance numbers as one batch."""
        yield list(dict.fromkeys(candidate.instance.number for candidate in self.candidates))

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """The candidates with the given instance numbers."""
        wanted = set(numbers)
        return [candidate for candidate in self.candidates if candidate.instance.number in wanted]


@dataclass(frozen=True)
class LabelCandidates:
    """All instances with one of `labels` (`None`: any label), or the one instance with a `number`.

    - default: the states picked by the selector, each with a matching label in that state;
    - `as_reference`: the states that other instances may be related to (`TimeSelector.reference_states`);
    - `any_state`: instances that had a matching label in any state, in the newest state that the selector picks.
    """

    reader: MapReader
    selector: TimeSelector
    labels: frozenset[str] | None
    number: int | None = None
    as_reference: bool = False
    any_state: bool = False

    def size(self) -> float:
        """The number of instances with such a label today."""
        if self.number is not None:
            return 1
        if self.labels is None:
            return math.inf
        return self.reader.search.count(self.labels, ["present"] if self.selector.kind == "now" else BELIEVED)

    def match_count(self) -> MatchCount | None:
        """The number of matches, or `None` where the database cannot count them without reading them."""
        kind = self.selector.kind
        if self.number is not None or kind not in {"now", "last", "at"}:
            return None
        if kind == "at":
            tally = self.as_of().counts_of(self.labels)
            return MatchCount(tally.matching, tally.certain)
        count = self.reader.search.count(self.labels, ["present"] if kind == "now" else BELIEVED)
        return MatchCount(count, count)

    def as_of(self) -> PresenceQuery:
        """The map at the selected time. Requires a selector of kind "at"."""
        return self.reader.presence_at(int(self.selector.low_ns), self.selector.since_ns)

    def batches(self) -> Iterator[list[InstanceCandidate]]:
        """All candidates, in batches; most recently seen first."""
        for batch in self.numbers():
            candidates = self._candidates_by_number(batch)
            yield [candidate for number in batch for candidate in candidates.get(number, ())]

    def numbers(self) -> Iterator[list[int]]:
        """A superset of the matching instance numbers, in batches; most recently seen first."""
        numbers = iter(self._all_numbers())
        while batch := list(islice(numbers, BATCH_SIZE)):
            yield batch

    def instances(self) -> Iterator[StoredInstance]:
        """All instances that ever had such a label, whether or not they have a state at the selected time."""
        numbers = iter(self._all_numbers())
        while batch := list(islice(numbers, BATCH_SIZE)):
            instances = self.reader.instances_by_number(batch)
            believed = (
                instances[number] for number in batch if number in instances and instances[number].presence != "doubted"
            )
            yield from (instance for instance in believed if self.labels is None or had_label(instance, self.labels))

    def smallest_numbers(self, limit: int) -> list[int]:
        """The smallest numbers of instances that ever had such a label and may have a state at the selected time."""
        if self.number is not None:
            return [self.number]
        labelled_now = self.reader.search.first_labelled(self.labels, limit)
        labelled_before = [] if self.labels is None else self.reader.search.formerly_labelled(self.labels)
        return sorted({*labelled_now, *labelled_before})[:limit]

    def with_numbers(self, numbers: Collection[int]) -> list[InstanceCandidate]:
        """The candidates with the given instance numbers, in order."""
        wanted = set(numbers) if self.number is None else {self.number} & set(numbers)
        if self.labels is not None:
            read = self.reader.read_before(wanted)
            unread = wanted - read.keys()
            named = {number for number, instance in read.items() if instance and had_label(instance, self.labels)}
            wanted = named | (unread if len(unread) <= FEW else self.reader.search.ever_labelled(unread, self.labels))
        return [
            candidate
            for _, candidates in sorted(self._candidates_by_number(wanted).items())
            for candidate in candidates
        ]

    def _candidates_by_number(self, numbers: Collection[int]) -> dict[int, list[InstanceCandidate]]:
        traversal = self.selector.traversal
        instances = self.reader.instances_by_number(numbers, () if traversal is None else (traversal.id,))
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
        """A superset of the matching instance numbers."""
        finder, labels = self.reader.search, self.labels
        if self.number is not None:
            return [self.number]
        if labels is not None and not labels:
            return []
        kind = self.selector.kind
        if kind == "now" and not self.any_state:
            return finder.labelled(labels, ["present"])
        if kind == "last" and not self.as_reference and not self.any_state:
            return finder.labelled(labels)
        if self.selector.traversal is not None and not self.as_reference:
            seen = self.reader.survivors.of(finder.seen_in(self.selector.traversal.id, labels))
            return sorted(set(seen.values()))
        begun_ns = self.selector.low_ns if kind == "at" and not (self.as_reference or self.any_state) else math.inf
        labelled_now = finder.labelled(labels, begun_ns=begun_ns)
        return labelled_now if labels is None else chain(labelled_now, finder.formerly_labelled(labels))


def sorted_by_number(instances: Mapping[int, StoredInstance]) -> list[StoredInstance]:
    """Instances in the order of their numbers."""
    return [instance for _, instance in sorted(instances.items())]


def label_in_state(instance: StoredInstance, state: StateRecord) -> str:
    """The label of an instance in one of its states; for the newest state, the label of the instance today."""
    return instance.label if state is instance.states[-1] else state.label


def had_label(instance: StoredInstance, labels: Collection[str]) -> bool:
    """Whether an instance has one of the labels, today or in any of its states."""
    return instance.label in labels or any(state.label in labels for state in instance.states)
