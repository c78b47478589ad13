"""The tools: each a method of `Memory` with its arguments described, read-only, its errors with the cure."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Annotated, Any, ParamSpec, TypeVar

from mcp.server.mcpserver import Image
from mcp.server.mcpserver.exceptions import ToolError
from pydantic import Field

from supermap_cli.errors import QueryError, SupermapError
from supermap_cli.mcp_server.results import about_memory, answer_document, with_last_looks
from supermap_cli.memory.images import thumbnails_of
from supermap_cli.memory_api import Memory
from supermap_cli.query.views import to_document

P = ParamSpec("P")
R = TypeVar("R")

Document = dict[str, Any]
DEFAULT_LISTED = 10
"""Things listed unless more are asked for: an agent's context is short."""
MOST_LISTED = 200

Limit = Annotated[int, Field(ge=1, le=MOST_LISTED, description="Things that are listed; counts are of all.")]
Id = Annotated[str, Field(description="A thing's id, e.g. 'chair-7', from another tool.", max_length=200)]
At = Annotated[
    str | None,
    Field(
        description="As of a time ('10:21', '2026-01-05T10:21:00Z', '12 s') or the end of a traversal ('monday'). "
        "Default: now, the end of the memory.",
        max_length=200,
    ),
]
Since = Annotated[str, Field(description="A time, or a traversal by its name, number or 'last'.", max_length=200)]
Metres = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6, description="Metres in the frame map.")]
Radius = Annotated[float, Field(gt=0, le=5, description="Radius of the circle around the robot's base, m.")]
Height = Annotated[float | None, Field(gt=0, le=10, description="Robot height, m. Default: just above its cameras.")]
Start = Annotated[
    tuple[float, float, float] | None,
    Field(description="Where the robot is: x (m), y (m), yaw (rad) in the frame map. Default: its last pose."),
]


def as_tool(function: Callable[P, R]) -> Callable[P, R]:
    """A tool whose `SupermapError` is a tool error, with what is wrong, where, and the cure."""

    @functools.wraps(function)
    def called(*arguments: P.args, **named: P.kwargs) -> R:
        try:
            return function(*arguments, **named)
        except SupermapError as error:
            raise ToolError(str(error)) from error

    return called


