"""Letterboxing: the image scaled to fit the network's input, the rest padded with grey."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import Float32Array, UInt8Array

PADDING_GREY = 114
"""Grey level of the padding, of 255 (YOLOX `preproc`, Ultralytics `LetterBox`)."""


@dataclass(frozen=True)
class Letterbox:
    """How an image of (height, width) lies on the network's input of `input_size` (height, width).

    A point (x, y) of the image, in pixels from its upper left corner, lies at `scale * (x, y) + (left, top)`.
    """

    image_size: tuple[int, int]
    input_size: tuple[int, int]
    scale: float
    left: int
    top: int

    def paste(self, rgb: UInt8Array) -> UInt8Array:
        """The padded image, (input height, input width, 3) uint8."""
        width, height = self._scaled_size()
        scaled = cv2.resize(rgb, (width, height), interpolation=cv2.INTER_LINEAR)
        canvas = np.full((*self.input_size, 3), PADDING_GREY, np.uint8)
        canvas[self.top : self.top + height, self.left : self.left + width] = scaled
        return canvas

    def to_image(self, boxes_xyxy: NDArray[np.floating]) -> Float32Array:
        """Boxes (n, 4) of the input -> boxes of the image, cut at its border."""
        height, width = self.image_size
        boxes = (boxes_xyxy - [self.left, self.top, self.left, self.top]) / self.scale
        return np.clip(boxes, 0, [width, height, width, height]).astype(np.float32)

    def _scaled_size(self) -> tuple[int, int]:
        height, width = self.image_size
        return max(1, round(width * self.scale)), max(1, round(height * self.scale))


def fit_letterbox(image_size: tuple[int, int], input_size: tuple[int, int], *, centred: bool) -> Letterbox:
    """Fit an image into the input: in the middle (Ultralytics) or in the upper left corner (YOLOX)."""
    scale = min(input_size[0] / image_size[0], input_size[1] / image_size[1])
    corner = Letterbox(image_size, input_size, scale, 0, 0)
    if not centred:
        return corner
    width, height = corner._scaled_size()
    left, top = (input_size[1] - width) // 2, (input_size[0] - height) // 2
    return Letterbox(image_size, input_size, scale, left, top)
