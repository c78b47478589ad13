"""What an axis may ask of a world."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WorldTraits:
    """How a world of the scenario `room` is made. The defaults are its usual levels. `seconds` is how long each visit
    lasts.
    """

    seconds: float = 30.0
