"""P(size | label): a microwave a metre wide is none, whatever the detector calls it.

Departs from the paper, whose semantic fusion (eq. 10) knows no sizes: a further factor of the posterior.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class ClassSizeParameters:
    """How exactly an object's size is known."""

    log_sigma: float = parameter(
        0.12, "1", "standard deviation of the log of a measured length: noise, voxels, bleeding masks", TUNED
    )
    wrong_measure: float = parameter(
        0.05,
        "1",
        "share of objects whose measure is wrong altogether (a mask that fills gaps, a neighbour taken in): it bounds "
        "what size can say against a label",
        "prior",
        at_least=1e-6,
        at_most=1.0,
    )


DEFAULT = ClassSizeParameters()


@cache
def _table(name: str) -> dict[str, float]:
    text = files(__package__).joinpath("class_sizes.toml").read_text(encoding="utf-8")
    return {label: float(length) for label, length in tomllib.loads(text)[name].items()}


def thickness_m(label: str) -> float | None:
    """How far a thing of this class rises at least from what it stands on or before, in metres; `None` if unlisted."""
    return _table("thickness_m").get(label)


def size_log_likelihood(label: str, longest_side_m: float, parameters: ClassSizeParameters = DEFAULT) -> float:
    """Log P(a thing of this class measures so much), 0 up to the class's greatest plausible size; 0 for unlisted
    classes.
    """
    greatest = _table("longest_side_m").get(label)
    if greatest is None or longest_side_m <= greatest:
        return 0.0
    deviations = float(np.log(longest_side_m / greatest)) / parameters.log_sigma
    return float(np.log((1 - parameters.wrong_measure) * np.exp(-0.5 * deviations**2) + parameters.wrong_measure))
