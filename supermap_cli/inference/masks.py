"""Masks from the logits of a network."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array


def full_mask(logits: Float32Array, size: tuple[int, int]) -> BoolArray:
    """A mask of (height, width) pixels from logits (h, w) over the whole image, bilinear between their cells' centres:
    a pixel belongs to the object where they are over 0, i.e. their sigmoid is over one half.
    """
    height, width = size
    return np.asarray(cv2.resize(np.asarray(logits, np.float32), (width, height), interpolation=cv2.INTER_LINEAR) > 0)
