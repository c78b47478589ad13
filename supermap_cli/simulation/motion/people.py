"""People who walk through the building, and carry things from place to place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import interpolate_transform, inverse, make_transform
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.world import Material, Motion, Shape, SimulatedThing, join_shapes

# An adult's unhurried walk, simplified; the values were chosen by eye.
PERSON_CLEARANCE_M = 0.25  # m, half a shoulder's breadth
_STEP_S = 0.05  # s between poses of a motion
_STRIDE_M = 1.4  # m, two steps
_LEG_SWING = np.radians(26)  # rad at full speed
_SUNK_SHARE = 0.3  # of what the hip would sink with straight legs: knees take the rest
_ARM_SWING = np.radians(20)  # rad at full speed
_CARRYING_ARMS = np.radians(55)  # rad forward, with something in the hands
_FULL_SWING_SPEED = 1.1  # m/s
_ACCELERATION = 1.2  # m/s^2
_TURNING_RATE = np.radians(150)  # rad/s on the spot
_STANDING_S = 0.6  # s at rest after a turn
_LIFTING_S = 1.2  # s to pick something up, or to put it down
_SWAY = np.radians(12)  # rad, each of two slow turns to and fro of who stands
_REACH_M = 1.6
"""m from where a person can stop to the thing that is fetched: an arm's length and a step."""


@dataclass(frozen=True)
class CarryMotion:
    """Someone fetches a thing and puts it down elsewhere; `thing_motion` spans exactly pick-up to put-down."""

    person: SimulatedThing
    person_motions: tuple[Motion, ...]
    thing_motion: Motion


@dataclass(frozen=True)
class _Limb:
    """A rigid part of a body, in the standing person's frame: it swings about the x axis through `joint` (3,).

    Its angle is `swing` sin(phase of the step) while walking, and `held` while the person carries something.
    """

    shape: Shape
    joint: FloatArray
    swing: float
    held: float | None = None


@dataclass(frozen=True)
class _Gait:
    """A person's way: every `_STEP_S` the pose on the floor (n, 3) x, y, heading, the distance gone (n,) and the speed
    (n,).
    """

    poses: FloatArray
    gone_m: FloatArray
    speed: FloatArray

    def then(self, other: _Gait) -> _Gait:
        """Both, one after the other."""
        gone_m = other.gone_m + self.gone_m[-1]
        parts = ((self.poses, other.poses), (self.gone_m, gone_m), (self.speed, other.speed))
        return _Gait(*(np.concatenate(pair) for pair in parts))


def walking_person(
    thing_id: str,
    plan: BuildingPlan,
    obstacles: Sequence[Box3D],
    rng: np.random.Generator,
    *,
    start_xy: FloatArray,
    goal_xy: FloatArray,
    start_ns: int,
    speed: float = 1.1,
) -> tuple[SimulatedThing, tuple[Motion, ...]]:
    """A person who appears at the start at `start_ns`, walks to the goal round all obstacles, and is gone there.

    The person's `Motion`s are the limbs (torso, head, two arms, two legs), all under the one id. Raises `ValueError`
    when there is no way.
    """
    free = FreeSpace(plan, obstacles, clearance_m=PERSON_CLEARANCE_M)
    limbs = _body(rng)
    gait = _walk(free.path(start_xy, goal_xy), speed)
    holding = np.zeros(len(gait.speed))
    return _thing(thing_id, limbs), _limb_motions(thing_id, limbs, gait, holding, start_ns)


def person_on_path(
    thing_id: str, path_xy: FloatArray, rng: np.random.Generator, *, start_ns: int, speed: float
) -> tuple[SimulatedThing, tuple[Motion, ...]]:
    """A person who walks along a path (k, 2) from `start_ns` on."""
    limbs = _body(rng)
    gait = _walk(path_xy, speed)
    return _thing(thing_id, limbs), _limb_motions(thing_id, limbs, gait, np.zeros(len(gait.speed)), start_ns)


def standing_person(
    thing_id: str, xy: FloatArray, rng: np.random.Generator, start_ns: int, end_ns: int
) -> tuple[SimulatedThing, tuple[Motion, ...]]:
    """A person who stands at a point (2,) all the time, and turns a little to and fro."""
    limbs = _body(rng)
    count = 2 + int((end_ns - start_ns) / 1e9 / _STEP_S)
    slow = np.arange(count) * _STEP_S * 2 * np.pi
    heading, sways = rng.uniform(-np.pi, np.pi), rng.uniform(8.0, 20.0, 2)
    turned = heading + _SWAY * (np.sin(slow / sways[0]) + np.sin(slow / sways[1]))
    gait = _Gait(np.column_stack([np.tile(xy, (count, 1)), turned]), np.zeros(count), np.zeros(count))
    return _thing(thing_id, limbs), _limb_motions(thing_id, limbs, gait, np.zeros(count), start_ns)


