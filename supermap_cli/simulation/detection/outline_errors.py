"""Outlines that are wrong in one way in every image, whatever the thing's size: moved, closed, convex, cut, or none."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import BoolArray
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.detection.mask_errors import enlarged, signed_distance_px, tight
from supermap_cli.types.detections import RegionMask

_REFERENCE_WIDTH_PX = 640  # the images of which widths are given: what YOLO-like networks scale an image to
_CUT_SHARE = 1 / 3  # of a mask


class OutlineErrors:
    """Applies the errors that are asked for, one after the other; draws nothing where none is."""

    def __init__(self, errors: DetectorErrors, rng: np.random.Generator) -> None:
        self._errors = errors
        self._rng = rng

    def drawn(self, mask: RegionMask, height: int, width: int) -> RegionMask | None:
        """The mask as it is reported; `None` for a detection that comes with its box alone."""
        errors, scale = self._errors, width / _REFERENCE_WIDTH_PX
        if errors.outline_px:
            mask = moved(mask, errors.outline_px * scale, height, width)
        if errors.closing_px:
            mask = closed(mask, errors.closing_px * scale, height, width)
        if self._happens(errors.hulls):
            mask = convex_hull(mask)
        if self._happens(errors.cuts):
            mask = without_a_side(mask, self._rng)
        return None if self._happens(errors.maskless) else mask

    def _happens(self, share: float) -> bool:
        return share > 0 and self._rng.random() < share


def moved(mask: RegionMask, outwards_px: float, height: int, width: int) -> RegionMask:
    """The mask with its outline moved outwards (inwards, if negative); of what would vanish the innermost pixels."""
    canvas = enlarged(mask, 2 + int(np.ceil(max(outwards_px, 0))), height, width)
    within_px = signed_distance_px(canvas.pixels)
    kept = within_px > min(-outwards_px, float(within_px.max()) - 0.5)
    return tight(RegionMask(canvas.u0, canvas.v0, kept)) or mask


def closed(mask: RegionMask, gap_px: float, height: int, width: int) -> RegionMask:
    """The mask without gaps up to so wide (closing with a disc) and without holes of any size."""
    import cv2  # noqa: PLC0415 - keeps start-up light
    from scipy.ndimage import binary_fill_holes  # noqa: PLC0415

    side = 2 * round((gap_px - 1) / 2) + 1
    canvas = enlarged(mask, side, height, width)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    filled = cv2.morphologyEx(canvas.pixels.view(np.uint8), cv2.MORPH_CLOSE, disc)
    pixels: BoolArray = np.asarray(binary_fill_holes(filled), bool)
    return tight(RegionMask(canvas.u0, canvas.v0, pixels)) or mask


def convex_hull(mask: RegionMask) -> RegionMask:
    """All that lies between two pixels of the mask."""
    import cv2  # noqa: PLC0415

    v, u = np.nonzero(mask.pixels)
    outline = cv2.convexHull(np.column_stack([u, v]).astype(np.int32))
    pixels = np.zeros(mask.pixels.shape, np.uint8)
    cv2.fillConvexPoly(pixels, outline, (1,))
    return RegionMask(mask.u0, mask.v0, pixels.view(bool) | mask.pixels)


def without_a_side(mask: RegionMask, rng: np.random.Generator) -> RegionMask:
    """The mask without the third of its pixels that lies farthest in a random direction."""
    v, u = np.nonzero(mask.pixels)
    angle = rng.uniform(0, 2 * np.pi)
    along = u * np.cos(angle) + v * np.sin(angle)
    kept = np.argsort(along, kind="stable")[: max(round(len(along) * (1 - _CUT_SHARE)), 1)]
    pixels = np.zeros_like(mask.pixels)
    pixels[v[kept], u[kept]] = True
    return tight(RegionMask(mask.u0, mask.v0, pixels)) or mask
