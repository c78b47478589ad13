"""People who walk by while the robot drives, and carry things."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.people import PERSON_CLEARANCE_M, carried_by_person, walking_person
from supermap_cli.simulation.motion.route_visibility import STEP_NS, RouteVisibility
from supermap_cli.simulation.world import Motion, SimulatedThing
from supermap_cli.simulation.worlds.shapes.materials import pick

_WALKS_DRAWN = 5
"""Walks of which the one is taken that the robot sees longest; chosen: each costs a search for a way."""
_POINTS_DRAWN = 6
"""Places of which the one farthest from the last is walked to; chosen so that walks cross a room, but not all alike."""
_SPEED = 0.95
"""m/s, an unhurried indoor walk: slower than the 1.1 m/s at which the limbs swing fully (`people`)."""
_LEAST_SEEN_S = 0.5
"""s for which the robot has to see who walks: two steps of the search, so that it is in more than one image."""
_LEAST_CARRYING_SEEN_S = 2.5
"""s for which it has to see who carries something; chosen so that picking up and putting down, 1.2 s each, fit in."""


@dataclass(frozen=True)
class PersonMotion:
    """One walk of a person through the building: the motions of the limbs, and of the carried thing, if any."""

    person: SimulatedThing
    limbs: tuple[Motion, ...]
    carried: Motion | None = None

    @property
    def motions(self) -> tuple[Motion, ...]:
        """All of them."""
        return self.limbs if self.carried is None else (*self.limbs, self.carried)

    @property
    def way_xy(self) -> FloatArray:
        """Where the person is (m, 2), one point every `route_visibility.STEP_NS`."""
        stamps_ns, xy = self.limbs[0].stamps_ns, self.limbs[0].T_world_body[:, :2, 3]
        every = np.append(np.arange(stamps_ns[0], stamps_ns[-1], STEP_NS), stamps_ns[-1])
        return np.column_stack([np.interp(every, stamps_ns, xy[:, k]) for k in (0, 1)])

    @property
    def carried_between_ns(self) -> tuple[int, int]:
        """When the thing is picked up and put down. Raises `ValueError` when there is none."""
        if self.carried is None:
            raise ValueError(f"{self.person.id} carries nothing")
        return int(self.carried.stamps_ns[0]), int(self.carried.stamps_ns[-1])

    @property
    def worth_seeing(self) -> slice:
        """The points of the way that matter: where the thing is carried, or all."""
        if self.carried is None:
            return slice(None)
        first, last = ((stamp_ns - int(self.limbs[0].stamps_ns[0])) // STEP_NS for stamp_ns in self.carried_between_ns)
        return slice(first, last)

    def later(self, by_ns: int) -> PersonMotion:
        """The same at another time."""

        def moved(motion: Motion) -> Motion:
            return replace(motion, stamps_ns=motion.stamps_ns + by_ns)

        return PersonMotion(self.person, tuple(map(moved, self.limbs)), moved(self.carried) if self.carried else None)


class Bystanders:
    """Those who come by in a building on one traversal of the robot; none of them is ever in its way."""

    def __init__(
        self,
        plan: BuildingPlan,
        obstacles: Sequence[Box3D],
        route_visibility: RouteVisibility,
        rng: np.random.Generator,
    ) -> None:
        self._plan, self._obstacles, self._rng = plan, obstacles, rng
        self.route_visibility = route_visibility
        free = FreeSpace(plan, obstacles, clearance_m=PERSON_CLEARANCE_M)
        self._floor_xy = free.cell_centers(np.argwhere(free.reachable))

    def pass_through(self, person_id: str) -> PersonMotion:
        """Someone who comes from one room, looks into another and goes on to a third, seen by the robot on the way.

        Where there is only one room, the person walks up and down in it. Raises `SimulationError` when there is no way.
        """
        return self._best(lambda: self._walking(person_id), _LEAST_SEEN_S)

    def carry(self, person_id: str, thing: SimulatedThing, T_from: FloatArray, T_to: FloatArray) -> PersonMotion:
        """Someone who comes in, takes a thing from where it stands to elsewhere, and leaves, while the robot looks.

        Raises `SimulationError` when there is no way, or the robot is never there to see it.
        """
        return self._best(lambda: self._carrying(person_id, thing, T_from, T_to), _LEAST_CARRYING_SEEN_S)

    def _best(self, draw: Callable[[], PersonMotion], least_s: float) -> PersonMotion:
        """Of a few walks the one that the robot sees longest, at the best time for it."""
        best: tuple[float, PersonMotion] | None = None
        for _ in range(_WALKS_DRAWN):
            try:
                walk = draw()
            except ValueError:  # no way from here to there; the next draw may have one
                continue
            start = self.route_visibility.best_start(walk.way_xy, walk.worth_seeing)
            if start is not None and start.seen_s > (best[0] if best else 0.0):
                best = start.seen_s, walk.later(start.step * STEP_NS)
        if best is None or best[0] < least_s:
            raise SimulationError("nobody can come by in the robot's view", cure="choose another --seed")
        return best[1]

    def _walking(self, person_id: str) -> PersonMotion:
        """Leg by leg, always as the same body."""
        body, start_ns = int(self._rng.integers(2**32)), self.route_visibility.stamp_ns(0)
        legs: list[PersonMotion] = []
        for start_xy, goal_xy in pairwise(self._via_points()):
            leg = walking_person(
                person_id, self._plan, self._obstacles, np.random.default_rng(body),
                start_xy=start_xy, goal_xy=goal_xy, start_ns=start_ns, speed=_SPEED,
            )  # fmt: skip
            legs.append(PersonMotion(*leg))
            start_ns = int(legs[-1].limbs[0].stamps_ns[-1])
        limbs = zip(*(leg.limbs for leg in legs), strict=True)
        return PersonMotion(legs[0].person, tuple(reduce(_then, motions) for motions in limbs))

    def _carrying(self, person_id: str, thing: SimulatedThing, T_from: FloatArray, T_to: FloatArray) -> PersonMotion:
        here = self._plan.room_at(T_from[:2, 3])
        come_from_xy, leave_to_xy = (self._point_in(self._room_besides(here.name if here else "")) for _ in range(2))
        carrying = carried_by_person(
            person_id, thing, T_from, T_to, self._plan, self._obstacles, self._rng,
            start_ns=self.route_visibility.stamp_ns(0), come_from_xy=come_from_xy, leave_to_xy=leave_to_xy,
            speed=_SPEED,
        )  # fmt: skip
        return PersonMotion(carrying.person, carrying.person_motions, carrying.thing_motion)

    def _via_points(self) -> list[FloatArray]:
        if len(self._plan.rooms) > 1:
            via = pick(self._rng, [room.name for room in self._plan.rooms])
            return [self._point_in(name) for name in (self._room_besides(via), via, self._room_besides(via))]
        room, needed_m = self._plan.rooms[0].name, _SPEED * (self.route_visibility.duration_s + 2)
        points = [self._point_in(room)]
        while len(points) < 2 or np.linalg.norm(np.diff(points, axis=0), axis=1).sum() < needed_m:
            points.append(self._point_in(room, far_from=points[-1]))
        return points

    def _room_besides(self, room: str) -> str:
        return pick(self._rng, [other.name for other in self._plan.rooms if other.name != room] or [room])

    def _point_in(self, room: str, far_from: FloatArray | None = None) -> FloatArray:
        """A point (2,) on a room's floor where a person can stand; of a few the farthest from another point."""
        here = self._plan.room(room)
        inside = ((self._floor_xy > here.low) & (self._floor_xy < here.high)).all(axis=1)
        points = self._floor_xy[inside][self._rng.integers(inside.sum(), size=_POINTS_DRAWN)]
        away = np.linalg.norm(points - (points[0] if far_from is None else far_from), axis=1)
        chosen: FloatArray = points[0 if far_from is None else int(np.argmax(away))]
        return chosen


def _then(first: Motion, second: Motion) -> Motion:
    """One motion of two, the second of which begins where and when the first ends."""
    return replace(
        first,
        stamps_ns=np.concatenate([first.stamps_ns, second.stamps_ns[1:]]),
        T_world_body=np.concatenate([first.T_world_body, second.T_world_body[1:]]),
    )