def carried_by_person(  # noqa: PLR0917 - who, what, from where, to where, and in what building
    person_id: str,
    thing: SimulatedThing,
    T_from: FloatArray,
    T_to: FloatArray,
    plan: BuildingPlan,
    obstacles: Sequence[Box3D],
    rng: np.random.Generator,
    *,
    start_ns: int,
    come_from_xy: FloatArray,
    leave_to_xy: FloatArray,
    speed: float = 1.0,
    free: FreeSpace | None = None,
) -> CarryMotion:
    """A person comes to where a thing stands (`T_from`), carries it before the hip to where it shall (`T_to`), leaves.

    The person stops at the free place nearest to the thing, at most 1.6 m off. `free` is where a person can go, if that
    is known already. Raises `ValueError` when there is none, or no way.
    """
    free = free or FreeSpace(plan, obstacles, clearance_m=PERSON_CLEARANCE_M)
    limbs = _body(rng)
    fetch_xy, bring_xy = (free.nearest_free(T[:2, 3], within_m=_REACH_M) for T in (T_from, T_to))
    come = _turning_to(_walk(free.path(come_from_xy, fetch_xy), speed), T_from[:2, 3])
    carry = _turning_to(_lingering(_walk(free.path(fetch_xy, bring_xy), speed, come), _LIFTING_S), T_to[:2, 3])
    leave = _walk(free.path(bring_xy, leave_to_xy), speed, carry)
    gait = come.then(carry).then(leave)

    picked, put = len(come.speed), len(come.speed) + len(carry.speed)
    stamps_ns = _stamps_ns(start_ns, len(gait.speed))
    holding = np.zeros(len(gait.speed))
    holding[picked:put] = _eased(carry, _LIFTING_S)
    carried = _carried(thing, T_from, T_to, gait.poses[picked:put], holding[picked:put])
    return CarryMotion(
        _thing(person_id, limbs),
        _limb_motions(person_id, limbs, gait, holding, start_ns),
        Motion(thing.id, thing.shape, stamps_ns[picked:put], carried),
    )


def _stamps_ns(start_ns: int, count: int) -> IntArray:
    return start_ns + np.arange(count, dtype=np.int64) * round(_STEP_S * 1e9)


def _walk(path_xy: FloatArray, speed: float, before: _Gait | None = None) -> _Gait:
    """Along a path (k, 2) from rest to rest; a person who stood there `before` turns first."""
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415 - keeps start-up light

    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path_xy, axis=0), axis=1))])
    gone_m = _distances_m(float(lengths[-1]), speed)
    xy = np.column_stack([np.interp(gone_m, lengths, path_xy[:, k]) for k in (0, 1)])
    smooth = gaussian_filter1d(xy, 0.2 / _STEP_S, axis=0, mode="nearest")
    smooth[0], smooth[-1] = xy[0], xy[-1]
    ahead = np.minimum(np.arange(len(xy)) + 8, len(xy) - 1)
    offset = smooth[ahead] - smooth
    heading = np.arctan2(offset[:, 1], offset[:, 0])
    still = np.linalg.norm(offset, axis=1) < 0.1
    if still.all():
        heading[:] = before.poses[-1, 2] if before is not None else 0.0
    elif still.any():
        heading[np.argmax(still) :] = heading[np.argmax(still) - 1] if not still[0] else heading[np.argmin(still)]
    walked = _Gait(np.column_stack([smooth, np.unwrap(heading)]), gone_m, np.gradient(gone_m) / _STEP_S)
    if before is None:
        return walked
    turned = _turn(before.poses[-1], float(heading[0]))
    walked.poses[:, 2] += turned.poses[-1, 2] - walked.poses[0, 2]
    return turned.then(walked)


def _distances_m(length_m: float, speed: float) -> FloatArray:
    """How far one has come every `_STEP_S`, with a soft start and end, n >= 2."""
    ramp_s = min(speed / _ACCELERATION, length_m / speed) if length_m > 0 else 0.0
    duration_s = length_m / speed + ramp_s
    elapsed_s = np.linspace(0, max(duration_s, _STEP_S), max(2, 1 + int(np.ceil(duration_s / _STEP_S))))
    pace = np.minimum(1.0, np.minimum(elapsed_s, elapsed_s[-1] - elapsed_s) / max(ramp_s, 1e-6))
    gone = np.concatenate([[0.0], np.cumsum((pace[1:] + pace[:-1]) / 2)])
    distances: FloatArray = gone / max(gone[-1], 1e-9) * length_m
    return distances


