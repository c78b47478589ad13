"""Images of every encoding, sound and not: pixels come out, or one line that says what is wrong."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.recordings.images import _COLOR, decode_color, decode_depth, decode_numbers
from supermap_cli.recordings.messages import ImageMessage
from support import bags
from support.bag_writer import compressed_depth_png
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input, one_line

FORMATS = ("jpeg", "png", "webp", "bmp", "16-bit png", "compressedDepth", "rvl", "tiff")


@cache
def encoded(form: str) -> tuple[str, bytes]:
    """The encoding's name and a sound image."""
    if form == "compressedDepth":
        return "16UC1; compressedDepth png", compressed_depth_png(bags.depth_image())
    if form == "rvl":
        nibbles = np.random.default_rng(0).bytes(3000)
        return "16UC1; compressedDepth rvl", bytes(12) + np.array([64, 48], "<i4").tobytes() + nibbles
    if form == "16-bit png":
        return "png", cv2.imencode(".png", bags.depth_image())[1].tobytes()
    return form, cv2.imencode(f".{form}", bags.color_image(3))[1].tobytes()


def decode_all(image: ImageMessage) -> None:
    for decode in (decode_color, decode_depth, decode_numbers):
        pixels = one_line(lambda decode=decode: decode(image), ValueError)  # type: ignore[misc]
        assert pixels is None or pixels.size


@pytest.mark.parametrize("form", FORMATS)
def test_changed_compressed_images(form: str) -> None:
    @fuzzing(60, share=2)
    @given(MUTATIONS)
    def changed(changes: list[Edit]) -> None:
        name, data = encoded(form)
        with one_input(f"image {form}"):
            decode_all(ImageMessage(0, "camera", name, mutated(data, changes), compressed=True))

    changed()


SIZES = st.sampled_from([0, 1, 2, 3, 7, 64, 65535, 2**31 - 1, 2**32 - 1])


@fuzzing(200, share=2)
@given(
    st.sampled_from([*sorted(_COLOR), "16UC1", "32FC1", "64FC1", "", "rgb", "8UC9", "jpeg", "\0"]),
    *(SIZES, SIZES, SIZES),
    st.one_of(st.binary(max_size=300), st.sampled_from([bytes(64 * 64 * 8), b"\xff" * 10_000])),
    st.booleans(),
)
def test_raw_images(encoding: str, width: int, height: int, step: int, data: bytes, big_endian: bool) -> None:
    with one_input("image raw"):
        decode_all(ImageMessage(0, "camera", encoding, data, width, height, step, big_endian))
