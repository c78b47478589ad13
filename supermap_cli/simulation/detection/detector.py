"""A simulated detector with the errors of real ones: it makes the recorded detections of an exact view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.simulation.detection.correlated_noise import CorrelatedNoise
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.detection.fixed_errors import class_recall, named_generator, world_seed
from supermap_cli.simulation.detection.label_errors import LabelErrors, called_otherwise
from supermap_cli.simulation.detection.mask_errors import (
    parts_across_seam,
    redrawn,
    split_in_two,
    touch,
    with_patch,
)
from supermap_cli.simulation.detection.outline_errors import OutlineErrors
from supermap_cli.simulation.detection.phantoms import Phantoms, random_region
from supermap_cli.simulation.detection.posters import Posters
from supermap_cli.simulation.views import PlaceVisibility, RenderedView
from supermap_cli.simulation.world import World
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, joined_masks, no_detections
from supermap_cli.types.sensing import MAIN_CAMERA

_NEVER_MISTAKEN = ("nothing", "poster")
"""False detections that have no true label which a wrong one could take the place of."""

__all__ = ["DetectorErrors", "SimulatedDetector"]


@dataclass(frozen=True)
class _Region:
    """A region that may be detected. `who` is the key of its noise; `ease` in [0, 1] is how well it can be seen."""

    who: tuple[str, int, int]
    label: str
    mask: RegionMask
    ease: float

    @property
    def area_px(self) -> int:
        return int(self.mask.pixels.sum())


@dataclass(frozen=True)
class _Report:
    """One detection as it is reported."""

    box_xyxy: FloatArray
    hypotheses: tuple[Hypothesis, ...]
    mask: RegionMask | None


class SimulatedDetector:
    """Detects things in one image after the other: labels, scores, boxes and masks, never a true id.

    Deterministic: the same seed and the same images in the same order give the same detections. `phantom_seed` places
    the spots of the building that it mistakes for things; detectors that share it share the spots. Class recalls,
    posters and each thing's wrong words follow from the world alone (`fixed_errors`).
    """

    def __init__(
        self,
        world: World,
        errors: DetectorErrors,
        seed: int,
        *,
        phantom_seed: int | None = None,
        camera_id: str = MAIN_CAMERA,
    ) -> None:
        self._world = world
        self._errors = errors
        self._camera_id = camera_id
        self._rng, self._latency_rng, _, noise_rng, outline_rng, self._words_rng, self._posters_rng = (
            np.random.default_rng(seed).spawn(7)
        )
        spots_rng = np.random.default_rng(seed if phantom_seed is None else phantom_seed).spawn(4)[2]
        self._label_errors = LabelErrors(thing.label for thing in world.things)
        self._phantoms = Phantoms.scattered(world, self._label_errors.labels, errors.phantoms_per_m2, spots_rng)
        self._noise = CorrelatedNoise(
            noise_rng, lasting_s=errors.lasting_s, lasting=errors.lasting, constant=errors.constant
        )
        self._taken_for: dict[tuple[str, int, int], str] = {}
        self._world_seed = world_seed(world)
        self._outline_errors = OutlineErrors(errors, outline_rng)
        self._posters = Posters.hung(
            world, errors.posters, errors.poster_recall, named_generator(self._world_seed, "posters")
        )

    def latency_s(self) -> float:
        """How long the next detection takes."""
        return float(self._latency_rng.uniform(self._errors.latency_min_s, self._errors.latency_max_s))

    def detect(
        self,
        view: RenderedView,
        visibility: PlaceVisibility,
        *,
        full_turn: bool,
        camera: Camera | None = None,
        T_world_camera: FloatArray | None = None,
    ) -> Detections:
        """What is found in an image, best score first. In an image of a `full_turn` a thing across the seam is found as
        two. With the camera and where it stands, false detections also come back at the same spots of the building.
        """
        stamp_ns = view.stamp_ns
        found = [
            candidate
            for candidate in self._candidates(view, visibility, full_turn)
            if self._notices(candidate, stamp_ns)
        ]
        found = [part for candidate in self._merged(found, stamp_ns) for part in self._split(candidate, stamp_ns)]
        reports = [self._report(candidate, view) for candidate in found]
        reports += [self._report(candidate, view) for candidate in self._imagined(view, camera, T_world_camera)]
        if not reports:
            return no_detections(stamp_ns, self._camera_id)
        reports.sort(key=lambda report: -report.hypotheses[0].score)
        return Detections(
            stamp_ns,
            np.array([report.box_xyxy for report in reports], np.float32),
            np.array([report.hypotheses[0].score for report in reports], np.float32),
            tuple(report.hypotheses for report in reports),
            tuple(report.mask for report in reports),
            self._camera_id,
        )

    def _candidates(self, view: RenderedView, visibility: PlaceVisibility, full_turn: bool) -> Iterator[_Region]:
        """All things that the image shows, large enough to be found."""
        from scipy.ndimage import find_objects  # noqa: PLC0415 - keeps start-up light

        rows = {int(visibility.thing[k]): int(k) for k in np.flatnonzero(visibility.present & (visibility.pixels > 0))}
        for number, region in enumerate(find_objects(view.thing), start=1):
            if region is None:
                continue
            down, across = region
            whole = RegionMask(across.start, down.start, view.thing[region] == number)
            parts = parts_across_seam(whole, view.thing.shape[1]) if full_turn else [whole]
            areas = [int(part.pixels.sum()) for part in parts]
            row = rows[number - 1]
            for k, (part, area_px) in enumerate(zip(parts, areas, strict=True)):
                if area_px >= self._errors.min_area_px:
                    share = float(visibility.visible[row]) * area_px / sum(areas)
                    ease = self._ease(float(visibility.distance_m[row]), share, area_px)
                    yield _Region(("thing", number, k), self._world.things[number - 1].label, part, ease)

    def _ease(self, distance_m: float, visible: float, area_px: float) -> float:
        """How well such a thing can be seen, in [0, 1]: a product of Hill curves."""
        errors = self._errors
        far = 1 - _hill(distance_m, errors.half_distance_m, 4)
        return far * _hill(visible, errors.half_visible, 3) * _hill(area_px, errors.half_area_px, 1.5)

    def _notices(self, candidate: _Region, stamp_ns: int) -> bool:
        errors, recall = self._errors, self._errors.recall
        if errors.class_spread:
            recall = class_recall(self._world_seed, candidate.label, recall, errors.class_spread)
        return self._noise.uniform(("miss", candidate.who), stamp_ns) < recall * candidate.ease

    def _merged(self, found: list[_Region], stamp_ns: int) -> list[_Region]:
        """Some touching things are found as one, under the label of the larger; each takes part in one such pair."""
        left = dict(enumerate(found))
        if not self._errors.merging and not self._errors.swallowing:
            return found
        for i, j in combinations(range(len(found)), 2):
            if i not in left or j not in left or not touch(found[i].mask, found[j].mask):
                continue
            rate = self._errors.merging if found[i].label == found[j].label else self._errors.swallowing
            if self._noise.uniform(("merge", found[i].who, found[j].who), stamp_ns) < rate:
                small, large = sorted((i, j), key=lambda k: found[k].area_px)
                left[large] = replace(found[large], mask=joined_masks(found[i].mask, found[j].mask))
                del left[small]
        return list(left.values())

    def _split(self, candidate: _Region, stamp_ns: int) -> list[_Region]:
        """Some things are found as two parts."""
        if candidate.area_px < self._errors.splitting_area_px:
            return [candidate]
        if self._noise.uniform(("split", candidate.who), stamp_ns) >= self._errors.splitting:
            return [candidate]
        parts = split_in_two(candidate.mask, self._rng)
        return [candidate] if parts is None else [replace(candidate, mask=part) for part in parts]

    def _imagined(
        self, view: RenderedView, camera: Camera | None, T_world_camera: FloatArray | None
    ) -> Iterator[_Region]:
        """False detections, mostly with low scores."""
        stamp_ns, labels = view.stamp_ns, self._label_errors.labels
        for _ in range(int(self._rng.poisson(self._errors.false_positives))):
            label = str(self._rng.choice(labels))
            yield _Region(("nothing", 0, 0), label, random_region(view, self._rng), float(self._rng.uniform(0, 0.35)))
        if camera is None or T_world_camera is None:
            return
        for spot, region in self._phantoms.seen(view, camera, T_world_camera):
            if self._noise.uniform(("miss", ("spot", spot, 0)), stamp_ns) < self._errors.phantom_recall:
                ease = float(self._rng.uniform(0, 0.5))
                yield _Region(("spot", spot, 0), self._phantoms.labels[spot], region, ease)
        for poster, region in self._posters.seen(view, camera, T_world_camera):
            if self._posters_rng.random() < self._posters.recalls[poster]:
                ease = float(self._posters_rng.uniform(0.6, 0.9))
                yield _Region(("poster", poster, 0), self._posters.labels[poster], region, ease)

    def _report(self, candidate: _Region, view: RenderedView) -> _Report:
        """The candidate as it is reported: mask, box, labels and scores with their errors."""
        errors, mask = self._errors, self._drawn(candidate, view)
        taken_for = self._mistaken(candidate, view.stamp_ns)
        score = self._score(candidate, view.stamp_ns)
        hypotheses = self._label_errors.hypotheses(
            candidate.label, taken_for, score, errors.hypotheses, self._rng, wrong_score=errors.wrong_score
        )
        if taken_for is None and errors.synonyms and self._words_rng.random() < errors.synonyms:
            hypotheses = called_otherwise(hypotheses, errors.hypotheses, self._words_rng)
        box = self._box(mask, view)
        return _Report(box, hypotheses, self._outline_errors.drawn(mask, *view.thing.shape))

    def _score(self, candidate: _Region, stamp_ns: int) -> float:
        errors = self._errors
        mean = errors.worst_score + (errors.best_score - errors.worst_score) * candidate.ease
        noisy = mean + errors.score_noise * self._noise.normal(("score", candidate.who), stamp_ns)
        return float(np.clip(noisy, errors.min_score, 0.99))

    def _mistaken(self, candidate: _Region, stamp_ns: int) -> str | None:
        """What a thing is taken for now, if for something else; as long as that lasts, for the same. What is hard to
        see is mistaken more often, unless things have wrong words of their own.
        """
        errors = self._errors
        rate = errors.confusion if errors.wrong_words else errors.confusion * (1.4 - 0.8 * candidate.ease)
        if candidate.who[0] in _NEVER_MISTAKEN or self._noise.uniform(("label", candidate.who), stamp_ns) >= rate:
            self._taken_for.pop(candidate.who, None)
            return None
        if errors.wrong_words:
            return str(self._words_rng.choice(self._wrong_words(candidate)))
        if candidate.who not in self._taken_for:
            self._taken_for[candidate.who] = self._label_errors.others(candidate.label, 1, self._rng)[0]
        return self._taken_for[candidate.who]

    def _wrong_words(self, candidate: _Region) -> list[str]:
        """The wrong words that this thing always gets."""
        kind, number, _ = candidate.who
        rng = named_generator(self._world_seed, f"words of {kind} {number}")
        return self._label_errors.others(candidate.label, self._errors.wrong_words, rng)

    def _drawn(self, candidate: _Region, view: RenderedView) -> RegionMask:
        errors, rng = self._errors, self._rng
        height, width = view.thing.shape
        too_large = self._noise.uniform(("mask", candidate.who), view.stamp_ns) < errors.bleeding
        grow_px = rng.uniform(0.3, 1) * errors.bleeding_px if too_large else -rng.uniform(0, 1) * errors.erosion_px
        mask = redrawn(
            candidate.mask, grow_px=float(grow_px), wobble_px=errors.wobble_px, height=height, width=width, rng=rng
        )
        if errors.patches and rng.random() < errors.patches:
            mask = with_patch(mask, height=height, width=width, rng=rng)
        return mask

    def _box(self, mask: RegionMask, view: RenderedView) -> FloatArray:
        """The mask's box (4,) xyxy, its edges shifted a little, within the image."""
        height, width = view.thing.shape
        h, w = mask.pixels.shape
        box = np.array([mask.u0, mask.v0, mask.u0 + w, mask.v0 + h], np.float64)
        box += self._rng.normal(0, 1, 4) * self._errors.box_jitter * [w, h, w, h]
        clipped: FloatArray = np.clip(box, 0, [width, height, width, height])
        return clipped


def _hill(x: float, half: float, steepness: float) -> float:
    """0 at x = 0, 1/2 at x = `half`, towards 1 beyond; 1 everywhere when `half` is 0 (Hill 1910)."""
    if half == 0:
        return 1.0
    return float(x**steepness / (x**steepness + half**steepness))
