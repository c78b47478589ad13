"""The life of an object: born tentative, confirmed, gone, back again, moved, merged with what it turned out to be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from supermap_cli.mapping.belief import LabelBelief
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject, ObjectMap, OpenState
from supermap_cli.mapping.voxel_map import FINEST_VOXEL_M, VoxelMap
from supermap_cli.types.labels import ANIMATE

BIRTH_LOG_ODDS = -1.0
"""Before its first detection a thing is more likely not there."""

CONFIRM_LOG_ODDS = 2.0
CONFIRM_OBSERVATIONS = 2
CONFIRM_SPAN_NS = 500_000_000
"""A tentative object enters the map at odds of 7 to 1, and never on a single sighting or on some in quick succession,
which share their errors: a span of time and not a number of sightings, which would depend on the detector's rate.
"""

CONFIRM_LABEL = 0.5
"""A thing that may as well be two others is not entered yet."""

FORGET_LOG_ODDS = -1.5
"""A tentative object below this is forgotten."""

DOUBT_LOG_ODDS = 0.0
"""A confirmed object below this is more likely not there than there: it leaves the answers until confirmed anew."""


def initialize(number: int, detection: LiftedDetection, stamp_ns: int) -> MapObject:
    """A tentative object from one unexplained detection; its evidence is fused by the caller."""
    return MapObject(
        number,
        VoxelMap(FINEST_VOXEL_M),
        LabelBelief(),
        stamp_ns,
        stamp_ns,
        BIRTH_LOG_ODDS,
        OpenState(0, stamp_ns),
        track_id=detection.track_id,
    )


def ready_to_confirm(tentative: MapObject) -> bool:
    """Whether a tentative object is believed enough to enter the map, and known enough to be called something."""
    if tentative.existence < CONFIRM_LOG_ODDS or tentative.observations < CONFIRM_OBSERVATIONS:
        return False
    if tentative.last_seen_ns - tentative.first_seen_ns < CONFIRM_SPAN_NS:
        return False
    return max(tentative.labels.probabilities().values()) >= CONFIRM_LABEL


def same_thing(first: MapObject, second: MapObject, *, seen_apart: bool) -> bool:
    """Whether two objects of the map are one.

    One label and one lying largely within the other is enough, unless images have shown them side by side; two labels
    need clouds that cover one another.
    """
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[c] * q.get(c, 0.0) for c in p)
    lying = second.shape.share_near(first.shape.points)
    if agreement > 0.3:
        enough = 0.85 if seen_apart else 0.5
        return lying > enough or first.shape.share_near(second.shape.points) > enough
    if lying <= 0.7:
        return False
    back = first.shape.share_near(second.shape.points)
    return min(lying, back) > 0.7 and max(lying, back) > 0.8


RELOCATION_MARGIN = 1.0
"""Log ratio (odds of 2.7) by which one explanation must beat all others before an identity is carried over."""


CANDIDATE_LOG_RATIO = -1.0
"""A pair that is less likely one thing than this is no candidate."""

TIMELY_SHARE, UNTIMELY = 0.1, -2.5
"""A thing may have left at any time before it was seen to be gone, and things leave in bursts: to have left within this
share of that time is nothing strange, and to have left within next to none of it costs so much (log ratio).
"""

OTHERS_WEIGHT = 4.0
"""How many times likelier one more of a kind is than a thing that moved, for each of its kind that stands by."""


@dataclass(frozen=True)
class Relocation:
    """An object seen to be gone, and a new one that may be it: `probability` among all that were considered."""

    gone: int
    found: int
    probability: float
    certain: bool


def relocations(
    gone: Iterable[MapObject], found: Iterable[MapObject], standing: Iterable[MapObject] = ()
) -> list[Relocation]:
    """Match things that are gone with things that turned up: an assignment over all pairs.

    A pair is certain if neither another pair nor its being two things is nearly as likely; what else is likely is left
    as a candidate. `standing` is what has stood in its place all along: a thing in a place nobody had looked at may
    well be one more of its kind.
    """
    lost, new, others = list(gone), list(found), list(standing)
    if not lost or not new:
        return []
    scores = np.array([[resemblance(a, b) for b in new] for a in lost])
    for column, each in enumerate(new):
        if each.state.empty_before_ns is None:
            scores[:, column] -= np.log1p(OTHERS_WEIGHT * sum(look_alike(each, other) for other in others))
    rows, columns = linear_sum_assignment(np.maximum(scores, 0.0), maximize=True)
    assigned = set(zip(rows.tolist(), columns.tolist(), strict=True))
    likely = []
    for row, column in np.argwhere(scores > CANDIDATE_LOG_RATIO).tolist():
        rivals = np.concatenate([np.delete(scores[row], column), np.delete(scores[:, column], row), [0.0]])
        certain = (row, column) in assigned and scores[row, column] - rivals.max() > RELOCATION_MARGIN
        probability = 1 / (1 + np.exp(rivals - scores[row, column]).sum())
        likely.append(Relocation(lost[row].number, new[column].number, float(probability), bool(certain)))
    settled = {number for each in likely if each.certain for number in (each.gone, each.found)}
    return [each for each in likely if each.certain or settled.isdisjoint((each.gone, each.found))]


def by_presence(objects: ObjectMap) -> tuple[list[MapObject], list[MapObject], list[MapObject]]:
    """The confirmed objects that are gone, those found since the first of them was last seen, and those that have stood
    there before; what moves by itself is never gone.
    """
    confirmed = [each for each in objects if each.confirmed]
    gone = [each for each in confirmed if not each.present and each.label not in ANIMATE]
    lost_ns = min((each.last_seen_ns for each in gone), default=0)
    present = [each for each in confirmed if each.present]
    found = [each for each in present if each.state.index == 0 and each.first_seen_ns > lost_ns]
    return gone, found, [each for each in present if each.first_seen_ns <= lost_ns]


def resemblance(first: MapObject, second: MapObject) -> float:
    """Log ratio for a thing that is gone and one found elsewhere to be one: label, size, colour, and whether it came.

    Sizes are compared without the thinnest side: how deep a thing is, a look from one side does not tell.
    """
    if second.label in ANIMATE or second.first_seen_ns <= first.last_seen_ns:
        return -np.inf
    came = 0.0 if second.state.empty_before_ns is not None else -1.0
    return likeness(first, second) + 1.5 + came + in_time(first, second)


def in_time(gone: MapObject, found: MapObject) -> float:
    """How much less likely it is that a thing left before another was found than at any time before it was seen to be
    gone (log ratio, not above 0): one was there before the other had to be gone.
    """
    if gone.gone_ns is None or found.first_seen_ns >= gone.gone_ns:
        return 0.0
    share = (found.first_seen_ns - gone.last_seen_ns) / (gone.gone_ns - gone.last_seen_ns)
    return float(np.clip(np.log(share / TIMELY_SHARE), UNTIMELY, 0.0))


def likeness(first: MapObject, second: MapObject) -> float:
    """How much more alike two objects are than two things of any kind (log ratio), by label, size and colour."""
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[c] * q.get(c, 0.0) for c in p)
    sizes = np.array([np.sort(each.shape.box.size)[1:] for each in (first, second)])
    size_error = float(np.abs(np.log(sizes[0] / sizes[1])).max())
    colors = [each.voxels.rgb[each.solid].mean(axis=0) for each in (first, second)]
    color_error = float(np.linalg.norm(colors[0] - colors[1])) / 255
    return float(np.log((agreement + 0.02) / 0.15)) - 2.5 * size_error - 5.0 * color_error


def look_alike(first: MapObject, second: MapObject) -> bool:
    """Whether two objects may well be two of one make."""
    return first.number != second.number and likeness(first, second) > 0


def join(kept: MapObject, joined: MapObject) -> None:
    """Pour one object's evidence into another that is the same thing."""
    kept.voxels.absorb(joined.voxels)
    kept.voxels.fit_voxel()
    kept.labels.absorb(joined.labels)
    kept.viewpoints.absorb(joined.viewpoints)
    kept.existence = max(kept.existence, joined.existence)
    kept.first_seen_ns = min(kept.first_seen_ns, joined.first_seen_ns)
    if joined.last_seen_ns > kept.last_seen_ns:
        kept.last_seen_ns = joined.last_seen_ns
        kept.in_place()
        kept.shifted_looks = 0
    if kept.state.index == 0:
        kept.state.first_seen_ns = kept.first_seen_ns
        empty_ns = kept.state.empty_before_ns
        if empty_ns is not None and empty_ns >= kept.first_seen_ns:  # the other one stood there by then
            kept.state.empty_before_ns = joined.state.empty_before_ns
    kept.observations += joined.observations
    kept.pending += joined.pending
    if kept.track_id < 0:
        kept.track_id = joined.track_id
    kept.touched()


def older(first: MapObject, second: MapObject) -> tuple[MapObject, MapObject]:
    """The pair, the one that keeps its identity first: confirmed before tentative, then the earlier number."""
    if first.confirmed != second.confirmed:
        return (first, second) if first.confirmed else (second, first)
    return (first, second) if first.number < second.number else (second, first)


def near_pairs(objects: ObjectMap, touched: set[int]) -> list[tuple[MapObject, MapObject]]:
    """Pairs of present, still objects whose bounds overlap and of which at least one was touched."""
    return [
        (first, second)
        for first, second in objects.beside(touched, 0.3)
        if first.present and second.present and not first.on_the_move and not second.on_the_move
    ]
