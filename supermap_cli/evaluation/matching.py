"""Matching of estimated with true objects: gates, one-to-one assignment, identity of states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap, EstimatedState
from supermap_cli.evaluation.known_truth import KnownTruth
from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.boxes import Box3D, box_iou

MIN_MATCH_IOU = 0.1
"""3D IoU of boxes above which two may match: low, for a robot sees objects from some sides only (paper, sec. V)."""
MAX_MATCH_DISTANCE_M = 0.3
"""Metres between the centres of the boxes below which two may match (paper, sec. V)."""


class Locatable(Protocol):
    """Anything with a centroid and a box in the world: an instance, one of its states, a true place."""

    @property
    def centroid(self) -> FloatArray:
        """(3,) metres in the world."""

    @property
    def box(self) -> Box3D:
        """Its box in the world."""


@dataclass(frozen=True)
class Closeness:
    """Box IoU (n, m) and centroid distance (n, m) of n estimated and m true objects.

    `near` (n, m) is the gate that all matching shares: IoU > `MIN_MATCH_IOU` and distance < `MAX_MATCH_DISTANCE_M`.
    """

    iou: FloatArray
    distance_m: FloatArray

    @property
    def near(self) -> BoolArray:
        """(n, m): close enough to be the same object in the same place."""
        gate: BoolArray = (self.iou > MIN_MATCH_IOU) & (self.distance_m < MAX_MATCH_DISTANCE_M)
        return gate


def closeness(estimated: Sequence[Locatable], true: Sequence[Locatable]) -> Closeness:
    """Compare all pairs."""
    iou = np.array([[box_iou(one.box, other.box) for other in true] for one in estimated], np.float64)
    offsets = centroids(estimated)[:, None, :] - centroids(true)[None, :, :]
    rounded_off = np.minimum(iou, 1.0).reshape(len(estimated), len(true))
    return Closeness(rounded_off, np.linalg.norm(offsets, axis=2))


def centroids(objects: Sequence[Locatable]) -> FloatArray:
    """The centroids (n, 3) of n objects."""
    return np.array([obj.centroid for obj in objects], np.float64).reshape(-1, 3)


def same_label(first: str, second: str) -> bool:
    """Whether two labels are one, whatever their case."""
    return first.casefold() == second.casefold()


def label_agreement(estimated: Sequence[str], true: Sequence[str]) -> BoolArray:
    """(n, m): which labels are the same."""
    agrees = np.array([[same_label(one, other) for other in true] for one in estimated], dtype=bool)
    return agrees.reshape(len(estimated), len(true))


def match_one_to_one(allowed: BoolArray, preference: FloatArray) -> tuple[tuple[int, int], ...]:
    """The one-to-one pairs (row, column) among the allowed ones (n, m): as many as possible, and among those
    assignments the one with the greatest sum of `preference` (n, m) in [0, 1] (Kuhn 1955, by scipy).
    """
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    if not allowed.any():
        return ()
    pair_bonus = min(allowed.shape) + 1
    gain = np.where(allowed, pair_bonus + preference, 0.0)
    rows, columns = linear_sum_assignment(gain, maximize=True)
    return tuple((int(r), int(c)) for r, c in zip(rows, columns, strict=True) if allowed[r, c])


@dataclass(frozen=True)
class TrueIdentity:
    """The true object that a state of an instance is, and the places (indices into `places`) it was matched with."""

    object_id: str
    places: frozenset[int]


def identify(estimate: EstimatedMap, known: KnownTruth) -> tuple[tuple[TrueIdentity | None, ...], ...]:
    """For every instance, the true identity of each of its states; `None` where no object stood there then.

    A state is the object whose place it is near (`Closeness.near`, whatever the label) and that stood there at some
    time between the state's first and last observation; among several the one with the greatest IoU. The time after
    the last observation does not count.
    """
    return tuple(_identify(instance.states, known) for instance in estimate.objects)


def _identify(states: Sequence[EstimatedState], known: KnownTruth) -> tuple[TrueIdentity | None, ...]:
    close = closeness(states, known.places)
    near = close.near
    for row, state in enumerate(states):
        for k in np.flatnonzero(near[row]):
            near[row, k] = known.places[k].overlaps(state.first_seen_ns, state.last_seen_ns)
    return tuple(_identified(near[row], close.iou[row], known) for row in range(len(states)))


def _identified(near: BoolArray, iou: FloatArray, known: KnownTruth) -> TrueIdentity | None:
    if not near.any():
        return None
    best = known.places[int(np.argmax(np.where(near, iou, -1.0)))].object.id
    places = frozenset(int(k) for k in np.flatnonzero(near) if known.places[k].object.id == best)
    return TrueIdentity(best, places)