def _standing(pose: FloatArray, seconds: float) -> _Gait:
    count = max(1, round(seconds / _STEP_S))
    return _Gait(np.repeat(pose[None], count, axis=0), np.zeros(count), np.zeros(count))


def _lingering(gait: _Gait, seconds: float) -> _Gait:
    """Standing for a while, walking, standing again."""
    return _standing(gait.poses[0], seconds).then(gait).then(_standing(gait.poses[-1], seconds))


def _turn(pose: FloatArray, heading: float) -> _Gait:
    """Turning on the spot, the shorter way."""
    by = float(np.mod(heading - pose[2] + np.pi, 2 * np.pi) - np.pi)
    count = 1 + int(np.ceil(abs(by) / (_TURNING_RATE * _STEP_S)))
    turned = _standing(pose, count * _STEP_S)
    turned.poses[:, 2] += by * np.linspace(0, 1, count)
    return turned


def _turning_to(gait: _Gait, xy: FloatArray) -> _Gait:
    """The gait, then a turn towards a point, then a moment of standing."""
    offset = xy - gait.poses[-1, :2]
    turned = _turn(gait.poses[-1], float(np.arctan2(offset[1], offset[0])))
    return gait.then(turned).then(_standing(turned.poses[-1], _STANDING_S))


def _eased(gait: _Gait, seconds: float) -> FloatArray:
    """(n,) from 0 to 1 within the first and back within the last `seconds`, smoothly."""
    count = len(gait.speed)
    steps = min(seconds / _STEP_S, (count - 1) / 2)
    from_end = np.minimum(np.arange(count), count - 1 - np.arange(count)) / max(steps, 1e-9)
    share = np.clip(from_end, 0, 1)
    eased: FloatArray = share**2 * (3 - 2 * share)
    return eased


def _carried(
    thing: SimulatedThing, T_from: FloatArray, T_to: FloatArray, poses: FloatArray, holding: FloatArray
) -> FloatArray:
    """The thing's poses (n, 4, 4): lifted from where it stood, held before the body, put where it shall stand."""
    low, high = thing.shape.bounds
    height_m = max(0.15, 0.95 - float(low[2] + high[2]) / 2)
    T_person_thing = make_transform(np.eye(3), [-(low[0] + high[0]) / 2, -0.2 - high[1], height_m])
    middle = len(poses) // 2
    T_world_thing = np.empty((len(poses), 4, 4))
    for k, (pose, share) in enumerate(zip(poses, holding, strict=True)):
        rest = T_from if k < middle else T_to
        T_world_thing[k] = interpolate_transform(rest, _T_world_person(pose) @ T_person_thing, float(share))
    return T_world_thing


def _T_world_person(pose: FloatArray) -> FloatArray:
    """A person's frame has its front towards -y, as all things have."""
    x, y, heading = pose
    yaw = heading + np.pi / 2
    return make_transform([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]], [x, y, 0.0])


def _limb_motions(
    thing_id: str, limbs: Sequence[_Limb], gait: _Gait, holding: FloatArray, start_ns: int
) -> tuple[Motion, ...]:
    phase = 2 * np.pi * gait.gone_m / _STRIDE_M
    liveliness = np.clip(gait.speed / _FULL_SWING_SPEED, 0, 1.3)
    leg_m = float(limbs[-1].joint[2])
    sunk_m = _SUNK_SHARE * leg_m * (1 - np.cos(_LEG_SWING * liveliness * np.sin(phase)))
    stamps_ns = _stamps_ns(start_ns, len(gait.speed))
    T_world_person = np.array([_T_world_person(pose) for pose in gait.poses])
    T_world_person[:, 2, 3] -= sunk_m
    motions = []
    for limb in limbs:
        angle = limb.swing * liveliness * np.sin(phase)
        if limb.held is not None:
            angle = (1 - holding) * angle + holding * limb.held
        motions.append(Motion(thing_id, limb.shape, stamps_ns, T_world_person @ _swung(limb.joint, angle)))
    return tuple(motions)


def _swung(joint: FloatArray, angle: FloatArray) -> FloatArray:
    """Turns (n, 4, 4) about the x axis through a joint (3,); a positive angle swings what hangs below forward (-y)."""
    T = np.tile(np.eye(4), (len(angle), 1, 1))
    T[:, 1, 1] = T[:, 2, 2] = np.cos(angle)
    T[:, 1, 2] = np.sin(angle)
    T[:, 2, 1] = -np.sin(angle)
    T_joint = make_transform(np.eye(3), joint)
    turned: FloatArray = T_joint @ T @ inverse(T_joint)
    return turned


