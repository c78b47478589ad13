"""Sets of candidates: filtered, united, or of what moves by itself. None is held in memory as a whole."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from itertools import islice

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.candidates import BATCH_SIZE, CandidateSource, InstanceCandidate
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.types.memory import Presence, StateRecord

Candidates = list[InstanceCandidate]
ANY_PRESENCE: tuple[Presence, ...] = ("present", "absent", "doubted")


@dataclass(frozen=True)
class FilteredSource:
    """The candidates of a source that a test keeps."""

    source: CandidateSource
    keep: Callable[[Candidates], Candidates]

    def size(self) -> float:
        """The number of candidates, before the test."""
        return self.source.size()

    def batches(self) -> Iterator[Candidates]:
        """All candidates, in batches; most recently seen first."""
        return (self.keep(batch) for batch in self.source.batches())

    def numbers(self) -> Iterator[list[int]]:
        """A superset of the matching instance numbers, in batches."""
        return self.source.numbers()

    def with_numbers(self, numbers: Collection[int]) -> Candidates:
        """The candidates with the given instance numbers, in order."""
        return self.keep(self.source.with_numbers(numbers))


@dataclass(frozen=True)
class UnionSource:
    """The candidates of several sources, each once."""

    sources: tuple[CandidateSource, ...]

    def size(self) -> float:
        """At most so many."""
        return sum(source.size() for source in self.sources)

    def batches(self) -> Iterator[Candidates]:
        """All candidates, one source after the other."""
        found: set[tuple[int, int]] = set()
        for source in self.sources:
            for batch in source.batches():
                fresh = [candidate for candidate in batch if candidate.key not in found]
                found.update(candidate.key for candidate in fresh)
                yield fresh

    def numbers(self) -> Iterator[list[int]]:
        """A superset of the matching instance numbers, in batches."""
        for source in self.sources:
            yield from source.numbers()

    def with_numbers(self, numbers: Collection[int]) -> Candidates:
        """The candidates with the given instance numbers, in order."""
        by_key = {candidate.key: candidate for source in self.sources for candidate in source.with_numbers(numbers)}
        return [candidate for _, candidate in sorted(by_key.items())]


@dataclass(frozen=True)
class DynamicSource:
    """People and animals, wherever they were seen within the selected time: they stay nowhere, so that "now" means the
    whole map. They are read whatever the map believes of their presence.
    """

    reader: MapReader
    selector: TimeSelector
    labels: frozenset[str]
    number: int | None = None

    def size(self) -> float:
        """The number of them."""
        if self.number is not None:
            return 1
        return self.reader.search.count(self.labels, ANY_PRESENCE)

    def batches(self) -> Iterator[Candidates]:
        """All of them, in batches; most recently seen first."""
        for numbers in self.numbers():
            yield self.with_numbers(numbers)

    def numbers(self) -> Iterator[list[int]]:
        """Their numbers, in batches."""
        found = iter([self.number] if self.number is not None else self._labelled())
        while batch := list(islice(found, BATCH_SIZE)):
            yield batch

    def with_numbers(self, numbers: Collection[int]) -> Candidates:
        """Those with the given numbers, in order."""
        wanted = numbers if self.number is None else {self.number} & set(numbers)
        instances = self.reader.instances_by_number(wanted, [traversal.id for traversal in self.reader.traversals])
        return [
            InstanceCandidate(instance, state)
            for _, instance in sorted(instances.items())
            if instance.label in self.labels
            for state in self._states(instance.states)
        ]

    def _labelled(self) -> Iterator[int]:
        return self.reader.search.labelled(self.labels, ANY_PRESENCE)

    def _states(self, states: tuple[StateRecord, ...]) -> list[StateRecord]:
        """Where it was seen within the selected time."""
        selector = self.selector
        match selector.kind:
            case "now" | "last":
                return list(states[-1:])
            case "first":
                return list(states[:1])
            case "earlier":
                return [state for state in states if state.first_seen_ns < selector.high_ns]
            case _:
                low, high = selector.low_ns, selector.high_ns
                return [state for state in states if state.first_seen_ns <= high and state.last_seen_ns >= low]
