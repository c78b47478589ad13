"""RVL against its own definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from supermap_cli.recordings.rvl import decode_rvl, encode_rvl


def test_an_empty_image_is_an_empty_stream():
    assert len(decode_rvl(encode_rvl(np.zeros(0, np.uint16)), 0)) == 0


def test_a_stream_written_by_hand_is_read():
    """Two zeros, then two pixels, 10 and 9: nibbles 2, 2, then zigzag(10) = 20 = 4 + 2 * 8 as c 2, zigzag(-1) as 1."""
    word = int.from_bytes(bytes([0x22, 0xC2, 0x10, 0x00]), "big").to_bytes(4, "little")
    assert decode_rvl(word, 4).tolist() == [0, 0, 10, 9]


@given(
    arrays.arrays(
        np.uint16, st.integers(0, 300), elements=st.one_of(st.just(0), st.integers(0, 65535), st.integers(900, 1000))
    )
)
def test_every_image_comes_back(depth):
    assert np.array_equal(decode_rvl(encode_rvl(depth), len(depth)), depth)


@pytest.mark.parametrize("size", [0, 4, 8])
def test_a_stream_that_ends_early_is_refused(size):
    data = encode_rvl(np.arange(1, 200, dtype=np.uint16) * 300)[:size]
    with pytest.raises(ValueError, match="RVL"):
        decode_rvl(data, 199)


def test_a_stream_for_another_size_is_refused():
    with pytest.raises(ValueError, match="RVL"):
        decode_rvl(encode_rvl(np.full(10, 7, np.uint16)), 5)