class Tools:
    """The tools of one memory; their docstrings are what an agent reads."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def all(self) -> list[Callable[..., Any]]:
        """Every tool."""
        return [
            *(self.query, self.ask_typed, self.list_objects, self.show, self.history),
            *(self.diff, self.changes_since, self.relations_around, self.places_not_seen_since),
            *(self.navigate, self.goal_near, self.crop, self.keyframe),
        ]

    def query(
        self,
        question: Annotated[str, Field(description="E.g. 'chair near the tv', 'where was the cup on monday'.")],
        at: At = None,
        limit: Limit = DEFAULT_LISTED,
    ) -> Document:
        """Ask in plain words (en, de, es, fr, zh): which things, where, how many, how far, what changed, when.

        A fixed grammar reads the question: what it does not understand is an error that names the part. `message` is
        the answer as a sentence; `verdict` "unknown" and `notes` say what nobody can know; `last_looked_at` says when
        each thing's place was last in view.
        """
        return answer_document(self._memory, self._memory.query(question, at, limit))

    def ask_typed(self, question: Document, at: At = None, limit: Limit = DEFAULT_LISTED) -> Document:
        """Ask a typed question, when `query` does not understand the words or you want no doubt about the reading.

        E.g. {"body": {"kind": "Count", "things": {"kind": "Things", "noun": {"kind": "Named", "name": "chair"},
        "condition": {"kind": "Related", "relation": "near", "reference": {"kind": "Things", "noun": {"kind":
        "Named", "name": "tv"}}}}}}. The answer is that of `query`.
        """
        return answer_document(self._memory, self._memory.ask_typed(question, at, limit))

    def list_objects(self, at: At = None, limit: Limit = 50) -> Document:
        """All things that stand now or stood at a time, those seen last first, with counts by label and traversals.

        As of a time, `unknown` lists what may or may not have stood there then, and why.
        """
        shown = self._memory.overview(at, limit)
        return {**to_document(shown), "memory": about_memory(self._memory)}

    def show(self, id: Id, at: At = None) -> Document:  # noqa: A002 - the argument's name in the protocol
        """Everything about one thing: place, size, presence, beliefs about its label, relations, evidence."""
        return with_last_looks(self._memory, to_document(self._memory.show(id, at)), [id])

    def history(self, id: Id, at: At = None) -> Document:  # noqa: A002 - as above
        """The life of one thing: where it stood and when, how it moved or went, who saw it, with stored pictures."""
        return with_last_looks(self._memory, to_document(self._memory.history(id, at)), [id])

    def diff(self, before: At = None, after: At = None, limit: Limit = 50) -> Document:
        """What changed between two traversals or times (default: the two newest traversals), every thing classified.

        "not observed again" and "not looked at" are not "disappeared": nobody saw its place empty.
        """
        found = to_document(self._memory.diff(before, after))
        changes = found["changes"]
        more = {"more": max(0, len(changes) - limit)}
        return {**found, "changes": changes[:limit], **more, "memory": about_memory(self._memory)}

    def changes_since(self, since: Since, limit: Limit = DEFAULT_LISTED) -> Document:
        """What appeared, disappeared or moved since a time or the end of a traversal."""
        return answer_document(self._memory, self._memory.changes_since(since, limit))

    def relations_around(self, id: Id, at: At = None, limit: Limit = 50) -> Document:  # noqa: A002 - as above
        """The relations of one thing to others (on, inside, near, ...), since when each holds, and distances."""
        relations = self._memory.relations_around(id, at)
        listed = {"id": id, "relations": to_document(relations[:limit]), "more": max(0, len(relations) - limit)}
        others = {end for relation in relations[:limit] for end in (relation.subject, relation.object)}
        return with_last_looks(self._memory, listed, [id, *sorted(others - {id})])

    def places_not_seen_since(self, since: Since, limit: Limit = DEFAULT_LISTED) -> Document:
        """Places of things that nobody has looked at since a time: what the memory says of them may be outdated."""
        return {**to_document(self._memory.places_not_seen_since(since, limit)), "memory": about_memory(self._memory)}

    def navigate(
        self,
        instruction: Annotated[str, Field(description="E.g. 'go to the desk, then to the chair next to the door'.")],
        robot_radius: Radius = 0.22,
        standoff: Annotated[float, Field(ge=0, le=100, description="m between the robot's centre and a thing.")] = 0.8,
        robot_height: Height = None,
        start: Start = None,
    ) -> Document:
        """Poses for a robot, one for each goal, with the way: on floor that was seen free, facing the thing.

        A goal whose `status` is not "ready" has no pose: "ambiguous" (see `candidates`; ask back, or name an id),
        "gone" (where it stood, when it went, the nearest alternative), "unknown", "no free place" (see `nearest`).
        """
        from supermap_cli.navigation.route import DrivingRobot  # noqa: PLC0415 - loads scipy

        robot = DrivingRobot(robot_radius, standoff, robot_height)
        route = self._memory.navigate(instruction, robot, _finite(start))
        ids = [waypoint.thing.id for waypoint in route.waypoints if waypoint.thing is not None]
        return with_last_looks(self._memory, to_document(route), ids)

    def goal_near(
        self, x: Metres, y: Metres, robot_radius: Radius = 0.22, robot_height: Height = None, start: Start = None
    ) -> Document:
        """The free pose nearest to a point of the map that the robot can reach, turned to the point."""
        from supermap_cli.navigation.route import DrivingRobot  # noqa: PLC0415 - loads scipy

        robot = DrivingRobot(robot_radius, height_m=robot_height)
        pose = self._memory.goal_near(x, y, robot, _finite(start))
        away_m = math.dist(pose.position[:2], (x, y))
        found = {"frame_id": "map", "pose": to_document(pose), "distance_m": round(away_m, 3)}
        return {**found, "memory": about_memory(self._memory)}

    def crop(self, id: Id) -> Image:  # noqa: A002 - as above
        """The best stored picture of one thing, JPEG."""
        return Image(data=self._memory.picture(id).jpeg, format="jpeg")

    def keyframe(
        self,
        stamp_ns: Annotated[int, Field(description="A keyframe's time, from `evidence.keyframes_ns` of an answer.")],
    ) -> Image:
        """The whole image (small, JPEG) that a keyframe shows: the surroundings of a thing, what was in view."""
        with self._memory.reader() as reader:
            images = thumbnails_of(reader, [stamp_ns]).get(stamp_ns, [])
        if not images:
            raise ToolError(
                f"no image of a keyframe at {stamp_ns} is stored: take a stamp of `evidence.keyframes_ns` of an "
                "answer; images of old keyframes may have been pruned"
            )
        return Image(data=images[0].jpeg, format="jpeg")


def _finite(start: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    if start is not None and not all(abs(value) < 1e6 for value in start):
        raise QueryError("the start is no pose", cure="give x and y in m and yaw in rad, all finite")
    return start
