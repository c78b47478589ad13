"""Reads what a row holds as text or numbers: whatever is stored there, a value comes out, or a `MemoryStoreError`."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray

GREATEST = 1e15
"""No stored number is larger, of whatever unit: far beyond any place (m), time (s), pixel or count of a map, and far
below where squares and float32 overflow. Chosen."""


def damaged(what: str, where: str | None = None) -> MemoryStoreError:
    """The error of a row that holds something else than it should."""
    return MemoryStoreError(f"the map is damaged: {what}", where=where, cure="see `supermap db check`")


def parsed(text: object, what: str) -> Any:
    """A JSON document. Raises `MemoryStoreError` for anything else, also for infinity and NaN."""
    try:
        return json.loads(text, parse_constant=_no_number)  # type: ignore[arg-type]
    except (ValueError, TypeError, RecursionError) as error:
        raise damaged(f"{what} is no JSON") from error


def parsed_object(text: object, what: str) -> dict[str, Any]:
    """A JSON object."""
    found = parsed(text, what)
    if not isinstance(found, dict):
        raise damaged(f"{what} is no JSON object")
    return found


def parsed_texts(text: object, what: str) -> tuple[str, ...]:
    """A JSON list of texts."""
    found = parsed(text, what)
    if not isinstance(found, list) or not all(isinstance(entry, str) for entry in found):
        raise damaged(f"{what} is no JSON list of texts")
    return tuple(found)


def parsed_shares(text: object, what: str) -> dict[str, float]:
    """A JSON object of numbers, as a label belief is."""
    found = parsed_object(text, what)
    if not found or not all(_is_number(share) for share in found.values()):
        raise damaged(f"{what} is no label belief")
    return found


def parsed_transform(text: object, what: str) -> FloatArray:
    """A transform (4, 4) of four rows of four numbers."""
    try:
        T = np.array(parsed(text, what), np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise damaged(f"{what} is no transform") from error
    if T.shape != (4, 4) or not (np.abs(T) < GREATEST).all():
        raise damaged(f"{what} is no transform")
    return T


def finite(values: tuple[object, ...], what: str) -> FloatArray:
    """Numbers (n,) that are finite and not absurdly large."""
    if not all(_is_number(value) for value in values):
        raise damaged(f"{what} holds a number that is none, or not finite")
    return np.array(values, np.float64)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < GREATEST


def _no_number(name: str) -> Any:
    raise ValueError(f"{name} is no JSON")
