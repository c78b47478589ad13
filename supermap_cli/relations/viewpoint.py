"""Relations of three: between two things, and left, right, in front and behind as seen from a stated viewpoint.

All are pure functions of boxes in the level map; each returns a confidence in (0, 1], 0 where it does not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, check_shape
from supermap_cli.geometry.boxes import Box3D

SIDE_DEG = 60.0
"""Half the opening of the cone, deg, in which something is to a thing's side, or before or behind it: cones of adjacent
directions overlap, for people call what stands diagonally both.
"""
BETWEEN_MARGIN_M = 0.1
"""How far, m, what is between two others may stick out of the corridor that joins them: errors of size and place."""
MIN_APART_M = 0.05
"""Two places nearer to each other than this, m, have no direction from one to the other."""


@dataclass(frozen=True)
class StatedViewpoint:
    """From where it is looked at: `position` (3,) metres in the map frame.

    `heading_rad` is the direction of looking about z, for a robot's pose; `None` looks at the reference itself.
    """

    position: FloatArray
    heading_rad: float | None = None

    def __post_init__(self) -> None:
        check_shape("position", self.position, (3,))

    def direction_to(self, reference: Box3D) -> FloatArray | None:
        """(2,) the unit direction of looking on the floor; `None` where the viewpoint is the reference's own middle."""
        if self.heading_rad is not None:
            return np.array([np.cos(self.heading_rad), np.sin(self.heading_rad)])
        offset = reference.center[:2] - self.position[:2]
        distance_m = float(np.linalg.norm(offset))
        return None if distance_m < MIN_APART_M else offset / distance_m


Viewpoint = StatedViewpoint
"""Its short name, where nothing else is called so."""


def left_of(subject: Box3D, reference: Box3D, seen_from: StatedViewpoint) -> float:
    """The subject is to the left of the reference for who looks at it from the viewpoint."""
    return _towards(subject, reference, seen_from, 90.0)


def right_of(subject: Box3D, reference: Box3D, seen_from: StatedViewpoint) -> float:
    """The subject is to the right of the reference for who looks at it from the viewpoint."""
    return _towards(subject, reference, seen_from, -90.0)


def in_front_of(subject: Box3D, reference: Box3D, seen_from: StatedViewpoint) -> float:
    """The subject is on the reference's side that faces the viewpoint."""
    return _towards(subject, reference, seen_from, 180.0)


def behind(subject: Box3D, reference: Box3D, seen_from: StatedViewpoint) -> float:
    """The subject is on the reference's far side from the viewpoint."""
    return _towards(subject, reference, seen_from, 0.0)


def facing(front_rad: float, reference: Box3D) -> StatedViewpoint:
    """The viewpoint of somebody before a thing whose front looks to `front_rad` about z: its left is his left.

    In front of a cupboard is where its front looks to, wherever the robot is.
    """
    direction = np.array([np.cos(front_rad), np.sin(front_rad), 0.0])
    return StatedViewpoint(reference.center + direction, float(front_rad + np.pi))


def between(subject: Box3D, first: Box3D, second: Box3D) -> float:
    """The subject's middle lies in the corridor that joins the footprints of two others, and beyond the middle of none.

    1 on the line that joins their middles, less towards the corridor's edge.
    """
    line = second.center[:2] - first.center[:2]
    length_m = float(np.linalg.norm(line))
    if length_m < MIN_APART_M:
        return 0.0
    along, across = line / length_m, np.array([-line[1], line[0]]) / length_m
    offset = subject.center[:2] - first.center[:2]
    at_m, aside_m = float(offset @ along), float(offset @ across)
    if not MIN_APART_M < at_m < length_m - MIN_APART_M:
        return 0.0
    low, high = _shared_interval(first, second, across, first.center[:2], at_m / length_m)
    half = (high - low) / 2 + BETWEEN_MARGIN_M
    off = abs(aside_m - (low + high) / 2)
    return 0.0 if off > half else float(1 - 0.5 * off / half)


def _shared_interval(
    first: Box3D, second: Box3D, across: FloatArray, origin: FloatArray, share: float
) -> tuple[float, float]:
    """The corridor's bounds across its line (m from `origin`), at a share of the way from the first to the second."""
    (a_low, a_high), (b_low, b_high) = (_interval(box, across, origin) for box in (first, second))
    return a_low + (b_low - a_low) * share, a_high + (b_high - a_high) * share


def _interval(box: Box3D, across: FloatArray, origin: FloatArray) -> tuple[float, float]:
    offsets = (box.footprint() - origin) @ across
    return float(offsets.min()), float(offsets.max())


def _towards(subject: Box3D, reference: Box3D, seen_from: StatedViewpoint, turn_deg: float) -> float:
    """Whether the subject lies from the reference in the direction of looking, turned to the left by an angle."""
    looking = seen_from.direction_to(reference)
    offset = subject.center[:2] - reference.center[:2]
    distance_m = float(np.linalg.norm(offset))
    if looking is None or distance_m < MIN_APART_M:
        return 0.0
    turn = np.radians(turn_deg)
    c, s = np.cos(turn), np.sin(turn)
    wanted = np.array([c * looking[0] - s * looking[1], s * looking[0] + c * looking[1]])
    angle_deg = float(np.degrees(np.arccos(np.clip(offset @ wanted / distance_m, -1, 1))))
    return 0.0 if angle_deg > SIDE_DEG else 1 - 0.5 * angle_deg / SIDE_DEG
