"""True changes between the last two mapped traversals, and whether images show them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from supermap_cli.evaluation.known_truth import KnownTruth, Place
from supermap_cli.types.truth import TrueChangeKind

MIN_MOVE_M = 0.1
"""Metres between centroids below which two places of an object count as one. Chosen."""


@dataclass(frozen=True, eq=False)
class NetChange:
    """The difference of an object's place between the ends of two traversals."""

    before: Place | None
    after: Place | None

    @property
    def kind(self) -> TrueChangeKind:
        """The kind of change, by which of the two places exist."""
        return "appeared" if self.before is None else "disappeared" if self.after is None else "moved"

    @property
    def places(self) -> tuple[Place, ...]:
        """The one or two places it concerns."""
        return tuple(place for place in (self.before, self.after) if place is not None)

    @property
    def object_id(self) -> str:
        """The changed object's id."""
        return self.places[0].object.id

    @property
    def label(self) -> str:
        """The changed object's label."""
        return self.places[0].object.label


@dataclass(frozen=True)
class NetChanges:
    """`judged` are the changes that are scored, `unobservable` those that images do not show; `unjudged_places` the
    places of the latter and of what came and went within the two traversals; `unchanged` the ids of the other objects.
    """

    judged: tuple[NetChange, ...]
    unobservable: tuple[NetChange, ...]
    unjudged_places: tuple[Place, ...]
    unchanged: frozenset[str]


def net_changes(known: KnownTruth) -> NetChanges:
    """Compare the objects' places at the last keyframes of the last two mapped traversals (there must be two)."""
    before_ns, after_ns = _last_keyframe_ns(known, -2), _last_keyframe_ns(known, -1)
    judged, unobservable, unchanged = [], [], set()
    for object_id, own in groupby(known.places, key=lambda place: place.object.id):
        places = tuple(own)
        before = next((place for place in places if place.state.covers(before_ns)), None)
        after = next((place for place in places if place.state.covers(after_ns)), None)
        if before is None and after is None:
            continue
        change = NetChange(before, after)
        if change.kind == "moved" and _distance_m(change) < MIN_MOVE_M:
            unchanged.add(object_id)
        elif _observable(change, known, before_ns):
            judged.append(change)
        else:
            unobservable.append(change)
    ends = {(place.object.id, place.index) for change in judged for place in change.places}
    return NetChanges(
        judged=tuple(judged),
        unobservable=tuple(unobservable),
        unjudged_places=tuple(
            place
            for place in known.places
            if (place.object.id, place.index) not in ends and _begins_or_ends(place, known)
        ),
        unchanged=frozenset(unchanged),
    )


def _last_keyframe_ns(known: KnownTruth, which: int) -> int:
    traversal = known.traversals[which]
    within = known.stamps_ns[(known.stamps_ns >= traversal.start_ns) & (known.stamps_ns <= traversal.end_ns)]
    return int(within.max(initial=traversal.start_ns))


def _distance_m(change: NetChange) -> float:
    """Distance that the whole object moved, whatever part of it was seen."""
    first, last = change.places[0].state, change.places[-1].state
    return float(np.linalg.norm(last.centroid - first.centroid))


def _observable(change: NetChange, known: KnownTruth, before_ns: int) -> bool:
    """Whether images of the two traversals showed the object wherever it stood, and that the place it left is empty or
    the place it came to had been.
    """
    span = known.stamps_ns >= known.traversals[-2].start_ns
    rows = [known.position(place) for place in change.places]
    if not all(known.in_view_with_object[row, span].any() for row in rows):
        return False
    when_empty = span & (known.stamps_ns > before_ns) if change.before is not None else span
    return bool(known.in_view_empty[rows[0], when_empty].any())


def _begins_or_ends(place: Place, known: KnownTruth) -> bool:
    """Whether the place was filled or emptied since the earlier of the two traversals began."""
    start_ns, since_ns, until_ns = known.traversals[-2].start_ns, place.state.since_ns, place.state.until_ns
    return (since_ns is not None and since_ns >= start_ns) or (
        until_ns is not None and known.end_ns is not None and start_ns <= until_ns <= known.end_ns
    )
