"""Values as bytes and back."""

from __future__ import annotations

import json
import math
import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from supermap_cli.types.packing import PackingError, pack, unpack


@dataclass
class Chair:
    legs: int
    weight: float = 0.0
    kept: dict[int, str] = field(default_factory=dict)
    cache: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Frozen:
    at: tuple[float, ...]

    def __post_init__(self) -> None:
        raise AssertionError("no code of a class runs")


CLASSES = {Chair: ("cache",), Frozen: ()}

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: (
        st.lists(inner)
        | st.tuples(inner, inner)
        | st.dictionaries(st.integers() | st.text() | st.tuples(st.integers(), st.text()), inner)
        | st.frozensets(st.integers())
    ),
)


@given(plain)
def test_plain_values_come_back_as_they_were(value: object) -> None:
    assert unpack(pack(value, {}), {}) == value


@given(hnp.arrays(st.sampled_from(["<f8", "<f4", "<i8", "<i4", "u1", "?"]), hnp.array_shapes(min_dims=0, min_side=0)))
def test_arrays_come_back_bit_by_bit(array: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> None:
    for layout in (array, array.T):
        back = unpack(pack(layout, {}), {})
        assert back.dtype == layout.dtype
        assert back.shape == layout.shape
        assert back.tobytes() == layout.tobytes()
        assert back.flags.c_contiguous or not layout.flags.c_contiguous
        assert back.flags.writeable


def test_scalars_of_numpy_keep_their_type() -> None:
    back = unpack(pack([np.float32(0.1), np.int64(3), np.float64("nan"), math.inf], {}), {})
    assert [type(item) for item in back] == [np.float32, np.int64, np.float64, float]
    assert back[0] == np.float32(0.1)
    assert math.isnan(back[2])
    assert back[3] == math.inf


def test_dataclasses_come_back_without_what_is_left_out() -> None:
    frozen = object.__new__(Frozen)
    object.__setattr__(frozen, "at", (1.0, 2.0))
    chair, point = unpack(pack([Chair(4, 2.5, {7: "seven"}, [1, 2]), frozen], CLASSES), CLASSES)
    assert chair == Chair(4, 2.5, {7: "seven"}, [])
    assert point.at == (1.0, 2.0)


def test_what_is_not_on_the_list_is_neither_packed_nor_made() -> None:
    with pytest.raises(TypeError, match="Chair"):
        pack(Chair(4), {})
    with pytest.raises(PackingError):
        unpack(pack(Chair(4), CLASSES), {})
    with pytest.raises(TypeError, match="objects"):
        pack(np.array([object()]), {})


@pytest.mark.parametrize("blob", [b"", b"SMC1", b"SMC1\x00", b"something else"])
def test_other_bytes_are_refused(blob: bytes) -> None:
    with pytest.raises(PackingError):
        unpack(blob, {})


@given(st.data())
def test_damaged_bytes_are_refused_or_read_as_some_value(data: st.DataObject) -> None:
    tree = {"array": data.draw(st.lists(st.integers(-5, 50), max_size=3)), "dtype": "<f8", "shape": [2]}
    text = json.dumps(tree).encode()
    blob = b"SMC1" + zlib.compress(struct.pack("<I", len(text)) + text + bytes(16))
    if tree["array"] == [0, 16]:
        assert unpack(blob, {}).shape == (2,)
    else:
        with pytest.raises(PackingError):
            unpack(blob, {})
