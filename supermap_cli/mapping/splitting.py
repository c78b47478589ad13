"""What images say of one object of the map: that it is one thing, or two side by side under one name.

No counterpart in the paper: what its detector joins once stays one object. Here it is a sequential test of the two
hypotheses, and what turns out to be two is split.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.mapping import belief, pair_evidence
from supermap_cli.mapping.belief import BeliefParameters, Existence, Viewpoint, ViewpointHistory
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.mask_overlap import overlap_share
from supermap_cli.mapping.object_shape import ObjectShape
from supermap_cli.mapping.objects import MapObject, ObjectMap, ObjectStatus, OpenState
from supermap_cli.mapping.pair_evidence import PairEvidenceParameters, boxes_apart
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class SplittingParameters:
    """What one image says of an object's being two, and when all together are enough."""

    two_masks_of_two: float = parameter(
        0.75, "1", "P(two masks | two things): both are found, and not as one", TUNED, at_least=1e-3, at_most=0.999
    )
    two_masks_of_one: float = parameter(
        0.03, "1", "P(two masks | one thing): the detector splits it", TUNED, at_least=1e-3, at_most=0.999
    )
    one_mask_of_two: float = parameter(
        0.06, "1", "P(one mask | two things): the detector joins two that touch", TUNED, at_least=1e-3, at_most=0.999
    )
    one_mask_of_one: float = parameter(0.97, "1", "P(one mask | one thing)", TUNED, at_least=1e-3, at_most=0.999)
    split_log_odds: float = parameter(
        6.0, "1", "evidence for a split: odds of 7 to 1, and before all images no more than one in 50 is two", TUNED
    )
    min_log_odds: float = parameter(
        -4.0,
        "1",
        "no less is believed of its being two: a detector may have joined the two as long as they were far away",
        TUNED,
    )
    min_images: int = parameter(2, "1", "images that must have shown the same two", TUNED)
    whole_share: float = parameter(
        0.8, "1", "one mask is over all of an object if it holds more than this share of what is seen of it", TUNED
    )
    part_share: float = parameter(
        0.5, "1", "a detection is of an object's part if more than this share of its points lies on the object", TUNED
    )
    max_mask_overlap: float = parameter(
        0.1, "1", "masks that share more than this of the smaller one are not of two things", TUNED
    )
    same_halves_share: float = parameter(
        0.5,
        "1",
        "two images mean the same two if neither lies farther off than this share of the distance between them",
        TUNED,
    )

    @property
    def as_two_log_ratio(self) -> float:
        """What two masks say."""
        return float(np.log(self.two_masks_of_two / self.two_masks_of_one))

    @property
    def as_one_log_ratio(self) -> float:
        """What one mask over all says."""
        return float(np.log(self.one_mask_of_two / self.one_mask_of_one))


DEFAULT = SplittingParameters()


@dataclass
class Halves:
    """The evidence on one object: log-odds that it is two, from where it was looked at, and the middles (3,) of the
    two, as the mean over the `images` that showed the same two.
    """

    log_odds: float = 0.0
    viewpoints: ViewpointHistory = field(default_factory=lambda: ViewpointHistory(repeat=True))
    first: FloatArray | None = None
    second: FloatArray | None = None
    images: int = 0

    def add(self, gain: float, parameters: SplittingParameters = DEFAULT) -> None:
        """Take in what one image says, in log-odds."""
        self.log_odds = max(self.log_odds + gain, parameters.min_log_odds)

    def agree(self, first: FloatArray, second: FloatArray, parameters: SplittingParameters = DEFAULT) -> bool:
        """Take in the middles that an image shows; whether they are those of the images before."""
        off, crossed = self.off(first, second)
        if off < parameters.same_halves_share and self.first is not None and self.second is not None:
            a, b = (second, first) if crossed else (first, second)
            self.images += 1
            self.first = self.first + (a - self.first) / self.images
            self.second = self.second + (b - self.second) / self.images
            return True
        new = self.first is None
        self.first, self.second, self.images = first, second, 1
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
    parameters: SplittingParameters = field(default=DEFAULT, repr=False, compare=False)
    belief_parameters: BeliefParameters = field(default=belief.DEFAULT, repr=False, compare=False)

    def use(self, parameters: SplittingParameters, belief_parameters: BeliefParameters) -> None:
        """Set the parameters of all evidence."""
        self.parameters, self.belief_parameters = parameters, belief_parameters
        for halves in self.halves.values():
            halves.viewpoints.parameters = belief_parameters

    def add_one_mask(self, number: int, viewpoint: Viewpoint) -> None:
        """An image showed all that can be seen of an object under one mask."""
        known = self._halves_of(number)
        known.add(known.viewpoints.add_miss(viewpoint, self.parameters.as_one_log_ratio), self.parameters)

    def add_two_masks(self, number: int, first: LiftedDetection, second: LiftedDetection, viewpoint: Viewpoint) -> bool:
        """An image showed two things side by side on an object; whether it is by now surely two.

        Where the two lie elsewhere than before, the detector cut one thing in some way or other.
        """
        parameters = self.parameters
        known = self._halves_of(number)
        if known.agree(first.centroid_map, second.centroid_map, parameters):
            gain = known.viewpoints.add_detection(viewpoint, parameters.as_two_log_ratio)[1]
            known.add(gain, parameters)
        return known.log_odds > parameters.split_log_odds and known.images >= parameters.min_images

    def images(self, number: int) -> int:
        """How many images in a row showed the same two."""
        return self.halves[number].images if number in self.halves else 0

    def forget(self, number: int) -> None:
        """Drop what is known of an object."""
        self.halves.pop(number, None)

    def _halves_of(self, number: int) -> Halves:
        if number not in self.halves:
            self.halves[number] = Halves(viewpoints=ViewpointHistory(repeat=True, parameters=self.belief_parameters))
        return self.halves[number]


