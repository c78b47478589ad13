"""Masks of every kind: which of their pixels are the thing."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.foreground import foreground
from supermap_cli.mapping.mask_core import erode
from supermap_cli.types.detections import cut_mask
from support import scenes as s

Mask = NDArray[np.bool_]

LEGS = tuple(s.Thing("", (1.6 + x, y, 0.35), (0.04, 0.04, 0.7)) for x in (-0.15, 0.15) for y in (-0.15, 0.15))
STOOL = (s.Thing("stool", (1.6, 0, 0.72), (0.36, 0.36, 0.05)), *LEGS)
PICTURE = s.Thing("picture", (2.99, 0, 1.2), (0.02, 0.8, 0.6))
KEYBOARD = s.Thing("keyboard", (1.4, 0, 0.71), (0.15, 0.4, 0.02))


def kernel(px: int) -> NDArray[np.uint8]:
    return np.ones((2 * px + 1, 2 * px + 1), np.uint8)


def leaking(mask: Mask) -> Mask:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel(2)) > 0)


def eroded(mask: Mask) -> Mask:
    return np.asarray(cv2.erode(mask.astype(np.uint8), kernel(1)) > 0)


def hull(mask: Mask) -> Mask:
    v, u = np.nonzero(mask)
    corners = cv2.convexHull(np.column_stack([u, v]).astype(np.int32))
    return np.asarray(cv2.fillPoly(np.zeros(mask.shape, np.uint8), [corners], 1) > 0)


def box(mask: Mask) -> Mask:
    v, u = np.nonzero(mask)
    filled = np.zeros_like(mask)
    filled[v.min() : v.max() + 1, u.min() : u.max() + 1] = True
    return filled


def left_third_missing(mask: Mask) -> Mask:
    _, u = np.nonzero(mask)
    cut = mask.copy()
    cut[:, : int(np.percentile(u, 33))] = False
    return cut


KINDS = (np.copy, leaking, eroded, hull, box, left_third_missing)


def found(scene: s.Scene, mask: Mask, masked: Mask | None = None) -> Mask | None:
    """The foreground as an image; `None` where it is not told from what is around."""
    region = cut_mask(mask)
    assert region is not None
    core = erode(region.pixels, 1)
    own = foreground(depth_view(scene.keyframe, 6.0), region, lambda: core, mask if masked is None else masked).region
    if own is None:
        return None
    image = np.zeros(mask.shape, dtype=bool)
    image[own.window] = own.pixels
    return image


def owned(scene: s.Scene, first: int, last: int) -> Mask:
    mask: Mask = (scene.owner >= first) & (scene.owner <= last)
    return mask


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@settings(max_examples=15, deadline=None)
@given(side_m=st.floats(-0.8, 0.8), height_m=st.floats(0.9, 1.6))
def test_of_any_mask_of_a_thing_on_the_floor_its_own_pixels_are_found(
    kind: Callable[[Mask], Mask], side_m: float, height_m: float
) -> None:
    scene = s.render((*s.ROOM, s.BOX), s.looking((0, side_m, height_m), (1.6, 0, 0.3)))
    true = scene.mask(2)
    pixels = found(scene, kind(true))
    assert pixels is not None
    least = 0.4 if kind is left_third_missing else 0.8
    assert (pixels & true).sum() > 0.95 * pixels.sum()
    assert (pixels & true).sum() > least * true.sum()


@pytest.mark.parametrize("kind", [np.copy, leaking, hull, box], ids=lambda kind: kind.__name__)
def test_the_floor_between_the_legs_of_a_stool_is_not_the_stool(kind: Callable[[Mask], Mask]) -> None:
    scene = s.render((*s.ROOM, *STOOL), s.looking((0.2, 0.4, 1.2), (1.6, 0, 0.4)))
    true = owned(scene, 2, 6)
    pixels = found(scene, kind(true))
    assert pixels is not None
    assert (pixels & true).sum() > 0.9 * pixels.sum()
    assert (pixels & true).sum() > 0.75 * true.sum()


def test_what_is_flat_on_a_surface_is_left_to_its_mask() -> None:
    scene = s.render((*s.ROOM, s.TABLE, PICTURE), s.looking((0, 0, 1.4), PICTURE.center))
    assert found(scene, scene.mask(3)) is None


def test_what_is_nearly_flat_is_itself_or_left_to_its_mask() -> None:
    scene = s.render((*s.ROOM, s.TABLE, KEYBOARD), s.looking((0, 0, 1.4), KEYBOARD.center))
    pixels = found(scene, leaking(scene.mask(3)))
    assert pixels is None or (pixels & scene.mask(3)).sum() > 0.9 * pixels.sum()


def test_what_another_mask_covers_is_not_the_surroundings() -> None:
    """Two cabinets side by side: the front of the one is no plane that goes on under the other."""
    cabinets = [s.Thing("cabinet", (2.0, y, 0.5), (0.5, 0.6, 1.0)) for y in (-0.3, 0.3)]
    scene = s.render((*s.ROOM, *cabinets), s.looking((0, 0, 1.2), (2.0, 0, 0.5)))
    first, second = scene.mask(2), scene.mask(3)
    pixels = found(scene, first, first | second)
    assert pixels is not None
    assert (pixels & first).sum() > 0.8 * first.sum()
    assert (pixels & ~first).sum() < 0.1 * first.sum()


def test_a_mask_without_depth_says_nothing() -> None:
    scene = s.render((), s.looking((0, 0, 1.2), (1.6, 0, 0.4)))
    mask = np.zeros(scene.owner.shape, dtype=bool)
    mask[40:60, 40:60] = True
    assert found(scene, mask) is None
