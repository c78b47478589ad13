"""Whether a thing stands out from what is around it, as one of its class must.

Detectors take a patch of a floor for a chair, a part of a wall for a refrigerator, again and again; a camera that
measures depth sees that nothing stands there. A detection's relief is how far what its mask shows rises from the planes
that go on beside it. Of a thing that is thick by its class, a flat look is unlikely; of what fools a detector, common.

Departs from the paper, whose existence (eq. 8) knows the detector's word and the rays alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.mapping import class_sizes
from supermap_cli.types.parameters import parameter

Plane = tuple[FloatArray, float]
"""Normal (3,) to the camera's side, and offset in metres, in the camera's frame."""


@dataclass(frozen=True)
class ReliefParameters:
    """How relief is measured, and what a flat look says."""

    percentile: float = parameter(
        90.0, "%", "percentile of a mask's heights over the planes beside it: masks leak, legs are thin", "chosen"
    )
    flat_share: float = parameter(
        0.5, "1", "share of its class's thickness below which a thing looks flat: it is seen in part", "chosen"
    )
    wrong_look: float = parameter(
        0.05,
        "1",
        "P(a look is wrong: that a thing looks flat that is not, or the other way round)",
        "mean over what stood out mostly, of the domain suite's development half: .02",
        at_least=1e-3,
        at_most=0.4,
    )
    flat_odds: float = parameter(
        0.025,
        "1",
        "P(looks flat throughout | a thing is there) / P(... | something fooled the detector)",
        "18 worlds of the domain suite's development half: 1 in 100 against 4 in 10",
        at_least=1e-4,
        at_most=1.0,
    )


DEFAULT = ReliefParameters()


@dataclass(frozen=True)
class Relief:
    """How far what a mask shows rises from the planes that go on beside it, and how exactly depth tells: metres."""

    height_m: float
    tolerance_m: float


@dataclass(frozen=True)
class ReliefLooks:
    """In how many looks an object looked flat for what it was called, and in how many it stood out; looks from nearly
    one place, or in quick succession, count as fewer.
    """

    flat: float = 0.0
    raised: float = 0.0

    def __add__(self, other: ReliefLooks) -> ReliefLooks:
        return ReliefLooks(self.flat + other.flat, self.raised + other.raised)

    def log_ratio(self, parameters: ReliefParameters = DEFAULT) -> float:
        """Log P(these looks | a thing is there) / P(... | something fooled the detector), not above 0: much that fools
        detectors stands out too.
        """
        wrong = float(np.log(parameters.wrong_look) - np.log1p(-parameters.wrong_look))
        flat = 1 / (1 + float(np.exp(wrong * (self.flat - self.raised))))
        return float(np.log(1 - flat + parameters.flat_odds * flat))


def relief_of(
    points: FloatArray | Float32Array,
    tolerance_m: Float32Array,
    planes: Sequence[Plane],
    parameters: ReliefParameters = DEFAULT,
) -> Relief | None:
    """The relief of points (3, n) of a mask, in the camera's frame, over the nearest of the planes beside it; `None`
    where there is no plane. A point within its tolerance (n,) of a plane may lie on it.
    """
    if not planes or points.shape[1] == 0:
        return None
    heights_m = np.abs(np.stack([normal @ points - offset for normal, offset in planes])).min(axis=0)
    height_m, resolved_m = (float(percentiles(of, (parameters.percentile,))[0]) for of in (heights_m, tolerance_m))
    return Relief(height_m, resolved_m)


def planes_through(
    points: Float32Array, tolerance_m: Float32Array, planes: Sequence[Plane], least_share: float
) -> list[Plane]:
    """Those of the planes on which at least that share of points (3, n) lies, to a tolerance (n,) in metres.

    Of points at some distance from a mask: what lies right beside one may be the thing itself, where the mask misses a
    part of it.
    """
    if points.shape[1] == 0:
        return []
    return [
        (normal, offset)
        for normal, offset in planes
        if np.mean(np.abs(normal @ points - offset) < tolerance_m) >= least_share
    ]


def look_at(
    relief: Relief | None, label: str, weight: float, parameters: ReliefParameters = DEFAULT
) -> ReliefLooks | None:
    """What a detection of this label and relief says, worth `weight` looks; `None` where depth is too inexact to tell,
    or the class has no thickness.
    """
    thickness_m = class_sizes.thickness_m(label)
    if relief is None or thickness_m is None:
        return None
    least_m = parameters.flat_share * thickness_m
    if relief.tolerance_m > least_m:
        return None
    flat = relief.height_m < least_m
    return ReliefLooks(weight * flat, weight * (not flat))
