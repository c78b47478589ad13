"""What is true of the small kitchen of `kitchen`: its map is right in all but what the tests change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from supermap_cli.geometry.se3 import make_transform
from supermap_cli.truth_file import write_truth
from supermap_cli.types.truth import (
    GroundTruth,
    TrueChange,
    TrueObject,
    TrueQuestion,
    TrueSightings,
    TrueState,
    TrueSurface,
    TrueTraversal,
)
from support import memories as m

MONDAY = tuple(float(second) for second in range(101))
TUESDAY = tuple(float(second) for second in range(1000, 1101))
TABLE_SIZE, CHAIR_SIZE, CUP_SIZE, VASE_SIZE = (1.9, 0.9, 0.75), m.SIZE, (0.08, 0.08, 0.1), (0.15, 0.15, 0.3)


def kitchen_truth(seconds: Sequence[Sequence[float]] = (MONDAY, TUESDAY)) -> GroundTruth:
    """The table stays; between the days the cup goes, a chair moves, and a vase comes."""
    objects = (
        thing("table-a", "dining table", TABLE_SIZE, ((0, 0, 0.375), None, None)),
        thing("cup-a", "cup", CUP_SIZE, ((0.5, 0, 0.8), None, 500)),
        thing("chair-a", "chair", CHAIR_SIZE, ((0, 1.0, 0.5), None, 500), ((-3.0, 3.0, 0.5), 600, None)),
        thing("vase-a", "vase", VASE_SIZE, ((-0.5, 0, 0.9), 600, None)),
    )
    between = ("monday", "tuesday")
    return GroundTruth(
        scenario="kitchen",
        seed=7,
        traversals=tuple(
            traversal(name, duration_s, objects)
            for name, duration_s in zip(("monday", "tuesday"), seconds, strict=False)
        ),
        objects=objects,
        surfaces=(TrueSurface("wall", np.float32([[-5, y, 1] for y in np.linspace(-2, 4, 60)])),),
        changes=(
            TrueChange("disappeared", "cup-a", 0, None, m.ns(500), m.ns(500), None, between),
            TrueChange("moved", "chair-a", 0, 1, m.ns(500), m.ns(600), 3.606, between),
            TrueChange("appeared", "vase-a", None, 0, m.ns(600), m.ns(600), None, between),
        ),
        questions=(TrueQuestion("vase on the table", ("vase-a",)), TrueQuestion("piano", ())),
    )


def write_kitchen_truth(path: Path, truth: GroundTruth | None = None) -> Path:
    write_truth(truth or kitchen_truth(), path)
    return path


def thing(name: str, label: str, size: m.Point, *stays: tuple[m.Point, float | None, float | None]) -> TrueObject:
    """An object and its stays: (centre, since, until). Its surface is a cloud of points in its box."""
    cloud = (np.random.default_rng(0).random((400, 3)) - 0.5) * size
    states = tuple(
        TrueState(
            m.maybe_ns(since),
            m.maybe_ns(until),
            make_transform(np.eye(3), center),
            m.upright_box(center, size),
            np.array(center, float),
        )
        for center, since, until in stays
    )
    return TrueObject(name, label, "object", states, (), cloud.astype(np.float32), np.ones(400, bool))


def traversal(name: str, seconds: Sequence[float], objects: Sequence[TrueObject]) -> TrueTraversal:
    """A robot that stands still at the map's origin and sees every place in every image."""
    stamps_ns = np.array([m.ns(duration_s) for duration_s in seconds])
    rows = [
        (frame, number, index, state.covers(stamp_ns))
        for frame, stamp_ns in enumerate(stamps_ns.tolist())
        for number, obj in enumerate(objects)
        for index, state in enumerate(obj.states)
    ]
    frame, number, index, present = (np.array(column) for column in zip(*rows, strict=True))
    all_of_it = np.ones(len(rows), np.float32)
    sightings = TrueSightings(
        frame, number, index, present, all_of_it, all_of_it, np.where(present, 5000, 0), 2 * all_of_it
    )
    poses = np.tile(np.eye(4), (len(seconds), 1, 1))
    return TrueTraversal(
        name, f"{name}.mcap", int(stamps_ns[0]), int(stamps_ns[-1]), np.eye(4), stamps_ns, poses, sightings
    )
