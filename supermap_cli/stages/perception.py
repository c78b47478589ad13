"""A detector's answers, every detection with a mask where one can be told (paper: GenerateMasks)."""

from __future__ import annotations

from supermap_cli.errors import DetectorError
from supermap_cli.protocols import Segmenter
from supermap_cli.stages.checked_answers import checked_masks
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame


def generate_masks(segmenter: Segmenter | None, frame: CameraFrame, detections: Detections) -> Detections:
    """Masks for the boxes that came without; those that came with one keep it. Without a segmenter nothing changes.

    Raises `DetectorError` for a mask beyond the image, `PluginError` for a segmenter's answer that is none.
    """
    _within_the_image(frame, detections)
    if segmenter is None or all(mask is not None for mask in detections.masks):
        return detections
    masks = checked_masks(segmenter.segment(frame, detections), segmenter, len(detections))
    return _within_the_image(frame, detections.with_masks(masks))


def _within_the_image(frame: CameraFrame, detections: Detections) -> Detections:
    width, height = frame.camera.width, frame.camera.height
    for mask in detections.masks:
        if mask is None:
            continue
        h, w = mask.pixels.shape
        if mask.u0 < 0 or mask.v0 < 0 or mask.u0 + w > width or mask.v0 + h > height:
            raise DetectorError(
                f"a mask reaches beyond the image: {w} x {h} pixels at ({mask.u0}, {mask.v0}), the image has {width} x "
                f"{height}, at {frame.stamp_ns} ns",
                cure="cut masks to the image",
            )
    return detections
