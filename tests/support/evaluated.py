"""Small hand-made truths and the maps of them: perfect, empty, doubled, shifted, mislabelled. For tests of the metrics.

Everything is a cube of 0.4 m, so that the IoU of a cube shifted by d along an axis is (0.4 - d) / (0.4 + d). Time is
counted in seconds; an image is taken at every full second of a traversal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from supermap_cli.evaluation.estimate import (
    EstimatedAnswer,
    EstimatedChange,
    EstimatedMap,
    EstimatedObject,
    EstimatedObservation,
    EstimatedState,
)
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.types.truth import (
    GroundTruth,
    TrueChange,
    TrueMotion,
    TrueObject,
    TrueQuestion,
    TrueSightings,
    TrueState,
    TrueSurface,
    TrueTraversal,
)

SECOND = 1_000_000_000
SIDE_M = 0.4
SPACING_M = 0.05


def ns(seconds):
    return None if seconds is None else round(seconds * SECOND)


def cube_box(center):
    return Box3D(np.array(center, np.float64), np.full(3, SIDE_M), 0.0)


def cube_surface():
    """Samples (384, 3) of a cube's six faces, in a regular pattern, about its middle."""
    steps = (np.arange(8) + 0.5) * SPACING_M - SIDE_M / 2
    u, v = (axis.ravel() for axis in np.meshgrid(steps, steps))
    face = np.full(len(u), SIDE_M / 2)
    return np.concatenate([np.roll(np.column_stack([u, v, s * face]), k, axis=1) for k in range(3) for s in (-1, 1)])


def stay(center, since=None, until=None):
    """A cube's stay about `center` in [since, until) seconds."""
    middle = np.array(center, np.float64)
    return TrueState(ns(since), ns(until), make_transform(np.eye(3), middle), cube_box(middle), middle)


def thing(object_id, *stays, label=None):
    """A cube; its label is its id without what follows the last dash."""
    surface = cube_surface().astype(np.float32)
    label = object_id.rsplit("-", 1)[0] if label is None else label
    return TrueObject(object_id, label, "object", stays, (), surface, np.ones(len(surface), dtype=bool))


def person(object_id, *walks):
    """Who walks; each walk is given by the seconds and the places (x, y) it leads through."""
    ways = [
        TrueMotion(np.array([ns(at) for at in seconds]), np.column_stack([xy, [0.9] * len(xy)]))
        for seconds, xy in walks
    ]
    surface = cube_surface().astype(np.float32)
    return TrueObject(object_id, "person", "person", (), tuple(ways), surface, np.ones(len(surface), dtype=bool))


@dataclass(frozen=True)
class Sight:
    """What an image shows of a place; the default is everything."""

    visible: float = 1.0
    pixels: int = 1000


def traversal(name, start, end, objects, look=lambda object_id, state, second: Sight()):
    """A recording of [start, end] seconds; `look` says what a second's image shows of a place (`None`: nothing)."""
    rows = []
    for frame, second in enumerate(range(start, end + 1)):
        for number, obj in enumerate(objects):
            moving = any(way.stamps_ns[0] <= ns(second) <= way.stamps_ns[-1] for way in obj.motions)
            if moving and (sight := look(obj.id, -1, second)) is not None:
                rows.append((frame, number, -1, True, sight.visible, sight.pixels))
            for index, state in enumerate(obj.states):
                if (sight := look(obj.id, index, second)) is not None:
                    present = state.covers(ns(second))
                    pixels = sight.pixels if present else 0
                    rows.append((frame, number, index, present, sight.visible, pixels))
    columns = list(zip(*rows, strict=True)) or [()] * 6
    frames = end + 1 - start
    return TrueTraversal(
        name=name,
        recording=f"{name}.mcap",
        start_ns=ns(start),
        end_ns=ns(end),
        T_world_odom=np.eye(4),
        stamps_ns=np.arange(start, end + 1, dtype=np.int64) * SECOND,
        T_world_base=np.tile(np.eye(4), (frames, 1, 1)),
        sightings=TrueSightings(
            frame=np.array(columns[0], np.int64),
            object=np.array(columns[1], np.int64),
            state=np.array(columns[2], np.int64),
            present=np.array(columns[3], dtype=bool),
            in_image=np.ones(len(rows), np.float32),
            visible=np.array(columns[4], np.float32),
            pixels=np.array(columns[5], np.int64),
            distance_m=np.full(len(rows), 2.0, np.float32),
        ),
    )


def world(objects, traversals, *, changes=(), questions=(), surfaces=()):
    return GroundTruth("hand-made", 0, tuple(traversals), tuple(objects), tuple(surfaces), changes, questions)


def change(kind, object_id, from_state, to_state, at, between, distance_m=None):
    return TrueChange(kind, object_id, from_state, to_state, ns(at), ns(at), distance_m, between)


def wall(x, *, label="wall", low=-1.0, high=1.0):
    """An upright wall, y and z from `low` to `high`, samples every 2.5 cm."""
    steps = np.arange(low, high, 0.025) + 0.0125
    y, z = (axis.ravel() for axis in np.meshgrid(steps, steps))
    return TrueSurface(label, np.column_stack([np.full(len(y), x), y, z]).astype(np.float32))


def still_life():
    """One traversal of 0 to 9 s, four cubes that never move: two chairs 2 m apart, a table, a plant."""
    objects = (
        thing("chair-1", stay((0, 0, 0.2))),
        thing("chair-2", stay((2, 0, 0.2))),
        thing("table-1", stay((0, 2, 0.2))),
        thing("plant-1", stay((2, 2, 0.2))),
    )
    questions = (
        TrueQuestion("the chairs", ("chair-1", "chair-2")),
        TrueQuestion("the table", ("table-1",)),
        TrueQuestion("a piano", ()),
    )
    return world(objects, [traversal("monday", 0, 9, objects)], questions=questions)


