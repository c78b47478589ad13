"""Finds connected areas of a strong red."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.sensing import CameraFrame
from supermap_example_detector import RedOptions

_HUE_TOLERANCE = 8
_LEAST_BRIGHTNESS = 60


class RedDetector:
    """A `supermap_cli.protocols.Detector`."""

    def __init__(self, options: RedOptions) -> None:
        self._options = options

    def image_stamps_ns(self, camera_id: str) -> None:
        """It can look at any image."""

    def detect(self, frame: CameraFrame) -> Detections:
        """One detection for each red area; its score is the mean saturation."""
        hue, saturation, brightness = cv2.split(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2HSV))
        reddish = np.minimum(hue, 180 - hue) <= _HUE_TOLERANCE
        red = reddish & (saturation >= self._options.min_saturation) & (brightness >= _LEAST_BRIGHTNESS)
        _, areas, stats, _ = cv2.connectedComponentsWithStats(red.astype(np.uint8))
        boxes, scores, masks = [], [], []
        for number, (u0, v0, width, height, size) in enumerate(stats.tolist()):
            if number == 0 or size < self._options.min_area_px:  # 0 is all that is not red
                continue
            region = np.s_[v0 : v0 + height, u0 : u0 + width]
            pixels = areas[region] == number
            boxes.append((u0, v0, u0 + width, v0 + height))
            scores.append(saturation[region][pixels].mean() / 255)
            masks.append(RegionMask(u0, v0, pixels))
        return Detections(
            stamp_ns=frame.stamp_ns,
            boxes_xyxy=np.array(boxes, np.float32).reshape(-1, 4),
            scores=np.array(scores, np.float32),
            hypotheses=tuple((Hypothesis(self._options.label, float(score)),) for score in scores),
            masks=tuple(masks),
        )
