"""Which of two masks that cover one pixel has it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.mapping.mask_overlap import without_smaller
from supermap_cli.types.detections import RegionMask


def square(u0: int, v0: int, side: int) -> RegionMask:
    return RegionMask(u0, v0, np.ones((side, side), bool))


def pixels(mask: RegionMask | None) -> NDArray[np.bool_]:
    assert mask is not None
    return mask.full(60, 60)


def test_the_cup_is_taken_out_of_the_tables_mask() -> None:
    table, cup = without_smaller([square(0, 0, 40), square(10, 10, 5)], ("table", "cup"))
    assert pixels(table).sum() == 40 * 40 - 5 * 5
    assert not (pixels(table) & pixels(cup)).any()


def test_only_the_part_that_lies_in_the_mask_is_taken_out() -> None:
    table, _ = without_smaller([square(10, 10, 20), square(7, 7, 5)], ("table", "cup"))
    assert pixels(table).sum() == 20 * 20 - 2 * 2


@pytest.mark.parametrize(
    ("labels", "side"), [(("cup", "cup"), 5), (("table", "cup"), 39)], ids=["same label", "nearly as large"]
)
def test_masks_of_the_same_label_or_size_are_left_alone(labels: tuple[str, str], side: int) -> None:
    table, _ = without_smaller([square(0, 0, 40), square(10, 10, side)], labels)
    assert pixels(table).sum() == 40 * 40


def test_detections_without_masks_stay_without() -> None:
    assert without_smaller([], ()) == []
    assert without_smaller([None, None], ("a", "b")) == [None, None]
