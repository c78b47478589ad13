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
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.answering.phrases import head_text, things_text
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.relations import box_distance_m, covered_share
from supermap_cli.query.views import RelationView
from supermap_cli.relations.viewpoint import Viewpoint, behind, in_front_of, left_of, right_of
from supermap_cli.relations.viewpoint import between as between_boxes

if TYPE_CHECKING:
    from supermap_cli.query.answering.things import ThingsFinder

_DIRECTIONS: dict[Direction, Callable[[Box3D, Box3D, Viewpoint], float]] = {
    "left of": left_of,
    "right of": right_of,
    "in front of": in_front_of,
    "behind": behind,
}
DIRECTION_REACH_M = 3.0
"""Gap between two boxes, at most, of which one is said to stand left of the other or behind it. Chosen: what is farther
off is hardly said so.
"""

MOST_OVER_END = 0.5
"""Share of its footprint that may lie over one of two things it is between: what stands on a desk is not. Chosen."""


def robot_distance_m(asking: Asking) -> Callable[[InstanceCandidate], float]:
    """The distance of a candidate's box from the robot at its last pose. Raises `QueryError` where there is none."""
    point = _point(robot_position(asking))
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
        return _of_robot(finder, asked, candidate)
    eye, views = Viewpoint(_viewpoint(finder, asked)), []
    for reference in references:
        gap_m = box_distance_m(candidate.state.box, reference.state.box)
        if candidate.instance.number == reference.instance.number or gap_m > DIRECTION_REACH_M:
            continue
        confidence = _DIRECTIONS[asked.direction](candidate.state.box, reference.state.box, eye)
        if confidence > 0:
            views.append(_view(asked.direction, candidate, reference.instance.id, gap_m, confidence))
    return tuple(views)


def _of_robot(finder: ThingsFinder, asked: Directed, candidate: InstanceCandidate) -> tuple[RelationView, ...]:
    """The same of the robot, which has a front of its own."""
    pose = finder.asking.robot_pose
    position, gap_m = robot_position(finder.asking), robot_distance_m(finder.asking)(candidate)
    if pose is None or gap_m > DIRECTION_REACH_M:
        return ()
    turned: dict[Direction, Direction] = {"in front of": "behind", "behind": "in front of"}
    direction = turned.get(asked.direction, asked.direction)  # it looks ahead, and not at itself
    ahead = Viewpoint(position, float(np.arctan2(pose[1, 0], pose[0, 0])))
    confidence = _DIRECTIONS[direction](candidate.state.box, _point(position), ahead)
    return (_view(asked.direction, candidate, "robot", gap_m, confidence),) if confidence > 0 else ()


def between(
    candidate: InstanceCandidate, first: list[InstanceCandidate], second: list[InstanceCandidate]
) -> tuple[RelationView, ...]:
    """The pairs of references that a candidate stands between."""
    views = []
    for one in first:
        for other in second:
            numbers = {one.instance.number, other.instance.number}
            if len(numbers) < 2 or candidate.instance.number in numbers or (first is second and one.key > other.key):
                continue
            box = candidate.state.box
            confidence = between_boxes(box, one.state.box, other.state.box)
            apart = all(covered_share(box, end.state.box) <= MOST_OVER_END for end in (one, other))
            if confidence > 0 and apart:
                gap_m = min(box_distance_m(box, end.state.box) for end in (one, other))
                both = f"{one.instance.id} and {other.instance.id}"
                views.append(_view("between", candidate, both, gap_m, confidence))
    return tuple(views)


def _viewpoint(finder: ThingsFinder, asked: Directed) -> FloatArray:
    """Where to look from, (3,) metres."""
    match asked.viewpoint:
        case None:
            reference = head_text(asked.reference)
            raise RefusedQuestionError(
                "viewpoint",
                f"{asked.direction} the {reference}, seen from where?",
                part=asked.direction,
                cure=f"add from where: '{asked.direction} the {reference} seen from the door', or '... from the robot'",
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
    raise RefusedQuestionError(
        "viewpoint", f"seen from which {name}? There are {ids}", cure=f"say 'seen from {found[0].instance.id}'"
    )


def _point(position: FloatArray) -> Box3D:
    """A place as a box of next to no size."""
    return Box3D(position, np.full(3, 1e-3), 0.0)


def _view(name: str, candidate: InstanceCandidate, other: str, gap_m: float, confidence: float) -> RelationView:
    return RelationView(
        name=name,
        subject=candidate.instance.id,
        object=other,
        basis="boxes",
        stored_as=None,
        since_ns=candidate.state.first_seen_ns,
        until_ns=None,
        distance_m=round(gap_m, 4),
        confidence=round(candidate.state.confidence * confidence, 4),
    )
