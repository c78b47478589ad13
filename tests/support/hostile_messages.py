"""Sound messages of any type with some of their fields changed to what no sensor sends.

A change is a share (which of the message's fields) and a number (which of the values that its type has).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

CHANGES = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 1000)), min_size=1, max_size=4)

_TEXTS = (
    *("", "\0", " ", "/", "x" * 70_000, "\x1b[2J", "\u202e", "map", "odom", "base_link", "camera_optical_frame"),
    *("lidar", "/base_link/", "a\nb", "16UC1", "32FC1", "rgb8", "bayer_rggb8", "jpeg", "16UC1; compressedDepth rvl"),
    *("equidistant", "plumb_bob", "rational_polynomial", "none", "0", "-1", "99999999999999999999", "NaN"),
)
_REALS = (np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e308, -1e308, 1e-320, 1e38, 1e15, 1.0, 255.0, 0.5)
_COUNTS = (0, 1, 2, 3, 17, 1000, 100_000)


def hostile(store: Typestore, name: str, message: Any, changes: Sequence[tuple[float, int]]) -> Any:
    """The message, some of its fields changed in place."""
    for share, number in changes:
        fields = list(_fields(store, name, message))
        if fields:
            fields[int(share * len(fields))](number)
    return message


def _fields(store: Typestore, name: str, message: Any) -> Iterator[Callable[[int], None]]:
    """For every field of a message, and of the messages in it, what changes it."""
    for field, (node, detail) in store.fielddefs[name][1]:
        value = getattr(message, field)
        if node == Nodetype.NAME:
            yield from _fields(store, detail, value)
        elif node == Nodetype.BASE:
            yield _scalar(message, field, detail[0])
        else:
            (kind, element), fixed = detail[0], node == Nodetype.ARRAY
            if not fixed:
                yield _length(message, field)
            if kind == Nodetype.NAME:
                for each in value:
                    yield from _fields(store, element, each)
            elif isinstance(value, np.ndarray) and len(value):
                yield _one_of(message, field)


def _scalar(message: Any, field: str, kind: str) -> Callable[[int], None]:
    def change(number: int) -> None:
        setattr(message, field, _value(kind, number))

    return change


def _value(kind: str, number: int) -> Any:
    if kind == "string":
        return _TEXTS[number % len(_TEXTS)]
    if kind.startswith("float"):
        real = _REALS[number % len(_REALS)]
        return float(np.clip(real, -3e38, 3e38)) if kind == "float32" and np.isfinite(real) else real
    if kind == "bool":
        return bool(number % 2)
    if kind in {"byte", "char", "octet"}:
        kind = "uint8"
    bounds = np.iinfo(kind)
    values = (0, 1, int(bounds.min), int(bounds.max), int(bounds.max) // 2, 7, 2, 100)
    return min(values[number % len(values)], int(bounds.max))


def _one_of(message: Any, field: str) -> Callable[[int], None]:
    def change(number: int) -> None:
        array = getattr(message, field).copy()
        kind = array.dtype.name
        with np.errstate(over="ignore"):
            array[number % len(array)] = _value(kind, number // 7)
        setattr(message, field, array)

    return change


def _length(message: Any, field: str) -> Callable[[int], None]:
    def change(number: int) -> None:
        value, count = getattr(message, field), _COUNTS[number % len(_COUNTS)]
        if isinstance(value, np.ndarray):
            setattr(message, field, np.resize(value, count) if len(value) else np.zeros(count, value.dtype))
        else:
            setattr(message, field, [value[index % len(value)] for index in range(min(count, 1000))] if value else [])

    return change


def default_message(store: Typestore, name: str) -> Any:
    """A message of any type: numbers 1, texts "1", two of everything that there may be several of."""
    values = {}
    for field, (node, detail) in store.fielddefs[name][1]:
        if node == Nodetype.NAME:
            values[field] = default_message(store, detail)
        elif node == Nodetype.BASE:
            values[field] = _plain(detail[0])
        else:
            (kind, element), count = detail[0], detail[1] if node == Nodetype.ARRAY else 2
            if kind == Nodetype.NAME:
                values[field] = [default_message(store, element) for _ in range(count)]
            elif element[0] == "string":
                values[field] = ["1"] * count
            else:
                numpy_name = {"byte": "uint8", "char": "uint8", "octet": "uint8"}.get(element[0], element[0])
                values[field] = np.ones(count, numpy_name)
    return store.types[name](**values)


def _plain(kind: str) -> Any:
    if kind == "string":
        return "1"
    if kind == "bool":
        return True
    return 1.0 if kind.startswith("float") else 1
