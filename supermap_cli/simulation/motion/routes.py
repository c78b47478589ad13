"""A robot's way through a building: from room to room, looking at what stands in them, from several sides.

`simulation.tour` chooses where to stop, `_drive` when to be where, and `simulation.gaze` where to look meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.gaze import GazePlanner, follow_gaze, room_points_of_interest
from supermap_cli.simulation.motion.tour import Stop, Tour, ordered_round, plan_tour, rooms_to_stop_in
from supermap_cli.simulation.route import Route

ROBOT_RADIUS_M = 0.25
"""m, half the breadth of a small indoor robot; chosen so that it passes every doorway."""
_PLANNED_CLEARANCE_M = 0.33
"""m, the radius and what the spline may cut off corners."""
_STEP_S = 0.05
"""s between points of the planned drive; chosen so that the robot goes less than a grid cell in it."""
_KNOT_S = 0.25
"""s between knots of the spline, where it keeps clear of everything; chosen so that the grid's corners are smoothed."""
_ACCELERATION = 0.7
"""m/s^2, starting and braking; chosen so that full speed is reached in about a second."""
_SIDEWAYS_ACCELERATION = 0.8
"""m/s^2 in bends; chosen to be about as gentle, under a tenth of gravity."""
_BRAKING_S = 1.0
"""s of braking before the end of the recording; chosen as long as a start takes."""


def plan_route(
    plan: BuildingPlan,
    obstacles: Sequence[Box3D],
    rng: np.random.Generator,
    *,
    start_ns: int,
    seconds: float,
    rooms: Sequence[str] | None = None,
    focus: Sequence[FloatArray] = (),
) -> Route:
    """A way that takes exactly `seconds` through the named rooms (all by default), round after round.

    In every room the robot stops at a few places that together show the obstacles, the walls and above all the `focus`
    points (2,) from different sides, and it looks at them from 1 to 3 m. Rooms with a focus come first, so that a short
    way shows at least these. Its base (0.25 m in radius) never touches an obstacle or a wall.

    Raises `ValueError` when a room cannot be entered or the time is not positive.
    """
    if seconds <= 0:
        raise ValueError(f"a route takes time, not {seconds} s")
    free = FreeSpace(plan, obstacles, clearance_m=_PLANNED_CLEARANCE_M)
    chosen = [plan.room(name) for name in rooms] if rooms is not None else list(plan.rooms)
    interests = {room.name: room_points_of_interest(room, obstacles, focus) for room in chosen}
    stopping = rooms_to_stop_in(plan, chosen, interests)
    starts = [room for room in stopping if interests[room.name].focused] or stopping
    ordered = ordered_round(free, stopping, starts[int(rng.integers(len(starts)))])
    tour = plan_tour(free, ordered, interests, seconds, rng)
    way_xy = _drive(free, tour, seconds, rng)
    yaw = follow_gaze(GazePlanner(plan, free, interests), way_xy, _STEP_S, rng)
    body = FreeSpace(plan, obstacles, clearance_m=ROBOT_RADIUS_M)
    return _knotted(body, start_ns, seconds, way_xy, yaw)


def _drive(free: FreeSpace, tour: Tour, seconds: float, rng: np.random.Generator) -> FloatArray:
    """Where the robot is every `_STEP_S` from 0 to `seconds` (n, 2); it comes to rest at the end."""
    pieces = [_waiting(tour.stops[0])]
    for stop, leg in zip(tour.stops[1:], tour.legs, strict=True):
        pieces += [_timed(_rounded(free, leg), float(rng.uniform(0.6, 0.9))), _waiting(stop)]
        if sum(map(len, pieces)) * _STEP_S > seconds:
            break
    way = np.vstack(pieces)
    elapsed_s = np.linspace(0, seconds, 1 + max(2, int(np.ceil(seconds / _STEP_S))))
    braking_s = min(_BRAKING_S, seconds / 2)
    late = np.clip(elapsed_s - (seconds - braking_s), 0, None)
    progress = (elapsed_s - late**2 / (2 * braking_s)) / _STEP_S
    return np.column_stack([np.interp(progress, np.arange(len(way)), way[:, k]) for k in (0, 1)])


def _waiting(stop: Stop) -> FloatArray:
    return np.repeat(stop.xy[None], max(1, round(stop.dwell_s / _STEP_S)), axis=0)


def _rounded(free: FreeSpace, leg: FloatArray) -> FloatArray:
    """The leg as points about 2 cm apart, its corners rounded as far as that stays free."""
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415 - keeps start-up light

    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(leg, axis=0), axis=1))])
    along = np.linspace(0, lengths[-1], 2 + int(lengths[-1] / 0.02))
    points = np.column_stack([np.interp(along, lengths, leg[:, k]) for k in (0, 1)])
    for sigma_m in (0.4, 0.25, 0.15, 0.08):
        mirrored = np.vstack([2 * points[0] - points[:0:-1], points, 2 * points[-1] - points[-2::-1]])
        smooth = gaussian_filter1d(mirrored, sigma_m / 0.02, axis=0)[len(points) - 1 : 2 * len(points) - 1]
        smooth[0], smooth[-1] = points[0], points[-1]
        if (free.room_to_move_m(smooth) >= free.clearance_m - 0.04).all():
            rounded: FloatArray = smooth
            return rounded
    return points


def _timed(points: FloatArray, cruise: float) -> FloatArray:
    """The points (n, 2) of a leg driven from rest to rest: one every `_STEP_S`, slower in its bends."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if steps.sum() < 1e-6:
        return points[:1]
    tangent = np.gradient(points, axis=0)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    bend = np.abs(np.gradient(heading)) / np.maximum(np.linalg.norm(tangent, axis=1), 1e-9)
    speed = np.minimum(cruise, np.sqrt(_SIDEWAYS_ACCELERATION / np.maximum(bend, 1e-6)))
    speed = np.maximum(speed, 0.12)
    speed[0] = speed[-1] = 0.03
    for k in range(1, len(speed)):
        speed[k] = min(speed[k], np.sqrt(speed[k - 1] ** 2 + 2 * _ACCELERATION * steps[k - 1]))
    for k in range(len(speed) - 2, -1, -1):
        speed[k] = min(speed[k], np.sqrt(speed[k + 1] ** 2 + 2 * _ACCELERATION * steps[k]))
    times_s = np.concatenate([[0.0], np.cumsum(2 * steps / (speed[1:] + speed[:-1]))])
    every = np.arange(0, times_s[-1] + _STEP_S, _STEP_S)
    return np.column_stack([np.interp(every, times_s, points[:, k]) for k in (0, 1)])


def _knotted(body: FreeSpace, start_ns: int, seconds: float, way_xy: FloatArray, yaw: FloatArray) -> Route:
    """The spline through every so many points of the way; through more of them where it would touch something."""
    elapsed_s = np.linspace(0, seconds, len(way_xy))
    stamps_ns = start_ns + (np.linspace(0, seconds, 1 + int(seconds * 40)) * 1e9).astype(np.int64)
    for knot_s in (_KNOT_S, _KNOT_S / 2, _STEP_S):
        times_s = np.linspace(0, seconds, 1 + max(4, int(np.ceil(seconds / knot_s))))
        x, y, turned = (np.interp(times_s, elapsed_s, values) for values in (way_xy[:, 0], way_xy[:, 1], yaw))
        route = Route(start_ns, times_s, np.column_stack([x, y]), turned)
        if body.are_free(route.derivative(stamps_ns)[:, :2]).all():
            return route
    raise ValueError("no way through the rooms keeps off all obstacles")