def side_by_side(
    shape: ObjectShape,
    first: LiftedDetection,
    second: LiftedDetection,
    parameters: SplittingParameters = DEFAULT,
    pair_parameters: PairEvidenceParameters = pair_evidence.DEFAULT,
) -> bool:
    """Whether two detections of one image, both mostly on an object's shape, show two things beside one another."""
    if not boxes_apart(first, second, pair_parameters):
        return False
    if overlap_share(first.mask, second.mask) > parameters.max_mask_overlap:
        return False
    apart = np.abs(first.centroid_map - second.centroid_map)
    if float(np.linalg.norm(apart[:2])) < float(apart[2]):
        return False
    return min(shape.share_near(detection.points_map) for detection in (first, second)) > parameters.part_share


def nearer_to_second(points_map: FloatArray, first: FloatArray, second: FloatArray) -> BoolArray:
    """(n,) which points lie nearer to the second of two groups of points than to the first."""
    nearer: BoolArray = cKDTree(second).query(points_map)[0] < cKDTree(first).query(points_map)[0]
    return nearer


def split_off(number: int, whole: MapObject, part: BoolArray, stamp_ns: int) -> MapObject:
    """A new object of the voxels `part` (n,) of another one, which loses them: as real, and called the same."""
    sets = whole.parameters
    return MapObject(
        number,
        whole.voxels.taken_out(part),
        whole.labels.copy(),
        Existence(whole.existence.log_odds, ViewpointHistory(parameters=sets.belief)),
        OpenState(0, stamp_ns),
        stamp_ns,
        stamp_ns,
        status=ObjectStatus(confirmed=True, stored=True),
        found_by=dict(whole.found_by),
        relief=dict(whole.relief),
    )


def whole_of(
    objects: ObjectMap,
    detection: LiftedDetection,
    matched: Iterable[int],
    parameters: SplittingParameters = DEFAULT,
) -> MapObject | None:
    """The one of the matched objects that a further detection of the same image lies on: detectors split large
    things.
    """
    label = detection.hypotheses[0].label
    for number in matched:
        whole = objects[number]
        if whole.label == label and whole.shape.share_near(detection.points_map) > parameters.part_share:
            return whole
    return None


def parts_beside(
    objects: ObjectMap,
    matched: Mapping[int, LiftedDetection],
    free: Sequence[LiftedDetection],
    parameters: SplittingParameters = DEFAULT,
    pair_parameters: PairEvidenceParameters = pair_evidence.DEFAULT,
) -> dict[int, list[LiftedDetection]]:
    """Which of the free detections lie on an object side by side with the one matched to it, by its number."""
    parts: dict[int, list[LiftedDetection]] = {}
    for detection in free:
        whole = whole_of(objects, detection, matched, parameters)
        if whole is None:
            continue
        if side_by_side(whole.shape, matched[whole.number], detection, parameters, pair_parameters):
            parts.setdefault(whole.number, []).append(detection)
    return parts
