"""What nearly fits a question that has no answer: out of reach, at another time, perhaps of that name."""

from __future__ import annotations

import heapq
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import chain

from supermap_cli.geometry.boxes import Reach
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.candidates import BATCH_SIZE, CandidateSource, InstanceCandidate, LabelCandidates
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.vocabulary import load_vocabulary

MAX_NEAR_MISSES = 3
"""How many near misses an empty answer names."""

MIN_LABEL_PROBABILITY = 0.1
"""A label that an object may have with this probability makes it a near miss."""

EXHAUSTIVE_LIMIT = 30
"""So many are all compared with so many."""

TOUCHING_SEARCH_LIMIT = 400
"""Among so many with the smallest numbers those are looked for that touch what is asked for: none is nearer."""

MAX_SEARCH_RADIUS_M = 4096.0
"""Nothing is looked for farther away."""


@dataclass(frozen=True)
class CandidatePair:
    """Two states, and how far apart they are."""

    distance_m: float
    candidate: InstanceCandidate
    reference: InstanceCandidate

    @property
    def rank(self) -> tuple[float, int, tuple[int, int]]:
        """Nearer ones first."""
        return self.distance_m, self.candidate.instance.number, self.reference.key


def nearest_pairs(reader: MapReader, candidates: LabelCandidates, references: CandidateSource) -> list[CandidatePair]:
    """The nearest candidates to any reference, each once, and of those that are as near the ones with the smallest
    numbers. Few are all compared; among many, neighbours are looked for ever farther away, until there are enough.
    """
    if max(candidates.size(), references.size()) <= EXHAUSTIVE_LIMIT:
        everything = list(chain.from_iterable(references.batches()))
        return _nearest_per_instance(
            _pair(candidate, reference)
            for candidate in chain.from_iterable(candidates.batches())
            for reference in everything
        )
    radius_m, found = 1.0, _touching_pairs(reader, candidates, references)
    while len(found) < MAX_NEAR_MISSES and radius_m <= MAX_SEARCH_RADIUS_M:
        found = _nearest_per_instance(
            pair for pair in _pairs_within(reader, candidates, references, radius_m) if pair.distance_m <= radius_m
        )
        radius_m *= 4
    return found


def _touching_pairs(reader: MapReader, candidates: LabelCandidates, references: CandidateSource) -> list[CandidatePair]:
    """The first candidates that touch a reference, if there are enough of them among those looked at."""
    pairs: list[CandidatePair] = []
    for batch in batches(candidates.smallest_numbers(TOUCHING_SEARCH_LIMIT), BATCH_SIZE):
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.finder.near(batch, Reach(0.0, 0.0)):
            near[here].add(there)
        by_number: dict[int, list[InstanceCandidate]] = defaultdict(list)
        for reference in references.with_numbers({number for numbers in near.values() for number in numbers}):
            by_number[reference.instance.number].append(reference)
        for candidate in candidates.with_numbers(near):
            beside = (reference for number in near[candidate.instance.number] for reference in by_number[number])
            pairs += [pair for reference in beside if (pair := _pair(candidate, reference)).distance_m == 0]
        found = _nearest_per_instance(pairs)
        if len(found) == MAX_NEAR_MISSES:
            return found
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
    """All pairs that may lie within reach, and some that lie farther apart."""
    turned = references.size() < candidates.size()
    one, other = (references, candidates) if turned else (candidates, references)
    for batch in one.batches():
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.finder.near(
            {near_candidate.instance.number for near_candidate in batch}, Reach(radius_m, radius_m)
        ):
            near[there].add(here)
        by_number: dict[int, list[InstanceCandidate]] = defaultdict(list)
        for near_candidate in batch:
            by_number[near_candidate.instance.number].append(near_candidate)
        for other_candidate in other.with_numbers(near):
            for near_candidate in (
                near_candidate
                for number in near[other_candidate.instance.number]
                for near_candidate in by_number[number]
            ):
                yield _pair(other_candidate, near_candidate) if turned else _pair(near_candidate, other_candidate)


def _pair(candidate: InstanceCandidate, reference: InstanceCandidate) -> CandidatePair:
    return CandidatePair(box_distance_m(candidate.state.box, reference.state.box), candidate, reference)


def maybe_labelled(reader: MapReader, noun: str) -> list[tuple[StoredInstance, str]]:
    """Objects that may have that label after all, and those whose label is spelt nearly so, each with the reason."""
    vocabulary = load_vocabulary()
    name = vocabulary.normalise(noun)
    names = vocabulary.names_of(name)
    doubtful = [
        (-share, number, at, label)
        for number, belief in reader.finder.beliefs(vocabulary.forms_of(names))
        for at, (label, share) in enumerate(json.loads(belief).items())
        if share >= MIN_LABEL_PROBABILITY and vocabulary.normalise(label) in names
    ]
    reasons = [
        (number, f"may be a {label} ({-doubt:.0%})")
        for doubt, number, _, label in heapq.nsmallest(MAX_NEAR_MISSES, doubtful)
    ]
    close = get_close_matches(name, sorted(reader.finder.labels_today()), 1, 0.75)
    instances = reader.lives_of(
        [*(number for number, _ in reasons), *reader.finder.first_called(close, MAX_NEAR_MISSES)]
    )
    near_misses = [(instances[number], reason) for number, reason in reasons]
    near_misses += [
        (instance, f"did you mean '{instance.label}'?")
        for _, instance in sorted(instances.items())
        if instance.label in close
    ]
    return near_misses[:MAX_NEAR_MISSES]
