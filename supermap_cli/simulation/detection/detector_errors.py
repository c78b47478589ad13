"""How a simulated detector errs: every knob with its default and where that comes from."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from supermap_cli.config import Section


class DetectorErrors(Section):
    """The error model of an instance segmenter of YOLO's class on a robot's images of rooms.

    The kinds of error are those of Hoiem, Chodpathumwan and Dai (2012) and of TIDE (Bolya et al. 2020): missed, wrong
    label, badly localised, background. Near, unoccluded things are found in 80 to 95 of 100 images; the rate falls with
    distance, with what hides the thing, and with its area in the image (COCO's small objects, below 32 x 32 pixels, are
    found about half as well as its large ones). Errors of neighbouring images are
    correlated (`detection.correlated_noise`), so that more images of the same view do not average them out. Pixels are
    those of the image, whatever its size.
    """

    recall: float = Field(default=0.95, ge=0, le=1, description="share of large, near, unoccluded things that is found")
    class_spread: float = Field(default=0.0, ge=0, le=1, description="most that a class's own recall is lower")
    half_distance_m: float = Field(default=7.0, gt=0, le=1e6, description="distance at which recall has halved")
    half_visible: float = Field(default=0.22, ge=0, le=1, description="visible share of a thing that halves recall")
    half_area_px: float = Field(default=110.0, ge=0, le=1e6, description="area in the image that halves recall")
    min_area_px: int = Field(default=60, ge=1, le=100_000, description="smaller regions are never found")
    lasting_s: float = Field(default=1.5, gt=0, le=600, description="how long a miss or a wrong label mostly lasts")
    lasting: float = Field(default=0.6, ge=0, le=1, description="share of the errors' variance that lasts so long")
    constant: float = Field(default=0.1, ge=0, le=1, description="share that one thing keeps for the whole run")

    confusion: float = Field(
        default=0.07, ge=0, le=1, description="share of detections with a look-alike's label first"
    )
    wrong_words: int = Field(
        default=0,
        ge=0,
        le=30,
        description="wrong labels that each thing has for good; 0: look-alikes, where hard to see",
    )
    wrong_score: float = Field(
        default=0.85, ge=0, le=1, description="score of a wrong label, as a share of a right one's"
    )
    synonyms: float = Field(default=0.0, ge=0, le=1, description="share of detections with a synonym first")
    best_score: float = Field(default=0.92, gt=0, le=1, description="mean score where recall is best")
    worst_score: float = Field(default=0.35, gt=0, le=1, description="mean score where recall is near zero")
    score_noise: float = Field(default=0.06, ge=0, le=1, description="standard deviation of scores")
    min_score: float = Field(default=0.15, gt=0, le=1, description="no score is lower")
    hypotheses: int = Field(default=3, ge=1, le=10, description="labels with scores that each detection gives")

    false_positives: float = Field(default=0.1, ge=0, le=100, description="random false detections an image, mean")
    phantoms_per_m2: float = Field(
        default=0.015, ge=0, le=10, description="spots on walls, floors and the like that look like some thing"
    )
    phantom_recall: float = Field(default=0.3, ge=0, le=1, description="share of the views of such a spot that fool")
    posters: int = Field(
        default=0, ge=0, le=20, description="pictures on the walls, for each 20 m2 of floor, that are taken for things"
    )
    poster_recall: float = Field(default=0.7, ge=0, le=1, description="share of the views of such a picture that fool")

    box_jitter: float = Field(default=0.015, ge=0, le=1, description="sigma of a box's edges, as a share of its side")
    bleeding: float = Field(default=0.75, ge=0, le=1, description="share of masks that are too large; the rest is cut")
    bleeding_px: float = Field(default=3.0, ge=0, le=50, description="most that a mask goes beyond the thing's outline")
    erosion_px: float = Field(default=2.0, ge=0, le=50, description="most that a mask stays within it")
    wobble_px: float = Field(default=0.8, ge=0, le=50, description="how uneven the outline is, standard deviation")
    patches: float = Field(default=0.12, ge=0, le=1, description="share of masks with a patch of their surroundings")
    outline_px: float = Field(
        default=0.0, ge=-50, le=50, description="how far all outlines lie outside (inside: < 0), of 640 px of width"
    )
    closing_px: float = Field(
        default=0.0, ge=0, le=200, description="gaps of masks up to so wide are filled, of 640 px; holes too"
    )
    hulls: float = Field(default=0.0, ge=0, le=1, description="share of masks that are their convex hull")
    cuts: float = Field(default=0.0, ge=0, le=1, description="share of masks that lack a third, at a random side")
    maskless: float = Field(default=0.0, ge=0, le=1, description="share of detections with a box but no mask")
    merging: float = Field(default=0.06, ge=0, le=1, description="share of touching things of one label found as one")
    swallowing: float = Field(
        default=0.01, ge=0, le=1, description="share of touching things of two labels found as one"
    )
    splitting: float = Field(default=0.025, ge=0, le=1, description="share of things found as two parts")
    splitting_area_px: int = Field(default=1500, ge=2, le=10_000_000, description="smaller things are not split")

    latency_min_s: float = Field(default=0.1, ge=0, le=60, description="an answer takes at least so long")
    latency_max_s: float = Field(default=0.5, ge=0, le=60, description="and at most so long")

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if self.latency_min_s > self.latency_max_s:
            raise ValueError("latency_min_s is greater than latency_max_s")
        if self.lasting + self.constant > 1:
            raise ValueError("lasting and constant are shares of one whole: their sum is at most 1")
        return self

    @classmethod
    def perfect(cls) -> Self:
        """A detector that finds everything at once, with exact masks and labels and a score of 0.99."""
        return cls(
            recall=1,
            half_distance_m=1e6,
            half_visible=0,
            half_area_px=0,
            min_area_px=1,
            confusion=0,
            best_score=0.99,
            worst_score=0.99,
            score_noise=0,
            hypotheses=1,
            false_positives=0,
            phantoms_per_m2=0,
            box_jitter=0,
            bleeding=0,
            bleeding_px=0,
            erosion_px=0,
            wobble_px=0,
            patches=0,
            merging=0,
            swallowing=0,
            splitting=0,
            latency_min_s=0,
            latency_max_s=0,
        )
