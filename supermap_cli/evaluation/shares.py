"""Shares and means that say when they are undefined: `None`, never NaN."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


def share(part: float, whole: float) -> float | None:
    """A part of a whole; `None` where there is no whole."""
    return float(part / whole) if whole > 0 else None


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of those values that are defined; `None` where none is."""
    defined = [float(value) for value in values if value is not None]
    return sum(defined) / len(defined) if defined else None


@dataclass(frozen=True)
class PrecisionRecall:
    """How many were `found`, `false` and `missed`, and what follows from it.

    precision = found / (found + false), `None` where nothing was reported; recall = found / (found + missed), `None`
    where there was nothing to find; f1 = 2 found / (2 found + false + missed), their harmonic mean (van Rijsbergen
    1979), `None` where there is neither.
    """

    found: int
    false: int
    missed: int
    precision: float | None
    recall: float | None
    f1: float | None


def precision_recall(found: int, false: int, missed: int) -> PrecisionRecall:
    """The three shares of three counts."""
    return PrecisionRecall(
        found=found,
        false=false,
        missed=missed,
        precision=share(found, found + false),
        recall=share(found, found + missed),
        f1=share(2 * found, 2 * found + false + missed),
    )
