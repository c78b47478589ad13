"""The ground truth of a scenario: what stood where and when, what the cameras really showed of it, what changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.simulation.recording.questions import ask_questions
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_cli.simulation.views import PlaceVisibility
from supermap_cli.simulation.world import Motion, SimulatedThing, Stay, World, box_of
from supermap_cli.types.truth import (
    GroundTruth,
    TrueChange,
    TrueMotion,
    TrueObject,
    TrueSightings,
    TrueState,
    TrueSurface,
    TrueTraversal,
)

SURFACE_SPACING_M = 0.02
"""Distance of surface samples of things, m."""
FIXTURE_SPACING_M = 0.05
"""Distance of surface samples of walls, floors and the like, m."""
PERSON = "person"
"""The label of people."""

LEAST_MOVE_M = 0.1
"""A thing that stands again within this of where it stood has not moved."""

Seen = tuple[Float32Array, BoolArray]
"""Samples (n, 3) of a surface, and which of them (n,) some image showed."""


@dataclass(frozen=True)
class DetectedImage:
    """An image that a detector looked at, and what it really shows."""

    stamp_ns: int
    camera_id: str
    visibility: PlaceVisibility


@dataclass(frozen=True)
class RecordedTraversal:
    """One traversal as it was recorded: `images` in the order of their stamps; `fingerprint` is that of the complete
    recording.
    """

    traversal: SimulatedTraversal
    recording: str
    images: tuple[DetectedImage, ...]
    fingerprint: str | None = None


def make_truth(
    scenario: Scenario, recorded: Sequence[RecordedTraversal], things: Sequence[Seen], fixtures: Sequence[Seen]
) -> GroundTruth:
    """Put the truth together; `things` and `fixtures` are the world's surfaces (see `SurfaceCoverage`)."""
    world = scenario.world
    objects = tuple(_object(world, thing, seen) for thing, seen in zip(world.things, things, strict=True))
    truth = GroundTruth(
        scenario=scenario.name,
        seed=scenario.seed,
        levels=scenario.levels,
        traversals=tuple(_traversal(traversal, world) for traversal in recorded),
        objects=objects,
        surfaces=_surfaces(world, fixtures),
        changes=find_changes(objects, scenario.traversals),
        questions=(),
    )
    return replace(truth, questions=ask_questions(truth))


def _object(world: World, thing: SimulatedThing, seen: Seen) -> TrueObject:
    surface, surface_seen = seen
    centroid = surface.astype(np.float64).mean(axis=0)
    stays = world.stays_of(thing.id)
    motions = [motion for motion in world.motions if motion.thing_id == thing.id]
    is_person = thing.label == PERSON
    return TrueObject(
        id=thing.id,
        label=thing.label,
        kind="person" if is_person else "object",
        states=() if is_person else tuple(_state(thing, stays[k], centroid) for k in _in_order(stays)),
        motions=tuple(_true_motion(bodies) for bodies in contiguous_motions(motions)),
        surface_object=surface,
        surface_seen=surface_seen,
    )


def _in_order(stays: Sequence[Stay]) -> list[int]:
    """The places of stays in the order of time."""

    def begins(k: int) -> float:
        since_ns = stays[k].since_ns
        return -np.inf if since_ns is None else since_ns

    return sorted(range(len(stays)), key=begins)


def _state(thing: SimulatedThing, stay: Stay, centroid: FloatArray) -> TrueState:
    return TrueState(
        since_ns=stay.since_ns,
        until_ns=stay.until_ns,
        T_world_object=stay.T_world_thing,
        box=box_of(thing.shape, stay.T_world_thing),
        centroid=transform_points(stay.T_world_thing, centroid[None])[0],
        on=stay.on,
    )


def contiguous_motions(motions: Sequence[Motion]) -> list[list[Motion]]:
    """A thing's motions grouped by contiguous time: all limbs of a walk, and what follows without a pause."""
    grouped: list[list[Motion]] = []
    end_ns = -1
    for motion in sorted(motions, key=lambda motion: int(motion.stamps_ns[0])):
        if grouped and int(motion.stamps_ns[0]) <= end_ns:
            grouped[-1].append(motion)
        else:
            grouped.append([motion])
            end_ns = -1
        end_ns = max(end_ns, int(motion.stamps_ns[-1]))
    return grouped


def _true_motion(bodies: Sequence[Motion]) -> TrueMotion:
    """The mean of the bodies' centres at all times that any of them gives."""
    stamps_ns = np.unique(np.concatenate([body.stamps_ns for body in bodies]))
    centers = np.stack([_centers(body, stamps_ns) for body in bodies])
    return TrueMotion(stamps_ns, np.nanmean(centers, axis=0))


def _centers(body: Motion, stamps_ns: IntArray) -> FloatArray:
    """(k, 3) of the middle of a body's bounds, NaN while it does not move."""
    low, high = body.shape.bounds
    own = body.T_world_body[:, :3, :3] @ ((low + high) / 2) + body.T_world_body[:, :3, 3]
    seconds, own_s = (stamps_ns - stamps_ns[0]) / 1e9, (body.stamps_ns - stamps_ns[0]) / 1e9
    return np.column_stack([np.interp(seconds, own_s, own[:, k], left=np.nan, right=np.nan) for k in range(3)])


