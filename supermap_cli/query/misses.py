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
from supermap_cli.query.candidates import PART, Called, Candidate, Pool
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.vocabulary import load_vocabulary

NEAREST = 3
"""How many near misses an empty answer names."""

LABEL_DOUBT = 0.1
"""A label that an object may have with this probability makes it a near miss."""

FEW = 30
"""So many are all compared with so many."""

FIRST = 400
"""Among so many with the smallest numbers those are looked for that touch what is asked for: none is nearer."""

FARTHEST_M = 4096.0
"""Nothing is looked for farther away."""


@dataclass(frozen=True)
class Apart:
    """Two states, and how far apart they are."""

    distance_m: float
    candidate: Candidate
    reference: Candidate

    @property
    def rank(self) -> tuple[float, int, tuple[int, int]]:
        """Nearer ones first."""
        return self.distance_m, self.candidate.instance.number, self.reference.key


def closest(reader: MapReader, candidates: Called, references: Pool) -> list[Apart]:
    """The nearest candidates to any reference, each once, and of those that are as near the ones with the smallest
    numbers. Few are all compared; among many, neighbours are looked for ever farther away, until there are enough.
    """
    if max(candidates.size(), references.size()) <= FEW:
        everything = list(chain.from_iterable(references.parts()))
        return _nearest(_apart(each, it) for each in chain.from_iterable(candidates.parts()) for it in everything)
    reach_m, found = 1.0, _touching(reader, candidates, references)
    while len(found) < NEAREST and reach_m <= FARTHEST_M:
        found = _nearest(
            each for each in _within(reader, candidates, references, reach_m) if each.distance_m <= reach_m
        )
        reach_m *= 4
    return found


def _touching(reader: MapReader, candidates: Called, references: Pool) -> list[Apart]:
    """The first candidates that touch a reference, if there are enough of them among those looked at."""
    pairs: list[Apart] = []
    for part in batches(candidates.first(FIRST), PART):
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.search.near(part, Reach(0.0, 0.0)):
            near[here].add(there)
        by_number: dict[int, list[Candidate]] = defaultdict(list)
        for it in references.among({number for of_one in near.values() for number in of_one}):
            by_number[it.instance.number].append(it)
        for each in candidates.among(near):
            beside = (it for number in near[each.instance.number] for it in by_number[number])
            pairs += [apart for it in beside if (apart := _apart(each, it)).distance_m == 0]
        found = _nearest(pairs)
        if len(found) == NEAREST:
            return found
    return []


def _nearest(pairs: Iterable[Apart]) -> list[Apart]:
    best: dict[int, Apart] = {}
    for each in pairs:
        number = each.candidate.instance.number
        if number != each.reference.instance.number and (number not in best or each.rank < best[number].rank):
            best[number] = each
    return sorted(best.values(), key=lambda each: each.rank)[:NEAREST]


def _within(reader: MapReader, candidates: Pool, references: Pool, reach_m: float) -> Iterator[Apart]:
    """All pairs that may lie within reach, and some that lie farther apart."""
    turned = references.size() < candidates.size()
    one, other = (references, candidates) if turned else (candidates, references)
    for part in one.parts():
        near: dict[int, set[int]] = defaultdict(set)
        for here, there in reader.search.near({each.instance.number for each in part}, Reach(reach_m, reach_m)):
            near[there].add(here)
        by_number: dict[int, list[Candidate]] = defaultdict(list)
        for each in part:
            by_number[each.instance.number].append(each)
        for it in other.among(near):
            for each in (each for number in near[it.instance.number] for each in by_number[number]):
                yield _apart(it, each) if turned else _apart(each, it)


def _apart(candidate: Candidate, reference: Candidate) -> Apart:
    return Apart(box_distance_m(candidate.state.box, reference.state.box), candidate, reference)


def perhaps_called(reader: MapReader, noun: str) -> list[tuple[StoredInstance, str]]:
    """Objects that may have that label after all, and those whose label is spelt nearly so, each with the reason."""
    vocabulary = load_vocabulary()
    name = vocabulary.normalise(noun)
    names = vocabulary.names_of(name)
    doubtful = [
        (-share, number, at, label)
        for number, belief in reader.search.label_beliefs(vocabulary.forms_of(names))
        for at, (label, share) in enumerate(json.loads(belief).items())
        if share >= LABEL_DOUBT and vocabulary.normalise(label) in names
    ]
    reasons = [
        (number, f"may be a {label} ({-doubt:.0%})") for doubt, number, _, label in heapq.nsmallest(NEAREST, doubtful)
    ]
    close = get_close_matches(name, sorted(reader.search.current_labels()), 1, 0.75)
    known = reader.instances_by_number(
        [*(number for number, _ in reasons), *reader.search.first_labelled(close, NEAREST)]
    )
    told = [(known[number], reason) for number, reason in reasons]
    told += [(each, f"did you mean '{each.label}'?") for _, each in sorted(known.items()) if each.label in close]
    return told[:NEAREST]
