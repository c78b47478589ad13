"""Left, right, in front and behind, from a stated viewpoint; between; and the distance from the robot.

Seen from a viewpoint, a reference lies ahead: what is nearer than it is in front of it, what is farther behind it (the
relative frame of reference of Levinson, 2003). The robot itself has a front: the x axis of its base (REP-103).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from supermap_cli.errors import QueryError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.language.questions import Directed, Direction, Robot, SeenFrom, Things
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.answering.phrases import head_text, things_text
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.relations import box_distance_m
from supermap_cli.query.views import RelationView

if TYPE_CHECKING:
    from supermap_cli.query.answering.things import ThingsFinder

DIRECTION_REACH_M = 3.0
"""Gap between two boxes, at most, of which one is said to stand left of the other or behind it. Chosen: what is farther
off is hardly said so.
"""
BETWEEN_WIDTH_M = 0.5
"""How far from the straight line between two centres something lies between them, at least; more between large things:
half their smaller width. Chosen.
"""
_SAME_PLACE_M = 0.05
"""A viewpoint nearer than this to what is looked at gives no direction."""


def robot_distance_m(asking: Asking) -> Callable[[InstanceCandidate], float]:
    """The distance of a candidate's box from the robot at its last pose. Raises `QueryError` where there is none."""
    point = Box3D(robot_position(asking), np.full(3, 1e-3), 0.0)
    return lambda candidate: box_distance_m(point, candidate.state.box)


def robot_position(asking: Asking) -> FloatArray:
    """Where the robot was last, (3,) metres. Raises `QueryError` for a map without poses."""
    position = asking.robot_position
    if position is None:
        raise QueryError("the map holds no pose of the robot", where=asking.reader.where, cure="name a thing instead")
    return position


def in_direction(
    finder: ThingsFinder, asked: Directed, candidate: InstanceCandidate, references: list[InstanceCandidate]
) -> tuple[RelationView, ...]:
    """The references that a candidate lies in a direction of. Raises `QueryError` where the viewpoint is not stated."""
    if isinstance(asked.reference.noun, Robot):
        pose = finder.asking.robot_pose
        forward = pose[:2, 0] if pose is not None else np.array([1.0, 0.0])
        position = robot_position(finder.asking)
        offset = candidate.state.box.center[:2] - position[:2]
        turned: dict[Direction, Direction] = {"in front of": "behind", "behind": "in front of"}
        direction = turned.get(asked.direction, asked.direction)  # the robot looks ahead, not at itself
        away_m = robot_distance_m(finder.asking)(candidate)
        holds = away_m <= DIRECTION_REACH_M and _lies(direction, offset, forward)
        return (_view(asked, candidate, "robot", away_m),) if holds else ()
    eye = _viewpoint(finder, asked)
    views = []
    for reference in references:
        ahead = reference.state.box.center[:2] - eye[:2]
        length = float(np.hypot(*ahead))
        gap_m = box_distance_m(candidate.state.box, reference.state.box)
        other = candidate.instance.number != reference.instance.number
        if not other or length < _SAME_PLACE_M or gap_m > DIRECTION_REACH_M:
            continue
        offset = candidate.state.box.center[:2] - reference.state.box.center[:2]
        if _lies(asked.direction, offset, ahead / length):
            views.append(_view(asked, candidate, reference.instance.id, gap_m))
    return tuple(views)


def between(
    candidate: InstanceCandidate, first: list[InstanceCandidate], second: list[InstanceCandidate]
) -> tuple[RelationView, ...]:
    """The pairs of references that a candidate stands between: near the straight line from one to the other."""
    views = []
    for one in first:
        for other in second:
            numbers = {one.instance.number, other.instance.number}
            if len(numbers) < 2 or candidate.instance.number in numbers or (first is second and one.key > other.key):
                continue
            away_m = _distance_from_line(candidate, one, other)
            widths = [float(end.state.box.size[:2].min()) for end in (one, other)]
            if away_m is not None and away_m <= max(BETWEEN_WIDTH_M, min(widths) / 2):
                views.append(
                    RelationView(
                        name="between",
                        subject=candidate.instance.id,
                        object=f"{one.instance.id} and {other.instance.id}",
                        basis="boxes",
                        stored_as=None,
                        since_ns=candidate.state.first_seen_ns,
                        until_ns=None,
                        distance_m=round(away_m, 4),
                        confidence=round(candidate.state.confidence, 4),
                    )
                )
    return tuple(views)


def _distance_from_line(
    candidate: InstanceCandidate, one: InstanceCandidate, other: InstanceCandidate
) -> float | None:
    """How far a candidate's centre lies from the line between two centres, on the floor plan; `None` beyond its ends."""
    start, end, point = (each.state.box.center[:2] for each in (one, other, candidate))
    along = end - start
    length = float(np.hypot(*along))
    if length < _SAME_PLACE_M:
        return None
    share = float((point - start) @ along) / length**2
    if not 0 < share < 1:
        return None
    return abs(float(along[0] * (point - start)[1] - along[1] * (point - start)[0])) / length


def _viewpoint(finder: ThingsFinder, asked: Directed) -> FloatArray:
    """Where to look from, (3,) metres."""
    match asked.viewpoint:
        case None:
            reference = head_text(asked.reference)
            raise QueryError(
                f"{asked.direction} the {reference}, seen from where?",
                cure=f"add a viewpoint: '... {asked.direction} the {reference} seen from the door', or 'seen by the robot'",
            )
        case Robot():
            finder.asking.note("seen by the robot at its last pose")
            return robot_position(finder.asking)
        case SeenFrom(things):
            return _only(finder, things)


def _only(finder: ThingsFinder, things: Things) -> FloatArray:
    """The place of the one thing to look from."""
    if isinstance(things.noun, Robot):
        return robot_position(finder.asking)
    found = finder.all_candidates(things)
    if len(found) == 1:
        return found[0].state.box.center
    name = things_text(things, article=False)
    if not found:
        raise QueryError(f"there is no {name} in the map to look from", cure="name another viewpoint")
    ids = ", ".join(candidate.instance.id for candidate in found[:5])
    raise QueryError(f"seen from which {name}? There are {ids}", cure=f"say 'seen from {found[0].instance.id}'")


def _lies(direction: Direction, offset: FloatArray, ahead: FloatArray) -> bool:
    """Whether an offset from a reference (2,) points in a direction, within 45 degrees; `ahead` (2,) is the way to it."""
    farther, leftwards = float(offset @ ahead), float(ahead[0] * offset[1] - ahead[1] * offset[0])
    match direction:
        case "left of":
            return leftwards > 0 and leftwards >= abs(farther)
        case "right of":
            return leftwards < 0 and -leftwards >= abs(farther)
        case "in front of":
            return farther < 0 and -farther >= abs(leftwards)
        case "behind":
            return farther > 0 and farther >= abs(leftwards)


def _view(asked: Directed, candidate: InstanceCandidate, other: str, gap_m: float) -> RelationView:
    return RelationView(
        name=asked.direction,
        subject=candidate.instance.id,
        object=other,
        basis="boxes",
        stored_as=None,
        since_ns=candidate.state.first_seen_ns,
        until_ns=None,
        distance_m=round(gap_m, 4),
        confidence=round(candidate.state.confidence, 4),
    )
