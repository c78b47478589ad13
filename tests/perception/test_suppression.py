"""Non-maximum suppression and the letterbox."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import pairwise_iou
from supermap_cli.geometry.suppression import suppress
from supermap_onnx.letterbox import fit_letterbox


def boxes(*rows: tuple[float, float, float, float]) -> np.ndarray:
    return np.array(rows, np.float32).reshape(-1, 4)


def scores(*rows: tuple[float, ...]) -> np.ndarray:
    return np.array(rows, np.float32).reshape(-1, 2)


def test_nothing_in_nothing_out() -> None:
    assert len(suppress(boxes(), scores(), 0.5, 10).index) == 0


@pytest.mark.parametrize(
    ("b", "expected"),
    [((0, 0, 10, 10), 1.0), ((5, 0, 15, 10), 1 / 3), ((10, 0, 20, 10), 0.0), ((3, 3, 3, 9), 0.0)],
)
def test_intersection_over_union(b: tuple[float, float, float, float], expected: float) -> None:
    assert pairwise_iou(boxes((0, 0, 10, 10)), boxes(b))[0, 0] == pytest.approx(expected)


def test_the_weaker_of_two_overlapping_boxes_of_a_class_goes() -> None:
    kept = suppress(
        boxes((0, 0, 10, 10), (0, 0, 10, 13), (20, 0, 30, 10)), scores((0.5, 0), (0.7, 0), (0.6, 0)), 0.5, 9
    )
    assert kept.index.tolist() == [1, 2]


def test_overlapping_boxes_of_different_classes_stay() -> None:
    kept = suppress(boxes((0, 0, 10, 10), (0, 0, 10, 14)), scores((0.5, 0), (0, 0.7)), 0.5, 9)
    assert kept.index.tolist() == [1, 0]


def test_the_same_box_of_two_classes_becomes_one_with_both_scores() -> None:
    kept = suppress(boxes((0, 0, 10, 10), (0, 0, 10, 10.5)), scores((0.5, 0), (0, 0.7)), 0.5, 9)
    assert kept.index.tolist() == [1]
    np.testing.assert_allclose(kept.class_scores, [[0.5, 0.7]])


def test_no_more_than_asked_for() -> None:
    apart = boxes(*((20 * i, 0, 20 * i + 10, 10) for i in range(5)))
    kept = suppress(apart, scores(*((0.1 * (i + 1), 0) for i in range(5))), 0.5, 2)
    assert kept.index.tolist() == [4, 3]


@given(st.integers(1, 900), st.integers(1, 900), st.booleans(), st.floats(0, 1), st.floats(0, 1))
def test_the_letterbox_is_undone(width: int, height: int, centred: bool, share_u: float, share_v: float) -> None:
    letterbox = fit_letterbox((height, width), (416, 640), centred=centred)
    u, v = share_u * width, share_v * height
    on_input = np.array([[u, v, u, v]]) * letterbox.scale + np.tile([letterbox.left, letterbox.top], 2)
    np.testing.assert_allclose(letterbox.to_image(on_input), [[u, v, u, v]], atol=1e-2)
    assert letterbox.paste(np.zeros((height, width, 3), np.uint8)).shape == (416, 640, 3)
