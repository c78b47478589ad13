"""What an observer is told of a mapping session as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from supermap_cli.geometry.arrays import FloatArray

LocalizationState = Literal["placing", "mapping", "lost"]
"""Placing: it is not known yet where the odometry stands in the map, frames wait. Mapping: frames have a place. Lost: a
frame came for which there is no pose, or the traversal fits nowhere in the map so far.
"""


@dataclass(frozen=True)
class SessionContext:
    """A traversal that begins: what is mapped, into which database, by which backends ("detector" -> "onnx").

    `T_map_odom` (4, 4) is `None` where the traversal is yet to be placed. Times in the map are the sensors' plus
    `clock_shift_ns`. `viewers` says which viewers the user asked for: name -> where to, for the observer of that name.
    """

    source: str
    database: str
    traversal: str
    cameras: tuple[str, ...]
    backends: Mapping[str, str]
    T_map_odom: FloatArray | None = None
    clock_shift_ns: int = 0
    viewers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SessionSummary:
    """How a traversal ended: `complete` or stopped before; counts of keyframes, of observations and of objects that
    stand in the map now; `warnings`, one line each.
    """

    complete: bool
    keyframes: int
    observations: int
    objects: int
    warnings: tuple[str, ...] = ()
