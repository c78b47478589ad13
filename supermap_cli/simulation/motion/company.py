"""People who share rooms with the robot for all of a visit: they walk about, stand, or carry a thing, and keep off it
and off one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.bystanders import PersonMotion
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.people import (
    PERSON_CLEARANCE_M,
    carried_by_person,
    person_on_path,
    standing_person,
)
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.world import Motion, SimulatedThing

_STEP_S = 0.25  # s between the times at which distances are checked
_KEEP_APART_M = 0.65  # m between the middles of two bodies, as in `route_visibility`
_LOOK_AHEAD_S = 2.0  # s for which a person's next place has to stay clear
_SPEED = 0.95  # m/s, an unhurried indoor walk
_FARTHEST_GOAL_M = 6.0  # m, the longest leg of someone who walks about
_GOALS_DRAWN, _WALKS_DRAWN, _CARRIES_DRAWN = 8, 6, 24
_TURNING_NS = 600_000_000  # ns for a turn between two ways
_BEFORE_NS = 1_000_000_000  # ns for which people are there before the visit, and after it
_SEEING_M, _HALF_VIEW = 5.0, np.radians(34)  # m and rad within which the robot sees a person


class Company:
    """The people of one traversal."""

    def __init__(self, plan: BuildingPlan, obstacles: Sequence[Box3D], route: Route, rng: np.random.Generator) -> None:
        self._plan, self._obstacles, self._route, self._rng = plan, obstacles, route, rng
        self._free = FreeSpace(plan, obstacles, clearance_m=PERSON_CLEARANCE_M)
        self._floor_xy = self._free.cell_centers(np.argwhere(self._free.reachable))
        self._begin_ns, self._end_ns = route.start_ns - _BEFORE_NS, route.end_ns + _BEFORE_NS
        self.people: list[PersonMotion] = []

    def stand(self, person_id: str, xy: FloatArray) -> None:
        """Someone who stands at a point all the time; the obstacles hold that place free."""
        self.people.append(PersonMotion(*standing_person(person_id, xy, self._rng, self._begin_ns, self._end_ns)))

    def walk(self, person_id: str) -> bool:
        """Someone who walks about, and waits where the robot is in the way. `False` where there is no room for it."""
        for _ in range(_WALKS_DRAWN if len(self._floor_xy) else 0):
            walk = self._walk(person_id)
            if walk is not None:
                self.people.append(walk)
                return True
        return False

    def carry(self, person_id: str, thing: SimulatedThing, T_from: FloatArray, T_to: FloatArray) -> PersonMotion | None:
        """Someone who stands there at first, carries a thing from one place to another, and stands again, at a time
        when the robot sees most of it. `None` where they cannot keep apart.
        """
        best: tuple[float, PersonMotion] | None = None
        for _ in range(_CARRIES_DRAWN if len(self._floor_xy) else 0):
            come_xy, leave_xy = self._floor_xy[self._rng.integers(len(self._floor_xy), size=2)]
            try:
                motion = carried_by_person(
                    person_id, thing, T_from, T_to, self._plan, self._obstacles, self._rng,
                    start_ns=self._route.start_ns, come_from_xy=come_xy, leave_to_xy=leave_xy, speed=_SPEED,
                    free=self._free,
                )  # fmt: skip
            except ValueError:  # no way from here to there
                continue
            carrying = PersonMotion(motion.person, motion.person_motions, motion.thing_motion)
            for delay_s in np.arange(2.0, (self._route.end_ns - int(carrying.limbs[0].stamps_ns[-1])) / 1e9, 2.0):
                later = self._padded(carrying.later(int(delay_s * 1e9)))
                if self._clear(*_way(later.limbs[0])):
                    seen = self._seen_share(later)
                    if best is None or seen > best[0]:
                        best = seen, later
            if best is not None and best[0] > 0.3:
                break
        if best is None:
            return None
        self.people.append(best[1])
        return best[1]

    def _walk(self, person_id: str) -> PersonMotion | None:
        """Leg by leg, always as the same body; a pause between two legs is a turn on the spot."""
        body, now_ns = int(self._rng.integers(2**32)), self._begin_ns
        at_xy = self._floor_xy[self._rng.integers(len(self._floor_xy))]
        legs: list[PersonMotion] = []
        while now_ns < self._end_ns:
            leg = self._leg(person_id, body, at_xy, now_ns)
            if leg is not None:
                legs.append(leg)
                now_ns = int(leg.limbs[0].stamps_ns[-1]) + _TURNING_NS
                at_xy = leg.limbs[0].T_world_body[-1, :2, 3]

                continue
            step_ns = round(_STEP_S * 1e9)
            if not self._clear(np.array([now_ns, now_ns + step_ns]), np.stack([at_xy, at_xy])):
                return None
            now_ns += step_ns
        if not legs:
            return None
        limbs = zip(*(leg.limbs for leg in legs), strict=True)
        return self._padded(PersonMotion(legs[0].person, tuple(reduce(_after, motions) for motions in limbs)))

    def _leg(self, person_id: str, body: int, at_xy: FloatArray, now_ns: int) -> PersonMotion | None:
        """The next way, on which and for a while after which the person is in nobody's way."""
        near = self._floor_xy[np.linalg.norm(self._floor_xy - at_xy, axis=1) < _FARTHEST_GOAL_M]
        if not len(near):
            return None
        goals = near[self._rng.integers(len(near), size=_GOALS_DRAWN)]
        for goal_xy in sorted(goals, key=lambda goal: -float(np.linalg.norm(goal - at_xy))):
            length_m = max(float(np.linalg.norm(goal_xy - at_xy)), 1e-9)
            direct_s = np.arange(0, length_m / _SPEED, _STEP_S)
            line = at_xy + (goal_xy - at_xy) * (direct_s * _SPEED / length_m)[:, None]
            if not self._clear(now_ns + (direct_s * 1e9).astype(np.int64), line):
                continue  # most fail here, before any path is planned
            try:
                path_xy = self._free.path(at_xy, goal_xy)
            except ValueError:
                continue
            rng = np.random.default_rng(body)
            leg = PersonMotion(*person_on_path(person_id, path_xy, rng, start_ns=now_ns, speed=_SPEED))
            stamps_ns, way_xy = _way(leg.limbs[0])
            after_ns = stamps_ns[-1] + (np.arange(0, _LOOK_AHEAD_S, _STEP_S) * 1e9).astype(np.int64)
            after_xy = np.tile(way_xy[-1], (len(after_ns), 1))
            if self._clear(np.append(stamps_ns, after_ns), np.vstack([way_xy, after_xy])):
                return leg
        return None

    def _clear(self, stamps_ns: IntArray, xy: FloatArray) -> bool:
        """Whether someone who is at points (n, 2) at these times keeps apart from the robot and from all others."""
        robot = self._route.derivative(np.clip(stamps_ns, self._route.start_ns, self._route.end_ns))[:, :2]
        if (np.linalg.norm(robot - xy, axis=1) < _KEEP_APART_M).any():
            return False
        for other in self.people:
            times, places = other.limbs[0].stamps_ns, other.limbs[0].T_world_body[:, :2, 3]
            there = np.column_stack([np.interp(stamps_ns, times, places[:, k]) for k in (0, 1)])
            if (np.linalg.norm(there - xy, axis=1) < _KEEP_APART_M).any():
                return False
        return True

    def _seen_share(self, walk: PersonMotion) -> float:
        """The share of the time in which the thing is carried that the robot has the person before its camera."""
        first_ns, last_ns = walk.carried_between_ns
        stamps_ns = np.arange(first_ns, last_ns, round(_STEP_S * 1e9))
        times, places = walk.limbs[0].stamps_ns, walk.limbs[0].T_world_body[:, :2, 3]
        poses = self._route.derivative(stamps_ns)
        offset = np.column_stack([np.interp(stamps_ns, times, places[:, k]) for k in (0, 1)]) - poses[:, :2]
        aside = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - poses[:, 2])))
        return float(((np.linalg.norm(offset, axis=1) < _SEEING_M) & (np.abs(aside) < _HALF_VIEW)).mean())

    def _padded(self, walk: PersonMotion) -> PersonMotion:
        """The same person, standing there from before the visit until after it."""

        def padded(motion: Motion) -> Motion:
            stamps_ns, poses = motion.stamps_ns, motion.T_world_body
            if stamps_ns[0] > self._begin_ns:
                stamps_ns, poses = np.append(self._begin_ns, stamps_ns), np.concatenate([poses[:1], poses])
            if stamps_ns[-1] < self._end_ns:
                stamps_ns, poses = np.append(stamps_ns, self._end_ns), np.concatenate([poses, poses[-1:]])
            return replace(motion, stamps_ns=stamps_ns, T_world_body=poses)

        return PersonMotion(walk.person, tuple(map(padded, walk.limbs)), walk.carried)


def _way(motion: Motion) -> tuple[IntArray, FloatArray]:
    """When and where a body is, (n,) and (n, 2), every quarter of a second and at its end."""
    stamps_ns, xy = motion.stamps_ns, motion.T_world_body[:, :2, 3]
    every = np.append(np.arange(stamps_ns[0], stamps_ns[-1], round(_STEP_S * 1e9)), stamps_ns[-1])
    return every, np.column_stack([np.interp(every, stamps_ns, xy[:, k]) for k in (0, 1)])


def _after(first: Motion, second: Motion) -> Motion:
    """One motion of two, the second of which begins where the first ends, at that time or later."""
    begin = 1 if second.stamps_ns[0] == first.stamps_ns[-1] else 0
    return replace(
        first,
        stamps_ns=np.concatenate([first.stamps_ns, second.stamps_ns[begin:]]),
        T_world_body=np.concatenate([first.T_world_body, second.T_world_body[begin:]]),
    )