def two_days():
    """Traversals of 0 to 9 s and 100 to 109 s. In between a plant goes, a cart comes, and a bag moves by 3 m; a chair
    and a table stay.
    """
    days = ("monday", "tuesday")
    objects = (
        thing("chair-1", stay((0, 0, 0.2))),
        thing("table-1", stay((2, 0, 0.2))),
        thing("plant-1", stay((0, 2, 0.2), until=50)),
        thing("cart-1", stay((2, 2, 0.2), since=50)),
        thing("bag-1", stay((4, 0, 0.2), until=50), stay((4, 3, 0.2), since=50)),
    )
    changes = (
        change("disappeared", "plant-1", 0, None, 50, days),
        change("appeared", "cart-1", None, 0, 50, days),
        change("moved", "bag-1", 0, 1, 50, days, 3.0),
    )
    questions = (TrueQuestion("where was the plant", ("plant-1",)), TrueQuestion("the bag", ("bag-1",)))
    traversals = [traversal("monday", 0, 9, objects), traversal("tuesday", 100, 109, objects)]
    return world(objects, traversals, changes=changes, questions=questions)


def keyframes(truth):
    return np.concatenate([traversal.stamps_ns for traversal in truth.traversals])


def instance_id(object_id):
    return f"map-{object_id}"


def estimated_state(state, label, stamps_ns):
    """What a map that sees everything at once has of a true state; `None` where no image shows it."""
    there = [stamp for stamp in stamps_ns.tolist() if state.covers(stamp)]
    if not there:
        return None
    later = [stamp for stamp in stamps_ns.tolist() if stamp > there[-1]]
    earlier = [stamp for stamp in stamps_ns.tolist() if stamp < there[0]]
    gone_ns, empty_ns = min(later, default=None), max(earlier, default=None)
    return EstimatedState(there[0], there[-1], gone_ns, empty_ns, state.centroid, state.box, label)


def estimated_object(obj, stamps_ns):
    states = tuple(s for state in obj.states if (s := estimated_state(state, obj.label, stamps_ns)) is not None)
    if not states:
        return None
    newest = obj.states[-1] if len(obj.states) == len(states) else obj.states[0]
    observations = tuple(
        EstimatedObservation(stamp, state.centroid)
        for stamp in stamps_ns.tolist()
        for state in obj.states
        if state.covers(stamp)
    )
    return EstimatedObject(
        id=instance_id(obj.id),
        label=obj.label,
        presence="present" if states[-1].gone_ns is None else "absent",
        confidence=0.9,
        label_probability=1.0,
        centroid=states[-1].centroid,
        box=states[-1].box,
        points=obj.surface_world(newest),
        states=states,
        observations=observations,
    )


def perfect_map(truth):
    """The map that holds exactly the truth; an object keeps its identity, whatever becomes of it."""
    stamps_ns = keyframes(truth)
    objects = tuple(o for obj in truth.objects if (o := estimated_object(obj, stamps_ns)) is not None)
    return EstimatedMap(
        objects=objects,
        changes=tuple(reported(change, truth) for change in truth.changes),
        answers=tuple(EstimatedAnswer(q.text, tuple(map(instance_id, q.answer))) for q in truth.questions),
        keyframes_ns=stamps_ns,
        T_world_map=np.eye(4),
        alignment_rmse_m={traversal.name: 0.0 for traversal in truth.traversals},
    )


def reported(true, truth):
    """A true change as a perfect diff reports it."""
    states = truth.object(true.object_id).states
    before = None if true.from_state is None else states[true.from_state].centroid
    after = None if true.to_state is None else states[true.to_state].centroid
    label = truth.object(true.object_id).label
    return EstimatedChange(true.kind, instance_id(true.object_id), label, before, after, true.distance_m)


def empty_map(truth):
    """A map that has looked at everything and found nothing."""
    return replace(perfect_map(truth), objects=(), changes=(), answers=())


def with_objects(estimate, objects):
    return replace(estimate, objects=tuple(objects))


def altered(estimate, object_id, alter):
    """The map in which one instance is altered; `None` takes it out."""
    objects = [alter(instance) if instance.id == instance_id(object_id) else instance for instance in estimate.objects]
    return with_objects(estimate, [instance for instance in objects if instance is not None])


def shifted_object(instance, offset):
    """An instance that lies beside its true place, in all its states."""
    offset = np.array(offset, np.float64)
    return replace(
        instance,
        centroid=instance.centroid + offset,
        box=replace(instance.box, center=instance.box.center + offset),
        points=instance.points + offset,
        states=tuple(
            replace(s, centroid=s.centroid + offset, box=replace(s.box, center=s.box.center + offset))
            for s in instance.states
        ),
        observations=tuple(replace(o, centroid=o.centroid + offset) for o in instance.observations),
    )


def shifted_map(estimate, offset):
    return with_objects(estimate, [shifted_object(instance, offset) for instance in estimate.objects])


def relabelled(instance, label):
    return replace(instance, label=label, states=tuple(replace(state, label=label) for state in instance.states))


def doubled(estimate: EstimatedMap, object_ids: Sequence[str] | None = None):
    """The map that holds things twice, the second time less surely; the two share a thing's points, one by one."""
    chosen = {instance.id for instance in estimate.objects} if object_ids is None else set(map(instance_id, object_ids))
    objects = []
    for instance in estimate.objects:
        if instance.id in chosen:
            objects.append(replace(instance, points=instance.points[::2]))
            objects.append(replace(instance, id=f"{instance.id}-again", points=instance.points[1::2], confidence=0.5))
        else:
            objects.append(instance)
    return with_objects(estimate, objects)
