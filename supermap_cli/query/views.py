"""What answers are made of: instances, intervals, relations and evidence, as they leave the program.

Every class here is one object of the published JSON Schemas; `to_document` turns it into JSON's types.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import (
    LabelledObservation,
    ObservationRef,
    ScoredObservation,
    StoredInstance,
    StoredTraversal,
    StoredVisit,
)
from supermap_cli.query.standing import Known, StandingView
from supermap_cli.types.memory import Presence, StateRecord, TemporalEdge

Vector = tuple[float, float, float]
LISTED = 50
"""How many instances an answer lists, if it is not told otherwise."""

SAMPLE = 8
"""How many observations stand for all of them in an answer: the first, the last, and the best between."""


@dataclass(frozen=True)
class BoxView:
    """An upright box, metres and radians."""

    center: Vector
    size: Vector
    yaw: float


@dataclass(frozen=True)
class IntervalView:
    """One state of an instance: where it stood from when to when.

    It was supported in [first_seen_ns, last_seen_ns]; it came between `empty_before_ns` and `first_seen_ns` and went
    between `last_seen_ns` and `gone_ns`, as far as anybody looked.
    """

    state: int
    empty_before_ns: int | None
    first_seen_ns: int
    last_seen_ns: int
    gone_ns: int | None
    position: Vector
    box: BoxView
    label: str
    confidence: float


@dataclass(frozen=True)
class EvidenceView:
    """What an answer rests on: how many observations there are, the ids and keyframe stamps of the telling ones, and
    in how many keyframes its place was supported, in view, and seen empty.

    Of the observations before `given_up_before_ns` only the telling ones were kept; left out where all were.
    """

    observation_count: int
    observations: tuple[int, ...]
    keyframes_ns: tuple[int, ...]
    supported: int
    in_view: int
    contradicted: int
    given_up_before_ns: int | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class RelationView:
    """The relation that satisfied a question: `basis` says whether it is stored, or judged by the two boxes."""

    name: str
    subject: str
    object: str
    basis: str
    stored_as: str | None
    since_ns: int
    until_ns: int | None
    distance_m: float
    confidence: float


@dataclass(frozen=True)
class InstanceView:
    """One instance in an answer: where it is, or was in the newest of its `intervals` that fit.

    Where a time was asked for, `presence` is as of then, and `standing` says what that rests on.
    """

    id: str
    label: str
    presence: Presence | Known
    position: Vector
    box: BoxView
    confidence: float
    intervals: tuple[IntervalView, ...]
    relations: tuple[RelationView, ...]
    evidence: EvidenceView
    standing: StandingView | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class TraversalView:
    """One traversal. Its times are its recording's own plus `clock_shift_ns`.

    Most crops, observations and thumbnails from before `*_kept_from_ns` were given up; left out where none were.
    """

    number: int
    name: str
    recording: str
    status: str
    start_ns: int
    end_ns: int
    clock_shift_ns: int
    keyframes: int
    timings_s: dict[str, float] = field(default_factory=dict)
    crops_kept_from_ns: int | None = field(default=None, metadata={"optional": True})
    observations_kept_from_ns: int | None = field(default=None, metadata={"optional": True})
    thumbnails_kept_from_ns: int | None = field(default=None, metadata={"optional": True})
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class EventView:
    """A temporal edge: what happened, to what, and within which bounds."""

    kind: str
    from_id: str
    from_state: int | None
    to_id: str
    to_state: int | None
    not_before_ns: int | None
    not_after_ns: int
    probability: float
    distance_m: float | None


def vector(values: FloatArray) -> Vector:
    """Three metres, to a tenth of a millimetre."""
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z


def box_view(box: Box3D) -> BoxView:
    """A box as it leaves the program."""
    return BoxView(vector(box.center), vector(box.size), round(float(box.yaw), 5))


def box_of(view: BoxView) -> Box3D:
    """The box that a view shows."""
    return Box3D(np.array(view.center), np.array(view.size), view.yaw)


def interval_view(state: StateRecord) -> IntervalView:
    """A state as it leaves the program."""
    return IntervalView(
        state=state.index,
        empty_before_ns=state.empty_before_ns,
        first_seen_ns=state.first_seen_ns,
        last_seen_ns=state.last_seen_ns,
        gone_ns=state.gone_ns,
        position=vector(state.centroid_map),
        box=box_view(state.box),
        label=state.label,
        confidence=round(state.confidence, 4),
    )


def traversal_view(traversal: StoredTraversal) -> TraversalView:
    """A traversal as it leaves the program."""
    return TraversalView(
        number=traversal.number,
        name=traversal.name,
        recording=traversal.recording,
        status=traversal.status,
        start_ns=traversal.start_ns,
        end_ns=traversal.end_ns,
        clock_shift_ns=traversal.clock_shift_ns,
        keyframes=traversal.keyframes,
        timings_s=dict(traversal.timings),
        crops_kept_from_ns=traversal.crops_kept_from_ns,
        observations_kept_from_ns=traversal.observations_kept_from_ns,
        thumbnails_kept_from_ns=traversal.thumbnails_kept_from_ns,
        warnings=traversal.warnings,
    )


def event_view(edge: TemporalEdge, reader: MapReader) -> EventView:
    """A temporal edge as it leaves the program."""
    return EventView(
        kind=edge.kind,
        from_id=reader.text_ids[edge.from_number],
        from_state=edge.from_state,
        to_id=reader.text_ids[edge.to_number],
        to_state=edge.to_state,
        not_before_ns=edge.not_before_ns,
        not_after_ns=edge.not_after_ns,
        probability=round(edge.probability, 4),
        distance_m=None if edge.distance_m is None else round(edge.distance_m, 4),
    )


def evidence_view(
    reader: MapReader,
    instance: StoredInstance,
    spans: tuple[tuple[int, int], ...],
    traversal_ids: set[int] | None = None,
) -> EvidenceView:
    """What was seen of an instance within the given spans of time (and traversals), and how its place was looked at."""
    seen = [
        each
        for each in reader.scored_observations(instance)
        if any(low <= each.stamp_ns <= high for low, high in spans)
        and (traversal_ids is None or each.traversal_id in traversal_ids)
    ]
    visits = [each for each in instance.visits if traversal_ids is None or each.traversal_id in traversal_ids]
    return evidence_of(seen, visits, reader.traversals)


Seen = ObservationRef | ScoredObservation | LabelledObservation


def evidence_of(
    seen: Sequence[Seen], visits: Iterable[StoredVisit], traversals: Sequence[StoredTraversal]
) -> EvidenceView:
    """What some observations say, in the order of time, and how often some of the `traversals` looked there."""
    telling = telling_observations(seen)
    looked = list(visits)
    limits = {each.id: each.observations_kept_from_ns for each in traversals}
    given_up = [limits.get(each.traversal_id) for each in looked if each.supported]
    return EvidenceView(
        observation_count=len(seen),
        observations=tuple(each.id for each in telling),
        keyframes_ns=tuple(dict.fromkeys(each.stamp_ns for each in telling)),
        supported=sum(each.supported for each in looked),
        in_view=sum(each.in_view for each in looked),
        contradicted=sum(each.contradicted for each in looked),
        given_up_before_ns=max((each for each in given_up if each is not None), default=None),
    )


def telling_observations(seen: Sequence[Seen]) -> Sequence[Seen]:
    """The first, the last and the best-scored observations, in the order of time, at most `SAMPLE`."""
    if len(seen) <= SAMPLE:
        return seen
    best = sorted(seen[1:-1], key=lambda each: (-each.score, each.id))[: SAMPLE - 2]
    return sorted([seen[0], seen[-1], *best], key=lambda each: (each.stamp_ns, each.id))


def support_spans(states: tuple[StateRecord, ...]) -> tuple[tuple[int, int], ...]:
    """When the given states were supported."""
    return tuple((state.first_seen_ns, state.last_seen_ns) for state in states)


def to_document(value: object) -> Any:
    """A view as JSON's types. A field whose metadata say `optional` is left out where it is `None`."""
    if value is None or isinstance(value, str | int | float):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, list | tuple):
        return [to_document(each) for each in value]
    if isinstance(value, dict):
        return {str(key): to_document(content) for key, content in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        named = ((name, optional, getattr(value, name)) for name, optional in _named_fields(type(value)))
        return {name: to_document(content) for name, optional, content in named if not (content is None and optional)}
    return value.item() if isinstance(value, np.generic) else value


@cache
def _named_fields(kind: type[Any]) -> tuple[tuple[str, bool], ...]:
    """The names of a view's fields, and whether they may be left out."""
    return tuple((each.name, bool(each.metadata.get("optional"))) for each in fields(kind))
