"""What images say of one object of the map: that it is one thing, or two side by side under one name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.mapping.belief import Vantage, Viewpoints
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject, ObjectMap, ObjectShape, OpenState
from supermap_cli.mapping.pair_evidence import boxes_apart

AS_TWO_LOG_RATIO = float(np.log(0.75 / 0.03))
"""Two masks: both of two things are found, and not as one; or the detector splits a thing, in 3 % of images."""

AS_ONE_LOG_RATIO = float(np.log(0.06 / 0.97))
"""One mask over all: the detector joins two that touch, in 6 % of images; or there is one."""

SPLIT_LOG_ODDS = 6.0
"""An object is split at odds of 7 to 1, and before all images no more than one in 50 is two."""

LEAST_LOG_ODDS = -4.0
"""No less is believed of its being two: a detector may have joined the two for as long as they were far away."""

WHOLE_SHARE = 0.8
"""One mask is over all of it if it holds more than this share of what is seen of it."""

ON_SHARE = 0.5
"""A detection is of an object's part if more than this share of its points lies on the object."""

SHARED_SHARE = 0.1
"""Masks that share more than this of the smaller one are not of two things."""

SAME_HALVES = 0.5
"""Two images mean the same two if neither lies farther off than this share of the distance between the two."""

LEAST_LOOKS = 2
"""Images that must have shown the same two."""


@dataclass
class Halves:
    """The evidence on one object: log-odds that it is two, from where it was looked at, and the middles (3,) of the
    two, as the mean over the `looks` that showed the same two.
    """

    log_odds: float = 0.0
    viewpoints: Viewpoints = field(default_factory=Viewpoints)
    first: FloatArray | None = None
    second: FloatArray | None = None
    looks: int = 0

    def add(self, gain: float) -> None:
        """Take in what one image says, in log-odds."""
        self.log_odds = max(self.log_odds + gain, LEAST_LOG_ODDS)

    def agree(self, first: FloatArray, second: FloatArray) -> bool:
        """Take in the middles that an image shows; whether they are those of the images before."""
        off, crossed = self.off(first, second)
        if off < SAME_HALVES and self.first is not None and self.second is not None:
            a, b = (second, first) if crossed else (first, second)
            self.looks += 1
            self.first = self.first + (a - self.first) / self.looks
            self.second = self.second + (b - self.second) / self.looks
            return True
        new = self.first is None
        self.first, self.second, self.looks = first, second, 1
        return new

    def off(self, first: FloatArray, second: FloatArray) -> tuple[float, bool]:
        """How far two middles lie off those known, as a share of the distance between the two, and whether the first
        is the known second.
        """
        if self.first is None or self.second is None:
            return np.inf, False
        straight, crossed = (
            max(float(np.linalg.norm(self.first - a)), float(np.linalg.norm(self.second - b)))
            for a, b in ((first, second), (second, first))
        )
        return min(straight, crossed) / float(np.linalg.norm(self.first - self.second)), crossed < straight


@dataclass
class SplitEvidence:
    """What all images have said, by object number."""

    halves: dict[int, Halves] = field(default_factory=dict)

    def seen_as_one(self, number: int, view: Vantage) -> None:
        """An image showed all that can be seen of an object under one mask."""
        known = self.halves.setdefault(number, Halves())
        known.add(known.viewpoints.miss(view, AS_ONE_LOG_RATIO))

    def seen_as_two(self, number: int, first: LiftedDetection, second: LiftedDetection, view: Vantage) -> bool:
        """An image showed two things side by side on an object; whether it is by now surely two.

        Where the two lie elsewhere than before, the detector cut one thing in some way or other.
        """
        known = self.halves.setdefault(number, Halves())
        if known.agree(first.centroid_map, second.centroid_map):
            known.add(known.viewpoints.support(view, AS_TWO_LOG_RATIO)[1])
        return known.log_odds > SPLIT_LOG_ODDS and known.looks >= LEAST_LOOKS

    def looks(self, number: int) -> int:
        """How many images in a row showed the same two."""
        return self.halves[number].looks if number in self.halves else 0

    def forget(self, number: int) -> None:
        """Drop what is known of an object."""
        self.halves.pop(number, None)


def side_by_side(shape: ObjectShape, first: LiftedDetection, second: LiftedDetection) -> bool:
    """Whether two detections of one image, both mostly on an object's shape, show two things beside one another."""
    if not boxes_apart(first, second) or shared(first, second) > SHARED_SHARE:
        return False
    apart = np.abs(first.centroid_map - second.centroid_map)
    if float(np.linalg.norm(apart[:2])) < float(apart[2]):
        return False
    return min(shape.share_near(each.points_map) for each in (first, second)) > ON_SHARE


def shared(first: LiftedDetection, second: LiftedDetection) -> float:
    """The share of the smaller one of two masks that lies in the other."""
    a, b = first.mask, second.mask
    (ah, aw), (bh, bw) = a.pixels.shape, b.pixels.shape
    u0, v0 = max(a.u0, b.u0), max(a.v0, b.v0)
    u1, v1 = min(a.u0 + aw, b.u0 + bw), min(a.v0 + ah, b.v0 + bh)
    if u1 <= u0 or v1 <= v0:
        return 0.0
    of_a = a.pixels[v0 - a.v0 : v1 - a.v0, u0 - a.u0 : u1 - a.u0]
    of_b = b.pixels[v0 - b.v0 : v1 - b.v0, u0 - b.u0 : u1 - b.u0]
    smaller = min(int(np.count_nonzero(a.pixels)), int(np.count_nonzero(b.pixels)))
    return np.count_nonzero(of_a & of_b) / smaller if smaller else 0.0


def nearer_to_second(points_map: FloatArray, first: FloatArray, second: FloatArray) -> BoolArray:
    """(n,) which points lie nearer to the second of two groups of points than to the first."""
    nearer: BoolArray = cKDTree(second).query(points_map)[0] < cKDTree(first).query(points_map)[0]
    return nearer


def split_off(number: int, whole: MapObject, part: BoolArray, stamp_ns: int) -> MapObject:
    """A new object of the voxels `part` (n,) of another one, which loses them: as real, and called the same."""
    return MapObject(
        number,
        whole.voxels.taken_out(part),
        whole.labels.copy(),
        stamp_ns,
        stamp_ns,
        whole.existence,
        OpenState(0, stamp_ns),
        confirmed=True,
        entered=True,
    )


def whole_of(objects: ObjectMap, detection: LiftedDetection, given: Iterable[int]) -> MapObject | None:
    """The one of the objects with these numbers that a further detection of the same image lies on: detectors split
    large things.
    """
    label = detection.hypotheses[0].label
    for number in given:
        whole = objects[number]
        if whole.label == label and whole.shape.share_near(detection.points_map) > 0.5:
            return whole
    return None


def parts_beside(
    objects: ObjectMap, given: Mapping[int, LiftedDetection], free: Sequence[LiftedDetection]
) -> dict[int, list[LiftedDetection]]:
    """Which of the free detections lie on an object side by side with the one that it was given, by its number."""
    parts: dict[int, list[LiftedDetection]] = {}
    for detection in free:
        whole = whole_of(objects, detection, given)
        if whole is not None and side_by_side(whole.shape, given[whole.number], detection):
            parts.setdefault(whole.number, []).append(detection)
    return parts
