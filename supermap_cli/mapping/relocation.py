"""Relocation: an object that is gone from its place, and one found elsewhere, are one.

The paper keeps identities through the tracker only; here they outlive the time that nobody looked, if label, size,
colour and times single one pair out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class RelocationParameters:
    """What speaks for a pair, and by how much it must beat all others (log ratios)."""

    margin: float = parameter(1.0, "1", "log ratio (odds of 2.7) by which one explanation must beat all others", TUNED)
    candidate_log_ratio: float = parameter(
        -1.0, "1", "a pair that is less likely one object than this is no candidate", TUNED
    )
    prior: float = parameter(1.5, "1", "log ratio of any pair: what is gone mostly stands elsewhere", TUNED)
    moved_m: float = parameter(
        3.0, "m", "mean distance of things that are moved within reach", "within a room; prior", at_least=0.1
    )
    moved_anywhere: float = parameter(
        0.5, "1", "share of moved things that end up anywhere in the place", "even odds", at_least=0.01, at_most=1.0
    )
    least_area_m2: float = parameter(10.0, "m2", "least area of a place", "a small room", at_least=1.0)
    not_seen_empty: float = parameter(
        -1.0, "1", "log ratio where the new place had not been seen empty before: it may have stood there", TUNED
    )
    others_weight: float = parameter(
        4.0, "1", "how much likelier one more of a kind is than a moved object, for each of its kind nearby", TUNED
    )
    timely_share: float = parameter(
        0.1,
        "1",
        "share of the time before an object was seen to be gone: to have left within it is nothing strange",
        TUNED,
        at_least=1e-3,
    )
    untimely: float = parameter(-2.5, "1", "log ratio of having left within next to none of that time", TUNED)
    label_floor: float = parameter(
        0.02, "1", "added to the agreement of labels: no label is sure", TUNED, at_least=1e-6
    )
    label_by_chance: float = parameter(0.15, "1", "agreement of labels of two things", TUNED, at_least=1e-3)
    size_weight: float = parameter(2.5, "1", "log ratio that a unit of log size costs", TUNED)
    color_weight: float = parameter(5.0, "1", "log ratio that a difference of colour (of 1) costs", TUNED)


DEFAULT = RelocationParameters()


@dataclass(frozen=True)
class Relocation:
    """An object seen to be gone, and a new one that may be it: `probability` among all that were considered."""

    gone: int
    found: int
    probability: float
    certain: bool


def relocations(
    gone: Iterable[MapObject],
    found: Iterable[MapObject],
    standing: Iterable[MapObject] = (),
    parameters: RelocationParameters = DEFAULT,
) -> list[Relocation]:
    """Match objects that are gone with objects that turned up: an assignment over all pairs.

    A pair is certain if no assignment without it is nearly as likely; what else is likely is left as a candidate.
    `standing` is what has stood in its place all along: an object in a place nobody had looked at may well be one more
    of its kind.
    """
    absent, new, others = list(gone), list(found), list(standing)
    if not absent or not new:
        return []
    area_m2 = place_area_m2([*absent, *new, *others], parameters)
    scores = np.array([[resemblance(old, candidate, area_m2, parameters) for candidate in new] for old in absent])
    for column, candidate in enumerate(new):
        if candidate.state.empty_before_ns is None:
            alike = sum(look_alike(candidate, other, parameters) for other in others)
            scores[:, column] -= np.log1p(parameters.others_weight * alike)
    likely = []
    for row, column in np.argwhere(scores > parameters.candidate_log_ratio).tolist():
        lead = assignment_lead(scores, row, column)
        probability = float(1 / (1 + np.exp(-lead)))
        likely.append(Relocation(absent[row].number, new[column].number, probability, lead > parameters.margin))
    settled = {number for pair in likely if pair.certain for number in (pair.gone, pair.found)}
    return [pair for pair in likely if pair.certain or settled.isdisjoint((pair.gone, pair.found))]


def assignment_lead(scores: FloatArray, row: int, column: int) -> float:
    """By how much the best assignment with a pair of `scores` (n, m) beats the best one without it (log ratio).

    Whatever scores below 0 is left unassigned. Of several look-alikes no pair decides alone: what the others would have
    to be counts too.
    """
    gains = np.maximum(scores, 0.0)
    rest = np.delete(np.delete(gains, row, axis=0), column, axis=1)
    with_pair = float(scores[row, column]) + _best_total(rest)
    gains[row, column] = 0.0
    return with_pair - _best_total(gains)


def _best_total(gains: FloatArray) -> float:
    rows, columns = linear_sum_assignment(gains, maximize=True)
    return float(gains[rows, columns].sum())


def place_area_m2(objects: Sequence[MapObject], parameters: RelocationParameters = DEFAULT) -> float:
    """Area of the level square that objects stand in."""
    centroids = np.array([obj.shape.centroid[:2] for obj in objects])
    return max(float(np.ptp(centroids, axis=0).max()) ** 2, parameters.least_area_m2)


def by_presence(objects: ObjectMap) -> tuple[list[MapObject], list[MapObject], list[MapObject]]:
    """The confirmed objects that are gone, those found since the first of them was last seen, and those that have stood
    there before; what moves by itself is never gone.
    """
    confirmed = [obj for obj in objects if obj.confirmed]
    gone = [obj for obj in confirmed if not obj.present and not obj.is_dynamic]
    first_gone_ns = min((obj.last_seen_ns for obj in gone), default=0)
    present = [obj for obj in confirmed if obj.present]
    found = [obj for obj in present if obj.state.index == 0 and obj.first_seen_ns > first_gone_ns]
    return gone, found, [obj for obj in present if obj.first_seen_ns <= first_gone_ns]


def resemblance(
    first: MapObject, second: MapObject, area_m2: float, parameters: RelocationParameters = DEFAULT
) -> float:
    """Log ratio for an object that is gone and one found elsewhere to be one: label, size, colour, distance and time,
    and whether it came.

    Sizes are compared without the thinnest side: how deep a thing is, a view from one side does not show.
    """
    if second.is_dynamic or second.first_seen_ns <= first.last_seen_ns:
        return -np.inf
    came = 0.0 if second.state.empty_before_ns is not None else parameters.not_seen_empty
    near = nearness(displacement_m(first.shape.box, second.shape.box), area_m2, parameters)
    return likeness(first, second, parameters) + parameters.prior + near + came + timeliness(first, second, parameters)


def nearness(distance_m: float, area_m2: float, parameters: RelocationParameters = DEFAULT) -> float:
    """Log ratio of the densities with which a moved thing, and any other, turns up at that distance.

    Moved things mostly stay near (an exponential of the level distance), some go anywhere; others come anywhere.
    """
    reach_m = parameters.moved_m / 2  # the mean of the level distance is twice the scale of such a density
    density_per_m2 = np.exp(-distance_m / reach_m) / (2 * np.pi * reach_m**2)
    anywhere = parameters.moved_anywhere
    return float(np.log((1 - anywhere) * density_per_m2 * area_m2 + anywhere))


def timeliness(gone: MapObject, found: MapObject, parameters: RelocationParameters = DEFAULT) -> float:
    """How much less likely it is that an object left before another was found than at any time before it was seen to be
    gone (log ratio, not above 0): one was there before the other had to be gone. Things leave in bursts.
    """
    if gone.gone_ns is None or found.first_seen_ns >= gone.gone_ns:
        return 0.0
    share = (found.first_seen_ns - gone.last_seen_ns) / (gone.gone_ns - gone.last_seen_ns)
    return float(np.clip(np.log(share / parameters.timely_share), parameters.untimely, 0.0))


def likeness(first: MapObject, second: MapObject, parameters: RelocationParameters = DEFAULT) -> float:
    """How much more alike two objects are than two things of any kind (log ratio), by label, size and colour."""
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[label] * q.get(label, 0.0) for label in p)
    sizes = np.array([np.sort(obj.shape.box.size)[1:] for obj in (first, second)])
    size_error = float(np.abs(np.log(sizes[0] / sizes[1])).max())
    colors = [obj.voxels.rgb[obj.solid].mean(axis=0) for obj in (first, second)]
    color_error = float(np.linalg.norm(colors[0] - colors[1])) / 255
    label_log_ratio = float(np.log((agreement + parameters.label_floor) / parameters.label_by_chance))
    return label_log_ratio - parameters.size_weight * size_error - parameters.color_weight * color_error


def look_alike(first: MapObject, second: MapObject, parameters: RelocationParameters = DEFAULT) -> bool:
    """Whether two objects may well be two of one make."""
    return first.number != second.number and likeness(first, second, parameters) > 0
