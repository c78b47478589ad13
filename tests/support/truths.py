"""Small ground truths for tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform, rotation_from_quaternion_xyzw
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

EMPTY = GroundTruth("nothing", 0, (), (), (), (), ())

_lengths = st.floats(-50, 50, allow_nan=False)
_stamps = st.integers(0, 2**62)
_texts = st.text(min_size=1, max_size=8)
_labels = st.sampled_from(["chair", "mug", "Blumentopf", "椅子"])


@st.composite
def _transforms(draw: st.DrawFn) -> np.ndarray:
    q = draw(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 0.01))
    return make_transform(rotation_from_quaternion_xyzw(q), draw(_points(1))[0])


def _points(count: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(_lengths, min_size=3 * count, max_size=3 * count).map(lambda xs: np.array(xs, float).reshape(-1, 3))


@st.composite
def _states(draw: st.DrawFn) -> TrueState:
    size = np.abs(draw(_points(1))[0])
    return TrueState(
        draw(st.none() | _stamps),
        draw(st.none() | _stamps),
        draw(_transforms()),
        Box3D(draw(_points(1))[0], size, draw(st.floats(-3.2, 3.2))),
        draw(_points(1))[0],
        draw(st.none() | _texts),
    )


@st.composite
def _objects(draw: st.DrawFn, object_id: str) -> TrueObject:
    surface = draw(st.integers(0, 6).flatmap(_points)).astype(np.float32)
    seen = draw(st.lists(st.booleans(), min_size=len(surface), max_size=len(surface)))
    stamps = np.array(sorted(draw(st.sets(_stamps, max_size=3))), np.int64)
    motion = TrueMotion(stamps, draw(_points(len(stamps))))
    return TrueObject(
        object_id,
        draw(_labels),
        draw(st.sampled_from(["object", "person"])),
        tuple(draw(st.lists(_states(), max_size=2))),
        (motion,) if len(stamps) else (),
        surface,
        np.array(seen, bool),
    )


@st.composite
def _traversals(draw: st.DrawFn, name: str, objects: tuple[TrueObject, ...]) -> TrueTraversal:
    stamps = np.array(sorted(draw(st.sets(_stamps, max_size=3))), np.int64)
    rows = draw(st.integers(0, 4)) if objects and len(stamps) else 0
    which = [draw(st.integers(0, len(objects) - 1)) for _ in range(rows)]
    shares = [draw(st.floats(0, 1, width=32)) for _ in range(rows)]
    sightings = TrueSightings(
        frame=np.array([draw(st.integers(0, len(stamps) - 1)) for _ in range(rows)], np.int64),
        object=np.array(which, np.int64),
        state=np.array([draw(st.integers(-1, len(objects[k].states) - 1)) for k in which], np.int64),
        present=np.array([draw(st.booleans()) for _ in range(rows)], bool),
        in_image=np.array(shares, np.float32),
        visible=np.array(shares, np.float32) / 2,
        pixels=np.array([draw(st.integers(0, 10**6)) for _ in range(rows)], np.int64),
        distance_m=np.array(shares, np.float32) * 9,
    )
    poses = [draw(_transforms()) for _ in stamps]
    return TrueTraversal(
        name,
        f"{name}.mcap",
        draw(_stamps),
        draw(_stamps),
        draw(_transforms()),
        stamps,
        np.array(poses, float).reshape(-1, 4, 4),
        sightings,
    )


@st.composite
def truths(draw: st.DrawFn) -> GroundTruth:
    """Any truth whose indices and ids point at something."""
    objects = tuple(draw(_objects(f"thing-{k}")) for k in range(draw(st.integers(0, 3))))
    ids = st.sampled_from([obj.id for obj in objects]) if objects else st.nothing()
    change = st.builds(
        TrueChange,
        st.sampled_from(["appeared", "disappeared", "moved"]),
        ids,
        st.none() | st.integers(0, 3),
        st.none() | st.integers(0, 3),
        _stamps,
        _stamps,
        st.none() | st.floats(0, 9),
        st.tuples(_texts, _texts),
    )
    answers = st.lists(ids, unique=True, max_size=3).map(tuple) if objects else st.just(())
    return GroundTruth(
        draw(_texts),
        draw(st.integers(0, 2**31)),
        tuple(draw(_traversals(name, objects)) for name in ("monday", "tuesday")[: draw(st.integers(0, 2))]),
        objects,
        tuple(TrueSurface("wall", draw(_points(2)).astype(np.float32)) for _ in range(draw(st.integers(0, 2)))),
        tuple(draw(st.lists(change, max_size=2))) if objects else (),
        tuple(draw(st.lists(st.builds(TrueQuestion, _texts, answers), max_size=2))),
    )
