"""How probable it is that an object of the map is right: calibrated, from the log-odds of its existence.

The log-odds add up what single views say, as if nothing but their modelled errors could be wrong; taken at their word,
they are far too sure. Platt scaling, a logistic regression of what turned out right on the score (Platt 1999,
"Probabilistic outputs for support vector machines"), makes a probability of them. `evaluation.calibration` checks it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from supermap_cli.types.parameters import parameter

_REGRESSION = (
    "logistic regression (Platt 1999) of 'matched, with its label, to a true object' on the existence log-odds in "
    "worlds of the domain suite's development half; expected calibration error .019 (721 instances of 41)"
)


@dataclass(frozen=True)
class ExistenceParameters:
    """The line from existence log-odds to those of being right."""

    intercept: float = parameter(
        -0.34, "1", "log-odds that an object whose existence has log-odds of 0 is right", _REGRESSION, at_least=-10.0
    )
    slope: float = parameter(
        0.31, "1", "what one unit of its existence log-odds adds to them", _REGRESSION, at_least=0.01
    )


DEFAULT = ExistenceParameters()

_LEAST = 1e-6
"""Probabilities are held this far from 0 and 1 before they become log-odds, which would be infinite there."""


def probability_of(log_odds: float, parameters: ExistenceParameters = DEFAULT) -> float:
    """The probability, in [0, 1], that an object whose existence has these log-odds is right: real, in its place, and
    rightly called.
    """
    scaled = parameters.intercept + parameters.slope * log_odds
    odds = math.exp(-abs(scaled))
    return 1 / (1 + odds) if scaled >= 0 else odds / (1 + odds)


def log_odds_of(probability: float, parameters: ExistenceParameters = DEFAULT) -> float:
    """The existence log-odds that have this probability: the inverse of `probability_of`."""
    bounded = min(max(probability, _LEAST), 1 - _LEAST)
    return (math.log(bounded / (1 - bounded)) - parameters.intercept) / parameters.slope
