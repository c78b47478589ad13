"""Superlatives: which thing is closest, largest, newest. Those that differ by less than the map is exact tie."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING

from supermap_cli.errors import QueryError
from supermap_cli.language.questions import Measure, Robot, Superlative, Things
from supermap_cli.query.answering.asking import Value
from supermap_cli.query.answering.attributes import size_of, size_unit
from supermap_cli.query.answering.phrases import superlative_text
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.viewpoints import robot_distance_m
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.views import RelationView

if TYPE_CHECKING:
    from supermap_cli.query.answering.things import ThingsFinder

TIE_M = 0.05
"""Distances and sides that differ by no more tie, metres. Chosen: two voxels."""
TIE_SHARE = 0.05
"""Volumes that differ by no more of the larger one tie. Chosen."""
SMALLEST_FIRST: frozenset[Measure] = frozenset({"near", "small", "low", "narrow", "old"})


@dataclass(frozen=True)
class Ranked:
    """The chosen candidates, several where they tie (`tied`: their ids), and how far the last of them and those that
    tie with it may be (`farthest_m`), where distances decide.
    """

    candidates: Candidates
    tied: tuple[str, ...] = ()
    farthest_m: float = 0.0


def ranked(
    finder: ThingsFinder, candidates: Candidates, superlative: Superlative, number: int = 1, *, anything: bool = False
) -> Ranked:
    """The candidates that a superlative chooses, by their newest state: so many from its rank on. Of `anything`, the
    references of a distance are not meant.
    """
    newest: dict[int, InstanceCandidate] = {}
    for candidate in candidates:
        newest[candidate.instance.number] = candidate
    measured = measure_all(finder, list(newest.values()), superlative.measure, superlative.to, anything=anything)
    smallest_first = superlative.measure in SMALLEST_FIRST
    measured.sort(key=lambda pair: (pair[1].value if smallest_first else -pair[1].value, pair[0].instance.number))
    if finder.asking.trace is not None:
        for at, (candidate, value) in enumerate(measured, start=1):
            reason = f"{superlative_text(superlative)} is measured by {value_text(value, finder)}: number {at}"
            finder.asking.trace.add(candidate.instance.id, reason, kept=at == superlative.rank)
    if len(measured) < superlative.rank:
        return Ranked([])
    first = superlative.rank - 1
    best = measured[first : first + number]
    same = [pair for pair in measured if pair in best or _tie(pair[1], best[-1][1])]
    chosen = [replace(candidate, relations=(*candidate.relations, *_views(candidate, value, superlative)))
              for candidate, value in same]  # fmt: skip
    finder.asking.measures |= {candidate.instance.id: value for candidate, value in same}
    tied = chosen if len(chosen) > len(best) else []
    return Ranked(chosen, tuple(candidate.instance.id for candidate in tied), best[-1][1].value + TIE_M)


def measure_all(
    finder: ThingsFinder,
    candidates: Sequence[InstanceCandidate],
    measure: Measure,
    to: Things | None,
    *,
    anything: bool = False,
) -> list[tuple[InstanceCandidate, Value]]:
    """The value of each candidate by a measure; those without one (no reference) are left out."""
    measure_of = _measure(finder, measure, to, anything=anything)
    values = ((candidate, measure_of(candidate)) for candidate in candidates)
    return [(candidate, value) for candidate, value in values if value is not None]


def value_text(value: Value, finder: ThingsFinder) -> str:
    """A value with its unit, in words."""
    if value.unit == "ns":
        return finder.asking.clock.text(int(value.value))
    other = f" from {value.other}" if value.other else ""
    return f"{value.value:.2f} {value.unit}{other}"


def _measure(
    finder: ThingsFinder, measure: Measure, to: Things | None, *, anything: bool
) -> Callable[[InstanceCandidate], Value | None]:
    if measure in {"old", "seen"} and finder.selector.kind in {"traversal", "during", "at"}:
        raise QueryError(
            f"which thing was seen first or last {finder.selector.text} is not known",
            cure="ask it of the whole map: 'what did you see first'",
        )
    match measure:
        case "near" | "far":
            return _distance_measure(finder, to, anything=anything)
        case "large" | "small" | "tall" | "low" | "wide" | "narrow":
            return lambda candidate: Value(size_of(candidate.state.box, measure), size_unit(measure))
        case "new" | "old":
            return lambda candidate: Value(float(candidate.instance.first_seen_ns), "ns")
        case "seen":
            return lambda candidate: Value(float(candidate.instance.last_seen_ns), "ns")


def _distance_measure(
    finder: ThingsFinder, to: Things | None, *, anything: bool
) -> Callable[[InstanceCandidate], Value | None]:
    """The distance to the nearest reference; without one, to the robot at its last pose."""
    if to is None or isinstance(to.noun, Robot):
        distance_m = robot_distance_m(finder.asking)
        finder.asking.note("measured from the robot at its last pose")
        return lambda candidate: Value(distance_m(candidate), "m", "the robot")
    references = list(chain.from_iterable(finder.source(to).batches()))
    own = {reference.instance.number for reference in references} if anything else set[int]()

    def nearest(candidate: InstanceCandidate) -> Value | None:
        if candidate.instance.number in own:
            return None
        others = [other for other in references if other.instance.number != candidate.instance.number]
        distances = [(box_distance_m(candidate.state.box, other.state.box), other.instance.id) for other in others]
        return Value(*min(distances)[:1], "m", min(distances)[1]) if distances else None

    return nearest


def _tie(value: Value, wanted: Value) -> bool:
    if value.unit == "m":
        return abs(value.value - wanted.value) <= TIE_M
    if value.unit == "m3":
        return abs(value.value - wanted.value) <= TIE_SHARE * max(value.value, wanted.value)
    return value.value == wanted.value


def _views(candidate: InstanceCandidate, value: Value, superlative: Superlative) -> tuple[RelationView, ...]:
    """The distance that decided, as a relation."""
    if value.other is None:
        return ()
    name = f"{superlative_text(superlative)} to"
    since_ns, confidence = candidate.state.first_seen_ns, round(candidate.state.confidence, 4)
    other = "robot" if value.other == "the robot" else value.other
    subject = candidate.instance.id
    return (RelationView(name, subject, other, "boxes", None, since_ns, None, round(value.value, 4), confidence),)
