"""Axes of the detector: recall, false alarms, labels, masks, touching things, rate, latency.

Lengths in the image are for images 640 px wide, to which YOLO-like networks scale what they get, and grow with the
width. Why the levels are as large as they are:

- Recall of 0.95 to 0.3: the AP of one network on COCO differs between its classes, and between large and small things,
  by a factor of two to three; half-distance 3 m is a room's other side.
- A poster of a thing fools in 60 to 80 % of its views: it has the thing's look, and all views of it look alike.
- Masks: prototypes of YOLACT and YOLO have a quarter of the input's resolution, so that a pixel of theirs is 4 px wide;
  6 px are one and a half of it, 4.8 px (3 px of 400) a little more than one. A gap is lost below four to five (18 px of
  640, 9 px of 320).
- Answers after 1 to 3 s: large open-vocabulary detectors on a robot's computer, or a network elsewhere.
"""

from __future__ import annotations

from dataclasses import replace

from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.domains.domain import Axis, Domain, Level, usual_level

_EXACT_MASKS: dict[str, float] = {"bleeding": 0, "bleeding_px": 0, "erosion_px": 0, "wobble_px": 0, "patches": 0}


def _errors(text: str, **knobs: float) -> Level:
    """A level that sets errors of the detector."""

    def apply(domain: Domain) -> Domain:
        return replace(domain, errors=DetectorErrors.model_validate(domain.errors.model_dump() | knobs))

    return Level(text, apply)


def _masks(text: str, **knobs: float) -> Level:
    """A level of masks that are wrong in this way only."""
    return _errors(text, **(_EXACT_MASKS | knobs))


def _every(count: int, text: str) -> Level:
    """A level whose detector gets only some of the images that the rig would give it."""

    def apply(domain: Domain) -> Domain:
        return replace(domain, rig=replace(domain.rig, detection_every=domain.rig.detection_every * count))

    return Level(text, apply)


RECALL = Axis(
    "recall",
    "share of large, near, unoccluded things that is found",
    "usual",
    {
        "usual": usual_level("0.95"),
        "0.7": _errors("0.7", recall=0.7),
        "0.5": _errors("0.5", recall=0.5),
        "0.3": _errors("0.3", recall=0.3),
        "by-class": _errors("each class has its own, from 0.3 to 0.95", recall=0.95, class_spread=0.65),
        "by-distance": _errors("half as large at 3 m", half_distance_m=3.0),
    },
)
FALSE_ALARMS = Axis(
    "false-alarms",
    "detections of what is not there",
    "usual",
    {
        "usual": usual_level("0.1 an image, and a few spots that fool in 30 % of their views"),
        "rare": _errors("none", false_positives=0, phantoms_per_m2=0),
        "many": _errors("1.5 an image", false_positives=1.5),
        "persistent": _errors(
            "3 posters of things for each 20 m2 of floor that fool in 60 to 80 % of their views",
            posters=3,
            poster_recall=0.7,
        ),
    },
)
LABELS = Axis(
    "labels",
    "what detections are called",
    "usual",
    {
        "usual": usual_level("7 % are called a look-alike; 3 labels with scores each"),
        "two-words": _errors(
            "40 % are called one wrong word, always the same for a thing; one label each",
            confusion=0.4,
            wrong_words=1,
            hypotheses=1,
        ),
        "twelve-words": _errors(
            "45 % are called one of 12 wrong words; one label each", confusion=0.45, wrong_words=12, hypotheses=1
        ),
        "synonyms": _errors("half have a synonym first (sofa) and the usual word (couch) second", synonyms=0.5),
        "flat-scores": _errors(
            "scores of about 0.5, right or wrong; one label each",
            best_score=0.5,
            worst_score=0.5,
            score_noise=0.02,
            wrong_score=1,
            hypotheses=1,
        ),
    },
)
MASKS = Axis(
    "masks",
    "outlines of what is found",
    "usual",
    {
        "usual": usual_level("up to 3 px too large or 2 px too small, uneven, some with a patch beside the thing"),
        "exact": _masks("no errors"),
        "eroded": _masks("4.8 px of 640 too small", outline_px=-4.8),
        "leaking": _masks("6 px of 640 too large, whatever the thing's size", outline_px=6.0),
        "filled": _masks("gaps up to 18 px of 640, and holes, belong to the thing", closing_px=18.0),
        "hull": _masks("convex hull", hulls=1.0),
        "boxes": _masks("boxes without masks", maskless=1.0),
        "cut": _masks("a third is missing, at another side in each image", cuts=1.0),
    },
)
TOUCHING = Axis(
    "touching",
    "one mask for neighbours, two for one thing",
    "usual",
    {
        "usual": usual_level("6 % of neighbours of one label and 1 % of others are found as one, 2.5 % as two"),
        "never": _errors("neighbours are never found as one", merging=0, swallowing=0),
        "often": _errors("35 % of neighbours of one label and 15 % of others", merging=0.35, swallowing=0.15),
        "split": _errors(
            "20 % of things from 20 x 20 px on are found as two parts", splitting=0.2, splitting_area_px=400
        ),
    },
)
DETECTOR_RATE = Axis(
    "detector-rate",
    "images that the detector gets",
    "usual",
    {
        "usual": usual_level("as many as the rig gives it"),
        "half": _every(2, "every second of them"),
        "fifth": _every(5, "every fifth of them"),
    },
)
LATENCY = Axis(
    "latency",
    "how long an answer takes",
    "usual",
    {
        "usual": usual_level("0.1 to 0.5 s"),
        "instant": _errors("0 s", latency_min_s=0, latency_max_s=0),
        "late": _errors("1 to 3 s", latency_min_s=1, latency_max_s=3),
    },
)

DETECTOR_AXES: tuple[Axis, ...] = (RECALL, FALSE_ALARMS, LABELS, MASKS, TOUCHING, DETECTOR_RATE, LATENCY)
