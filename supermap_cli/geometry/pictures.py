"""Decodes the pictures that a map keeps: whatever bytes are stored there, pixels come out, or nothing."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import UInt8Array, UInt16Array
from supermap_cli.geometry.image_header import image_size

_MOST_PIXELS = 1 << 24
"""Of a stored picture (16 megapixels): those that a build stores have less than one. A PNG of some kB could else take
the memory of a machine.
"""


def decode_bgr(content: bytes) -> UInt8Array | None:
    """(h, w, 3) uint8 BGR of a JPEG or PNG; `None` for anything else."""
    pixels = _decoded(content, cv2.IMREAD_COLOR)
    return None if pixels is None else np.asarray(pixels, np.uint8)


def decode_grey16(content: bytes) -> UInt16Array | None:
    """(h, w) uint16 of a 16-bit grey PNG; `None` for anything else."""
    pixels = _decoded(content, cv2.IMREAD_UNCHANGED)
    return pixels if pixels is not None and pixels.ndim == 2 and pixels.dtype == np.uint16 else None


def _decoded(content: bytes, flags: int) -> NDArray[Any] | None:
    size = image_size(content)
    if size is None or not 0 < size[0] * size[1] <= _MOST_PIXELS:
        return None
    try:
        return cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        return None
