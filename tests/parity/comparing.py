"""How far two answers to one image are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Difference:
    """`boxes_px` and `scores` are the largest differences, `labels` how many labels differ, `mask_iou` the least
    overlap of two masks; `boxes` and `masks` how many were compared.
    """

    boxes: int
    boxes_px: float
    scores: float
    labels: int
    masks: int = 0
    mask_iou: float = 1.0

    def check(self) -> None:
        """The bounds that an implementation of the same network has to keep."""
        assert self.boxes or self.masks
        assert self.boxes_px <= 1e-3
        assert self.scores <= 1e-4
        assert self.labels == 0
        assert self.mask_iou >= 0.999


def compare(
    ours: tuple[NDArray[np.float32], NDArray[np.float32], list[str]],
    theirs: tuple[NDArray[np.float32], NDArray[np.float32], list[str]],
) -> Difference:
    """Boxes (n, 4), scores (n,) and labels of both, in one order."""
    assert len(ours[0]) == len(theirs[0]), (len(ours[0]), len(theirs[0]))
    if not len(ours[0]):
        return Difference(0, 0.0, 0.0, 0)
    return Difference(
        len(ours[0]),
        float(np.abs(ours[0] - theirs[0]).max()),
        float(np.abs(ours[1] - theirs[1]).max()),
        sum(one != other for one, other in zip(ours[2], theirs[2], strict=True)),
    )


def mask_overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """IoU of two masks; 1 for two empty ones."""
    union = int((one | other).sum())
    return 1.0 if union == 0 else int((one & other).sum()) / union


def together(differences: list[Difference]) -> Difference:
    """The largest of all."""
    return Difference(
        sum(each.boxes for each in differences),
        max(each.boxes_px for each in differences),
        max(each.scores for each in differences),
        sum(each.labels for each in differences),
        sum(each.masks for each in differences),
        min(each.mask_iou for each in differences),
    )


def picture(seed: int, height: int = 96, width: int = 150) -> NDArray[np.uint8]:
    """An image with edges, gradients and noise."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:height, :width]
    image = np.stack([rows * 255 // height, columns * 255 // width, (rows + columns) % 256], axis=2)
    for _ in range(6):
        top, left = rng.integers(0, height - 10), rng.integers(0, width - 10)
        image[top : top + rng.integers(8, 40), left : left + rng.integers(8, 60)] = rng.integers(0, 256, 3)
    return np.clip(image + rng.normal(0, 8, image.shape), 0, 255).astype(np.uint8)
