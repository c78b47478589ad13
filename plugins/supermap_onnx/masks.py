"""Instance masks from prototypes (YOLACT, Bolya et al. 2019), each decoded only inside its own box."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.types.detections import RegionMask
from supermap_onnx.letterbox import Letterbox


def decode_masks(
    boxes_xyxy: Float32Array, coefficients: Float32Array, prototypes: Float32Array, letterbox: Letterbox
) -> tuple[RegionMask | None, ...]:
    """A mask at image resolution for each of the image's `boxes_xyxy`; `None` where it came out empty.

    A pixel belongs to the object where sum_k coefficient_k prototype_k > 0, i.e. its sigmoid is over one half.
    """
    if not prototypes.size:
        return (None,) * len(boxes_xyxy)
    return tuple(_decode(box, row, prototypes, letterbox) for box, row in zip(boxes_xyxy, coefficients, strict=True))


def _decode(
    box_xyxy: Float32Array, coefficients: Float32Array, prototypes: Float32Array, letterbox: Letterbox
) -> RegionMask | None:
    height, width = letterbox.image_size
    u0, v0 = int(box_xyxy[0]), int(box_xyxy[1])
    u1, v1 = min(int(np.ceil(box_xyxy[2])), width), min(int(np.ceil(box_xyxy[3])), height)
    if u1 <= u0 or v1 <= v0:
        return None
    rows, columns = prototypes.shape[1:]
    stride_x, stride_y = letterbox.input_size[1] / columns, letterbox.input_size[0] / rows
    gain_x, gain_y = letterbox.scale / stride_x, letterbox.scale / stride_y
    # the prototype cell under the centre of the pixel (u0, v0)
    first_x = (u0 + 0.5) * gain_x + letterbox.left / stride_x - 0.5
    first_y = (v0 + 0.5) * gain_y + letterbox.top / stride_y - 0.5
    x0, y0 = max(int(first_x), 0), max(int(first_y), 0)
    x1 = min(int(first_x + (u1 - u0) * gain_x) + 2, columns)
    y1 = min(int(first_y + (v1 - v0) * gain_y) + 2, rows)
    logits = np.tensordot(coefficients, prototypes[:, y0:y1, x0:x1], axes=1)
    cells_of_pixels = np.array([[gain_x, 0, first_x - x0], [0, gain_y, first_y - y0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    resized = cv2.warpAffine(logits, cells_of_pixels, (u1 - u0, v1 - v0), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    pixels = resized > 0
    return RegionMask(u0, v0, pixels) if pixels.any() else None
