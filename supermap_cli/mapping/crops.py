"""The picture that is kept of an object as evidence; not in the paper."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class CropParameters:
    """When a picture is worth keeping. Its quality is the detection's score times the root of its area."""

    truncated_quality: float = parameter(0.5, "1", "factor of the quality where the image's border cuts it", TUNED)
    min_gain: float = parameter(1.5, "1", "quality by that of the best kept so far from which it is kept", TUNED)
    jpeg_quality: int = parameter(80, "1", "quality of the JPEG", "libjpeg's scale of 0 to 100", at_most=100)


DEFAULT = CropParameters()


def better_crop(
    keyframe: Keyframe,
    seen: MapObject,
    detection: LiftedDetection,
    longest_px: int,
    parameters: CropParameters = DEFAULT,
) -> bytes | None:
    """A small JPEG of the detection, where it shows the object clearly better than those kept before, no longer
    than `longest_px` on either side; `None` where it does not.
    """
    x0, y0, x1, y1 = (round(float(x)) for x in detection.box_xyxy)
    crop = keyframe.rgb[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1]
    quality = detection.score * float(np.sqrt(crop.shape[0] * crop.shape[1]))
    quality *= parameters.truncated_quality if detection.truncated else 1
    if crop.size == 0 or quality < parameters.min_gain * seen.best_crop:
        return None
    seen.best_crop = quality
    scale = min(1.0, longest_px / max(crop.shape[:2]))
    size = (max(1, round(crop.shape[1] * scale)), max(1, round(crop.shape[0] * scale)))
    small = cv2.resize(crop, size, interpolation=cv2.INTER_AREA)
    _, jpeg = cv2.imencode(".jpg", small[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, parameters.jpeg_quality])
    return jpeg.tobytes()
