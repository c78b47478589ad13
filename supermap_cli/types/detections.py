"""Detections of one image, their masks, and tracks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, IntArray, check_shape
from supermap_cli.types.labels import plain_label
from supermap_cli.types.sensing import MAIN_CAMERA


@dataclass(frozen=True)
class Hypothesis:
    """A label that a detector considers, with its score in [0, 1]."""

    label: str
    score: float


@dataclass(frozen=True)
class RegionMask:
    """An instance mask cut to its region: `pixels` is (h, w) bool, its upper left corner is pixel (`u0`, `v0`)."""

    u0: int
    v0: int
    pixels: BoolArray

    @property
    def window(self) -> tuple[slice, slice]:
        """The rows and columns of the image that the region covers."""
        h, w = self.pixels.shape
        return slice(self.v0, self.v0 + h), slice(self.u0, self.u0 + w)

    def full(self, height: int, width: int) -> BoolArray:
        """The mask on the whole image, (height, width) bool."""
        mask = np.zeros((height, width), dtype=bool)
        h, w = self.pixels.shape
        mask[self.v0 : self.v0 + h, self.u0 : self.u0 + w] = self.pixels
        return mask


def cut_mask(mask: BoolArray) -> RegionMask | None:
    """Cut a full-image mask to the region it covers; `None` for an empty one."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    v0, u0 = int(rows[0]), int(columns[0])
    return RegionMask(u0, v0, mask[v0 : int(rows[-1]) + 1, u0 : int(columns[-1]) + 1].copy())


@dataclass(frozen=True)
class Detections:
    """The detections of one image as a struct of arrays, n of them.

    `boxes_xyxy` is (n, 4) float32 pixels; `scores` is (n,) float32, the best hypothesis's; `hypotheses` holds, for each
    detection, all labels considered, best first, never empty; `masks` holds one `RegionMask` or `None` each.
    `stamp_ns` and `camera_id` are the image's. `embeddings` (n, d) float32, unit length, describe what each shows;
    `None` where the detector gives none.
    """

    stamp_ns: int
    boxes_xyxy: Float32Array
    scores: Float32Array
    hypotheses: tuple[tuple[Hypothesis, ...], ...]
    masks: tuple[RegionMask | None, ...]
    camera_id: str = MAIN_CAMERA
    embeddings: Float32Array | None = None

    def __post_init__(self) -> None:
        n = len(self.boxes_xyxy)
        check_shape("boxes_xyxy", self.boxes_xyxy, (n, 4))
        check_shape("scores", self.scores, (n,))
        if len(self.hypotheses) != n or len(self.masks) != n:
            raise ValueError(f"expected {n} hypotheses and masks, got {len(self.hypotheses)} and {len(self.masks)}")
        if not all(self.hypotheses):
            raise ValueError("every detection needs at least one label hypothesis")
        if self.embeddings is not None:
            check_shape("embeddings", self.embeddings, (n, None))

    def __len__(self) -> int:
        return len(self.scores)

    @property
    def labels(self) -> tuple[str, ...]:
        """The best label of each detection."""
        return tuple(labels[0].label for labels in self.hypotheses)

    def take(self, chosen: IntArray | BoolArray) -> Detections:
        """The chosen detections, by index or by a boolean mask."""
        indices = np.flatnonzero(chosen) if chosen.dtype == bool else chosen
        return Detections(
            self.stamp_ns,
            self.boxes_xyxy[indices],
            self.scores[indices],
            tuple(self.hypotheses[i] for i in indices),
            tuple(self.masks[i] for i in indices),
            self.camera_id,
            None if self.embeddings is None else self.embeddings[indices],
        )

    def with_masks(self, masks: tuple[RegionMask | None, ...]) -> Detections:
        """The same detections with other masks."""
        return replace(self, masks=masks)


def plain_hypotheses(hypotheses: Iterable[Hypothesis]) -> tuple[Hypothesis, ...]:
    """The hypotheses, best first, with each label as `plain_label` spells it, once; empty ones are left out."""
    best: dict[str, Hypothesis] = {}
    for each in sorted(hypotheses, key=lambda each: -each.score):
        label = plain_label(each.label)
        if label:
            best.setdefault(label, each if label == each.label else replace(each, label=label))
    return tuple(best.values())


def plainly_labelled(detections: Detections) -> Detections:
    """The detections with plain labels, without those of no label; themselves where that is so already."""
    plain = tuple(plain_hypotheses(ranked) for ranked in detections.hypotheses)
    if plain == detections.hypotheses:
        return detections
    named = np.array([bool(ranked) for ranked in plain], bool)
    spelled = tuple(new or old for new, old in zip(plain, detections.hypotheses, strict=True))
    return replace(detections, hypotheses=spelled).take(named)


def no_detections(stamp_ns: int, camera_id: str = MAIN_CAMERA) -> Detections:
    """The detections of an image without any; evidence of absence, unlike no image."""
    return Detections(stamp_ns, np.zeros((0, 4), np.float32), np.zeros(0, np.float32), (), (), camera_id)


@dataclass(frozen=True)
class TrackPrior:
    """Where the map expects a tracked object in the coming image (SuperMap, hybrid state: c = pi(K T_CW X)).

    `box_xyxy` is (4,) float32, the object's projected 3D box; `hidden`: it is occluded, so that a
    missing detection is no evidence and the track is kept.
    """

    track_id: int
    box_xyxy: Float32Array
    label: str
    hidden: bool

    def __post_init__(self) -> None:
        check_shape("box_xyxy", self.box_xyxy, (4,))


@dataclass(frozen=True)
class Tracks:
    """The tracker's answer: `track_ids` is (n,) int64 for the n detections of an image, -1 = no track."""

    track_ids: IntArray


def joined_masks(first: RegionMask, second: RegionMask) -> RegionMask:
    """The mask that covers both."""
    u0, v0 = min(first.u0, second.u0), min(first.v0, second.v0)
    u1 = max(mask.u0 + mask.pixels.shape[1] for mask in (first, second))
    v1 = max(mask.v0 + mask.pixels.shape[0] for mask in (first, second))
    pixels = np.zeros((v1 - v0, u1 - u0), bool)
    for mask in (first, second):
        h, w = mask.pixels.shape
        pixels[mask.v0 - v0 : mask.v0 - v0 + h, mask.u0 - u0 : mask.u0 - u0 + w] |= mask.pixels
    return RegionMask(u0, v0, pixels)