def _traversal(recorded: RecordedTraversal, world: World) -> TrueTraversal:
    traversal = recorded.traversal
    stamps_ns = np.array([image.stamp_ns for image in recorded.images], np.int64)
    camera_ids = tuple(image.camera_id for image in recorded.images)
    return TrueTraversal(
        name=traversal.name,
        recording=recorded.recording,
        start_ns=traversal.route.start_ns,
        end_ns=traversal.route.end_ns,
        T_world_odom=traversal.T_world_odom,
        stamps_ns=stamps_ns,
        T_world_base=traversal.route.T_world_base(stamps_ns),
        sightings=_sightings([image.visibility for image in recorded.images], world),
        fingerprint=recorded.fingerprint,
        camera_ids=camera_ids if len(set(camera_ids)) > 1 else (),
    )


def _sightings(visibility: Sequence[PlaceVisibility], world: World) -> TrueSightings:
    """All rows that fall into an image, their stays numbered in the order of time."""
    ranks = [np.argsort(_in_order(world.stays_of(thing.id))) for thing in world.things]

    def column(name: str, dtype: type[np.generic]) -> Any:
        parts = [getattr(of_image, name)[of_image.in_image > 0] for of_image in visibility]
        return np.concatenate([np.zeros(0, dtype), *parts]).astype(dtype)

    thing, stay = column("thing", np.int64), column("stay", np.int64)
    return TrueSightings(
        frame=np.repeat(
            np.arange(len(visibility)), [int((of_image.in_image > 0).sum()) for of_image in visibility]
        ).astype(np.int64),
        object=thing,
        state=np.array([-1 if s < 0 else ranks[t][s] for t, s in zip(thing, stay, strict=True)], np.int64),
        present=column("present", np.bool_),
        in_image=column("in_image", np.float32),
        visible=column("visible", np.float32),
        pixels=column("pixels", np.int64),
        distance_m=column("distance_m", np.float32),
    )


def _surfaces(world: World, fixtures: Sequence[Seen]) -> tuple[TrueSurface, ...]:
    """What was seen of the building, by label."""
    by_label: dict[str, list[Float32Array]] = {}
    for fixture, (points, seen) in zip(world.fixtures, fixtures, strict=True):
        by_label.setdefault(fixture.label, []).append(points[seen])
    return tuple(TrueSurface(label, np.concatenate(parts)) for label, parts in by_label.items())


def find_changes(objects: Sequence[TrueObject], traversals: Sequence[SimulatedTraversal]) -> tuple[TrueChange, ...]:
    """All that appeared, disappeared or moved from the first traversal's start to the last one's end, in order of time.

    A thing that was away while a traversal went on, and not on its way, disappeared and appeared; else it moved, if its
    centroid did so by more than `LEAST_MOVE_M`.
    """
    if not traversals:
        return ()
    found = [change for thing in objects if thing.kind == "object" for change in _changes_of(thing, traversals)]
    first_ns, last_ns = traversals[0].route.start_ns, traversals[-1].route.end_ns
    within = [change for change in found if change.until_ns > first_ns and change.stamp_ns < last_ns]
    return tuple(sorted(within, key=lambda change: (change.stamp_ns, change.object_id)))


def _changes_of(thing: TrueObject, traversals: Sequence[SimulatedTraversal]) -> Iterator[TrueChange]:
    if not thing.states:
        return
    last = len(thing.states) - 1
    if (since_ns := thing.states[0].since_ns) is not None:
        yield _appeared(thing, 0, since_ns, traversals)
    for k, (before, after) in enumerate(pairwise(thing.states)):
        if before.until_ns is None or after.since_ns is None:
            raise ValueError(f"{thing.id} stands in two places at once")
        distance_m = float(np.linalg.norm(after.centroid - before.centroid))
        if _was_away(thing, before.until_ns, after.since_ns, traversals):
            yield _disappeared(thing, k, before.until_ns, traversals)
            yield _appeared(thing, k + 1, after.since_ns, traversals)
        elif distance_m > LEAST_MOVE_M:
            where = _between(before.until_ns, traversals)
            yield TrueChange("moved", thing.id, k, k + 1, before.until_ns, after.since_ns, distance_m, where)
    if (until_ns := thing.states[last].until_ns) is not None:
        yield _disappeared(thing, last, until_ns, traversals)


def _appeared(thing: TrueObject, state: int, stamp_ns: int, traversals: Sequence[SimulatedTraversal]) -> TrueChange:
    return TrueChange("appeared", thing.id, None, state, stamp_ns, stamp_ns, None, _between(stamp_ns, traversals))


def _disappeared(thing: TrueObject, state: int, stamp_ns: int, traversals: Sequence[SimulatedTraversal]) -> TrueChange:
    return TrueChange("disappeared", thing.id, state, None, stamp_ns, stamp_ns, None, _between(stamp_ns, traversals))


def _was_away(thing: TrueObject, until_ns: int, since_ns: int, traversals: Sequence[SimulatedTraversal]) -> bool:
    """Whether it stood nowhere, and was not on its way either, while a traversal went on."""
    if any(until_ns <= motion.stamps_ns[0] < since_ns for motion in thing.motions):
        return False
    return any(
        until_ns < traversal.route.end_ns and since_ns > traversal.route.start_ns for traversal in traversals
    ) and (since_ns > until_ns)


def _between(stamp_ns: int, traversals: Sequence[SimulatedTraversal]) -> tuple[str, str]:
    """The traversals before and after a time, or twice the one it lies in."""
    for traversal in traversals:
        if traversal.route.start_ns <= stamp_ns < traversal.route.end_ns:
            return traversal.name, traversal.name
    before = [traversal for traversal in traversals if traversal.route.end_ns <= stamp_ns] or [traversals[0]]
    after = [traversal for traversal in traversals if traversal.route.start_ns > stamp_ns] or [traversals[-1]]
    return before[-1].name, after[0].name
