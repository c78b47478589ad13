"""Near misses for a question without matches: pairs out of reach, and instances possibly of that label."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import chain
from typing import Protocol

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.stored_values import parsed_shares
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.candidates import BATCH_SIZE, CandidateSource, InstanceCandidate, LabelCandidates
from supermap_cli.query.relations import box_distance_m

MAX_NEAR_MISSES = 3
"""Near misses listed in an empty answer."""

MIN_LABEL_PROBABILITY = 0.1
"""An instance is a near miss for a label that it has with at least this probability."""

MIN_SPELLING_SIMILARITY = 0.75
"""Least similarity ratio (`difflib`) of a noun and a label for "did you mean"."""

EXHAUSTIVE_LIMIT = 30
"""Up to this many candidates and references are compared pairwise."""

TOUCHING_SEARCH_LIMIT = 400
"""Touching pairs are searched among this many candidates with the smallest numbers first."""

INITIAL_SEARCH_RADIUS_M = 1.0
SEARCH_RADIUS_GROWTH = 4.0
MAX_SEARCH_RADIUS_M = 4096.0
"""The neighbour search starts with the first radius (m), grows it by the factor, and stops at the largest (m)."""


@dataclass(frozen=True)
class CandidatePair:
    """A candidate and a reference, and the distance between their boxes."""

    distance_m: float
    candidate: InstanceCandidate
    reference: InstanceCandidate

    @property
    def rank(self) -> tuple[float, int, tuple[int, int]]:
        """Sort key: distance, then instance numbers."""
        return self.distance_m, self.candidate.instance.number, self.reference.key


def nearest_pairs(reader: MapReader, candidates: LabelCandidates, references: CandidateSource) -> list[CandidatePair]:
    """The candidates nearest to any reference, one pair each, ties broken by number. A small set is compared pairwise;
    in a large one, the search radius grows until there are enough pairs.
    """
    if max(candidates.size(), references.size()) <= EXHAUSTIVE_LIMIT:
        everything = list(chain.from_iterable(references.batches()))
        return _nearest_per_instance(
            _pair(candidate, reference)
            for candidate in chain.from_iterable(candidates.batches())
            for reference in everything
        )
    radius_m, nearest = INITIAL_SEARCH_RADIUS_M, _touching_pairs(reader, candidates, references)
    while len(nearest) < MAX_NEAR_MISSES and radius_m <= MAX_SEARCH_RADIUS_M:
        nearest = _nearest_per_instance(
            pair for pair in _pairs_within(reader, candidates, references, radius_m) if pair.distance_m <= radius_m
        )
        radius_m *= SEARCH_RADIUS_GROWTH
    return nearest


def _touching_pairs(reader: MapReader, candidates: LabelCandidates, references: CandidateSource) -> list[CandidatePair]:
    """The first candidates that touch a reference, if there are enough of them within the search limit."""
    pairs: list[CandidatePair] = []
    for batch in batches(candidates.smallest_numbers(TOUCHING_SEARCH_LIMIT), BATCH_SIZE):
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.search.near(batch, Reach(0.0, 0.0)):
            near[here].add(there)
        by_number: dict[int, list[InstanceCandidate]] = defaultdict(list)
        for reference in references.with_numbers({number for numbers in near.values() for number in numbers}):
            by_number[reference.instance.number].append(reference)
        for candidate in candidates.with_numbers(near):
            beside = (reference for number in near[candidate.instance.number] for reference in by_number[number])
            pairs += [pair for reference in beside if (pair := _pair(candidate, reference)).distance_m == 0]
        nearest = _nearest_per_instance(pairs)
        if len(nearest) == MAX_NEAR_MISSES:
            return nearest
    return []


def _nearest_per_instance(pairs: Iterable[CandidatePair]) -> list[CandidatePair]:
    best: dict[int, CandidatePair] = {}
    for pair in pairs:
        number = pair.candidate.instance.number
        if number != pair.reference.instance.number and (number not in best or pair.rank < best[number].rank):
            best[number] = pair
    return sorted(best.values(), key=lambda pair: pair.rank)[:MAX_NEAR_MISSES]


def _pairs_within(
    reader: MapReader, candidates: CandidateSource, references: CandidateSource, radius_m: float
) -> Iterator[CandidatePair]:
    """All pairs within a radius, and some farther apart."""
    turned = references.size() < candidates.size()
    outer, inner = (references, candidates) if turned else (candidates, references)
    for batch in outer.batches():
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.search.near(
            {outer_candidate.instance.number for outer_candidate in batch}, Reach(radius_m, radius_m)
        ):
            near[there].add(here)
        by_number: dict[int, list[InstanceCandidate]] = defaultdict(list)
        for outer_candidate in batch:
            by_number[outer_candidate.instance.number].append(outer_candidate)
        for inner_candidate in inner.with_numbers(near):
            for number in near[inner_candidate.instance.number]:
                for outer_candidate in by_number[number]:
                    pair = (inner_candidate, outer_candidate) if turned else (outer_candidate, inner_candidate)
                    yield _pair(*pair)


def _pair(candidate: InstanceCandidate, reference: InstanceCandidate) -> CandidatePair:
    return CandidatePair(box_distance_m(candidate.state.box, reference.state.box), candidate, reference)


class Names(Protocol):
    """The part of the lexicon that near misses need."""

    def synonyms(self, name: str) -> frozenset[str]:
        """Other names of the same thing."""
        ...

    def normalise(self, label: str) -> str:
        """A label as a name."""
        ...


def maybe_labelled(reader: MapReader, name: str, words: Names) -> list[tuple[StoredInstance, str]]:
    """Instances that may have that label, and those with a similarly spelt label, each with the reason."""
    names = frozenset({name}) | words.synonyms(name)
    doubtful = [
        (-share, number, at, label)
        for number, belief in reader.search.label_beliefs(names)
        for at, (label, share) in enumerate(parsed_shares(belief, f"the label belief of instance {number}").items())
        if share >= MIN_LABEL_PROBABILITY and words.normalise(label) in names
    ]
    reasons = [
        (number, f"may be a {label} ({-doubt:.0%})")
        for doubt, number, _, label in heapq.nsmallest(MAX_NEAR_MISSES, doubtful)
    ]
    close = get_close_matches(name, sorted(reader.search.current_labels()), 1, MIN_SPELLING_SIMILARITY)
    instances = reader.instances_by_number(
        [*(number for number, _ in reasons), *reader.search.first_labelled(close, MAX_NEAR_MISSES)]
    )
    near_misses = [(instances[number], reason) for number, reason in reasons]
    near_misses += [
        (instance, f"did you mean '{instance.label}'?")
        for _, instance in sorted(instances.items())
        if instance.label in close
    ]
    return near_misses[:MAX_NEAR_MISSES]
