"""Images as input tensors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import DetectorError
from supermap_cli.inference.images import ImageFormat, middle, read_image_format, resized, shortest_edge_size

SIDES = st.integers(8, 4000)


@given(SIDES, SIDES, st.integers(16, 900), st.one_of(st.none(), st.integers(900, 1400)))
def test_the_shorter_side_is_as_asked_unless_the_longer_one_grew_too_long(
    height: int, width: int, shortest: int, longest: int | None
) -> None:
    made = shortest_edge_size((height, width), shortest, longest)
    if longest is not None and max(height, width) * shortest > longest * min(height, width):
        assert max(made) <= longest + max(height, width) / min(height, width)
    else:
        assert min(made) == shortest
    assert (made[0] <= made[1]) == (height <= width) or made[0] == made[1]


def test_the_usual_camera_image_becomes_800_by_1066() -> None:
    assert shortest_edge_size((480, 640), 800, 1333) == (800, 1066)
    assert shortest_edge_size((1080, 1920), 800, 1333) == (750, 1333)


def test_an_image_of_one_colour_is_normalised_by_mean_and_deviation() -> None:
    rgb = np.full((30, 40, 3), (255, 0, 51), np.uint8)
    image = ImageFormat(size_px=(16, 8), mean=(0.5, 0.25, 0.1), std=(0.5, 0.25, 0.2)).tensor(rgb, (16, 8))
    assert image.shape == (1, 3, 16, 8)
    np.testing.assert_allclose(image[0, :, 3, 3], [1, -1, 0.5], atol=1e-6)


def test_shrinking_averages_what_lies_between() -> None:
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[::2] = 200
    small = resized(stripes, (16, 16))
    assert abs(small[4:12, 4:12].astype(int) - 100).max() <= 2


def test_the_middle_of_a_small_image_has_black_around_it() -> None:
    cut = middle(np.full((2, 10, 3), 9, np.uint8), (4, 4))
    assert cut.shape == (4, 4, 3)
    np.testing.assert_array_equal(cut[:, :, 0], [[0] * 4, [9] * 4, [9] * 4, [0] * 4])


def read(folder: Path, text: str) -> ImageFormat:
    (folder / "preprocessor_config.json").write_text(text, encoding="utf-8")
    return read_image_format(folder, ImageFormat(), DetectorError)


def test_the_configuration_beside_a_model_says_how_it_takes_images(tmp_path: Path) -> None:
    assert read_image_format(tmp_path, ImageFormat(), DetectorError) == ImageFormat()
    given_size = {"size": {"height": 640, "width": 480}, "do_normalize": False, "resample": 3}
    plain = read(tmp_path, json.dumps(given_size))
    assert (plain.size_px, plain.mean, plain.std, plain.resampling) == ((640, 480), (0, 0, 0), (1, 1, 1), 3)
    edges = read(
        tmp_path,
        json.dumps(
            {"size": {"shortest_edge": 224}, "do_center_crop": True, "crop_size": {"height": 224, "width": 224}}
        ),
    )
    assert (edges.size_px, edges.shortest_px, edges.longest_px, edges.crop_px) == (None, 224, None, (224, 224))


@pytest.mark.parametrize(
    "text",
    [
        '{"size": {"height": 0, "width": 10}}',
        '{"size": {"height": 1e9, "width": 10}}',
        '{"image_mean": [0, 0], "image_std": [1, 1]}',
        '{"image_mean": [0, 0, 0], "image_std": [1, 0, 1]}',
        '{"image_mean": [0, 0, NaN], "image_std": [1, 1, 1]}',
        '{"resample": 77}',
        '{"rescale_factor": "x"}',
        "[1, 2]",
        "{",
        "[" * 100_000,
    ],
)
def test_a_configuration_that_makes_no_sense_is_one_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(DetectorError, match=r"preprocessor_config\.json"):
        read(tmp_path, text)