def _thing(thing_id: str, limbs: Sequence[_Limb]) -> SimulatedThing:
    return SimulatedThing(thing_id, "person", join_shapes([limb.shape for limb in limbs]))


def _body(rng: np.random.Generator) -> list[_Limb]:
    """A standing person of 1.55 to 1.88 m; the proportions are those of Drillis and Contini (1966)."""
    height = float(rng.uniform(1.55, 1.88))
    hip, shoulder = 0.52 * height, 0.81 * height
    red, green, blue = np.array([92.0, 58, 42]) + rng.random() * np.array([138.0, 127, 113])
    skin = Material((float(red), float(green), float(blue)))
    shirt = Material(_cloth(rng), "stripes" if rng.random() < 0.4 else "speckle", 0.06, 0.25)
    trousers = Material(_cloth(rng), "speckle", 0.04, 0.15)

    at = height * np.array([0.65, 0.865, 0.87, 0.9, 0.945, 0.985, 1.0])
    trunk = ((hip - 0.06, 0.12), (hip, 0.165), (at[0], 0.15), (shoulder - 0.05, 0.19), (shoulder + 0.02, 0.08))
    neck = ((shoulder, 0.055), (at[1], 0.055))
    skull = ((at[2], 0.055), (at[3], 0.075), (at[4], 0.082), (at[5], 0.06), (at[6], 0.015))
    elbow, hand = shoulder - 0.18 * height, shoulder - 0.36 * height
    sleeve = ((elbow - 0.15 * height, 0.04), (elbow, 0.042), (shoulder - 0.02, 0.055), (shoulder, 0.02))
    leg = ((0.0, 0.05), (0.06, 0.05), (0.28 * height, 0.058), (hip - 0.05, 0.085), (hip, 0.06))
    shoe = _turned(((0.0, 0.05), (0.05, 0.045), (0.07, 0.02)), Material((45, 40, 38)), 2.4).moved(_shift(0, -0.06))
    arm = join_shapes(
        [_turned(sleeve, shirt, 1.0), _turned(((hand, 0.015), (hand + 0.04, 0.038), (sleeve[0][0], 0.03)), skin, 1.0)]
    )

    limbs = [
        _Limb(_turned(trunk, shirt, 0.62), np.zeros(3), 0.0),
        _Limb(_turned((*neck, *skull), skin, 1.1), np.zeros(3), 0.0),
    ]
    for side in (-1, 1):
        arm_x, leg_x = side * 0.225, side * 0.09
        arm_joint, leg_joint = np.array([arm_x, 0, shoulder]), np.array([leg_x, 0, hip])
        limbs.append(_Limb(arm.moved(_shift(arm_x, 0)), arm_joint, -side * _ARM_SWING, _CARRYING_ARMS))
        limbs.append(
            _Limb(
                join_shapes([_turned(leg, trousers, 1.1), shoe]).moved(_shift(leg_x, 0)), leg_joint, side * _LEG_SWING
            )
        )
    return limbs


def _cloth(rng: np.random.Generator) -> tuple[float, float, float]:
    red, green, blue = (float(value) for value in rng.uniform(30, 210, 3))
    return red, green, blue


def _shift(x: float, y: float) -> FloatArray:
    return make_transform(np.eye(3), [x, y, 0.0])


def _turned(profile: Sequence[tuple[float, float]], material: Material, depth_share: float, sides: int = 12) -> Shape:
    """A closed solid turned about the z axis: `profile` holds heights and half widths from below, `depth_share` what
    its depth is of its width.
    """
    around = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(around), depth_share * np.sin(around), np.zeros(sides)])
    rings = [ring * [width, width, 0] + [0, 0, z] for z, width in profile]
    low, high = profile[0][0], profile[-1][0]
    vertices = np.vstack([*rings, [[0, 0, low], [0, 0, high]]])
    bottom, top = len(vertices) - 2, len(vertices) - 1
    triangles = []
    for k in range(sides):
        after = (k + 1) % sides
        triangles += [(bottom, after, k), (top, top - 1 - sides + k, top - 1 - sides + after)]
        for lower, upper in pairwise(range(0, len(profile) * sides, sides)):
            triangles += [(lower + k, lower + after, upper + after), (lower + k, upper + after, upper + k)]
    count = len(triangles)
    return Shape(vertices, np.array(triangles, np.int64), np.zeros(count, np.int64), (material,))
