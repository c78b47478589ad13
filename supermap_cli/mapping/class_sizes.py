"""P(size | label): a microwave a metre wide is none, whatever the detector calls it."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np

LOG_SIGMA = 0.12
"""How far off a measured length may be, as a factor (e^0.12): noise, voxels, what masks bleed."""


@cache
def _longest_sides_m() -> dict[str, float]:
    text = files(__package__).joinpath("class_sizes.toml").read_text(encoding="utf-8")
    return {label: float(side) for label, side in tomllib.loads(text)["longest_side_m"].items()}


def size_log_likelihood(label: str, longest_side_m: float) -> float:
    """Log P(a thing of this class measures so much), 0 up to the class's greatest plausible size; 0 for unlisted
    classes.
    """
    greatest = _longest_sides_m().get(label)
    if greatest is None or longest_side_m <= greatest:
        return 0.0
    return -0.5 * float(np.log(longest_side_m / greatest) / LOG_SIGMA) ** 2
