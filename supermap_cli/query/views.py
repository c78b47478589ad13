"""The parts of answers: instances, intervals, relations and evidence.

Each class here is an object of the published JSON Schemas; `to_document` converts it to JSON types.
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
from supermap_cli.query.detectors import detector_of
from supermap_cli.query.presence_at import PresenceValue, PresenceView
from supermap_cli.types.memory import Presence, StateRecord, TemporalEdge

Vector = tuple[float, float, float]
DEFAULT_LIMIT = 50
"""Instances listed in an answer by default."""

EVIDENCE_SAMPLE_SIZE = 8
"""Observations listed as evidence: the first, the last, and the best-scored in between."""


@dataclass(frozen=True)
class BoxView:
    """An upright box, metres and radians."""

    center: Vector
    size: Vector
    yaw: float


@dataclass(frozen=True)
class IntervalView:
    """One state of an instance: its place over an interval of time.

    It was supported in [first_seen_ns, last_seen_ns]; it came between `empty_before_ns` and `first_seen_ns` and left
    between `last_seen_ns` and `gone_ns`, where these are known.
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
    """The evidence of an answer: the number of observations, ids and keyframe stamps of representative ones, and in how
    many keyframes the place was supported, in view, and seen empty.

    Of the observations before `given_up_before_ns` only representative ones are kept; left out where all are.
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
    """A relation that answers a question; `basis` is "stored", or "boxes" if judged by the two boxes."""

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
    """One instance in an answer, with the position of the newest of its matching `intervals`.

    For a question about a time, `presence` is as of then, and `standing` gives its basis.
    """

    id: str
    label: str
    presence: Presence | PresenceValue
    position: Vector
    box: BoxView
    confidence: float
    intervals: tuple[IntervalView, ...]
    relations: tuple[RelationView, ...]
    evidence: EvidenceView
    standing: PresenceView | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class TraversalView:
    """One traversal. Its times are recording times plus `clock_shift_ns`; `detector` is equal for detectors that err
    alike, and empty if nobody knows.

    Most crops, observations and thumbnails from before `*_kept_from_ns` were pruned; left out where none were.
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
    detector: str = ""


@dataclass(frozen=True)
class EventView:
    """A temporal edge: the event, its instances, and its time bounds."""

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
    """A point (3,), metres, rounded to 0.1 mm."""
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z


def box_view(box: Box3D) -> BoxView:
    """A box as a view."""
    return BoxView(vector(box.center), vector(box.size), round(float(box.yaw), 5))


def box_of(view: BoxView) -> Box3D:
    """The box of a view."""
    return Box3D(np.array(view.center), np.array(view.size), view.yaw)


def interval_view(state: StateRecord) -> IntervalView:
    """A state as a view."""
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
    """A traversal as a view."""
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
        detector=detector_of(traversal),
    )


def event_view(edge: TemporalEdge, reader: MapReader) -> EventView:
    """A temporal edge as a view."""
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
    observed: Sequence[ScoredObservation] | None = None,
) -> EvidenceView:
    """The evidence for an instance within the given time spans (and traversals); `observed` are all its observations,
    where they were read before.
    """
    every = reader.scored_observations(instance) if observed is None else observed
    observations = [
        observation
        for observation in every
        if any(low <= observation.stamp_ns <= high for low, high in spans)
        and (traversal_ids is None or observation.traversal_id in traversal_ids)
    ]
    visits = [visit for visit in instance.visits if traversal_ids is None or visit.traversal_id in traversal_ids]
    return evidence_of(observations, visits, reader.traversals)


AnyObservation = ObservationRef | ScoredObservation | LabelledObservation


def evidence_of(
    observations: Sequence[AnyObservation], visits: Iterable[StoredVisit], traversals: Sequence[StoredTraversal]
) -> EvidenceView:
    """The evidence of observations in chronological order, and of visits by some of the `traversals`."""
    representative = representative_observations(observations)
    visit_list = list(visits)
    limits = {traversal.id: traversal.observations_kept_from_ns for traversal in traversals}
    limits_ns = [limits.get(visit.traversal_id) for visit in visit_list if visit.supported]
    return EvidenceView(
        observation_count=len(observations),
        observations=tuple(observation.id for observation in representative),
        keyframes_ns=tuple(dict.fromkeys(observation.stamp_ns for observation in representative)),
        supported=sum(visit.supported for visit in visit_list),
        in_view=sum(visit.in_view for visit in visit_list),
        contradicted=sum(visit.contradicted for visit in visit_list),
        given_up_before_ns=max((limit_ns for limit_ns in limits_ns if limit_ns is not None), default=None),
    )


def representative_observations(observations: Sequence[AnyObservation]) -> Sequence[AnyObservation]:
    """The first, the last and the best-scored observations in chronological order, at most `EVIDENCE_SAMPLE_SIZE`."""
    if len(observations) <= EVIDENCE_SAMPLE_SIZE:
        return observations
    best = sorted(observations[1:-1], key=lambda observation: (-observation.score, observation.id))[
        : EVIDENCE_SAMPLE_SIZE - 2
    ]
    return sorted(
        [observations[0], observations[-1], *best], key=lambda observation: (observation.stamp_ns, observation.id)
    )


def support_spans(states: tuple[StateRecord, ...]) -> tuple[tuple[int, int], ...]:
    """The intervals in which the states were supported."""
    return tuple((state.first_seen_ns, state.last_seen_ns) for state in states)


def to_document(value: object) -> Any:
    """A view as JSON types. Fields with `optional` in their metadata are left out where `None`."""
    if value is None or isinstance(value, str | int | float):
        return value.item() if isinstance(value, np.generic) else value
    if isinstance(value, list | tuple):
        return [to_document(item) for item in value]
    if isinstance(value, dict):
        return {str(key): to_document(content) for key, content in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        named = ((name, optional, getattr(value, name)) for name, optional in _named_fields(type(value)))
        return {name: to_document(content) for name, optional, content in named if not (content is None and optional)}
    return value.item() if isinstance(value, np.generic) else value


@cache
def _named_fields(kind: type[Any]) -> tuple[tuple[str, bool], ...]:
    """The names of a view's fields, and whether they are optional."""
    return tuple((view_field.name, bool(view_field.metadata.get("optional"))) for view_field in fields(kind))
