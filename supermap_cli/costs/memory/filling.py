"""Makes a building up and writes its memory: everything follows from the seed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from supermap_cli.costs.memory.building import Thing, furnish, rooms_for
from supermap_cli.costs.memory.lives import CANDIDATE, DOUBTED, MERGED, Life, link, live, merge
from supermap_cli.costs.memory.relations import edges_of_room
from supermap_cli.costs.memory.visits import LOOKS, Course, courses, visits_by_room
from supermap_cli.memory import rows
from supermap_cli.memory.bulk import BulkWriter
from supermap_cli.memory.values import TraversalStart
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, VoxelCloud

Progress = Callable[[str], None]

_OBSERVED = (
    *("keyframe_id", "instance_number", "track_id", "label", "score", "u_min", "v_min", "u_max", "v_max"),
    *("x", "y", "z", "evidence_for", "evidence_against", "hypotheses", "crop_jpeg"),
)
_CAMERA = '{"model":"pinhole","width":640,"height":480,"fx":465.0,"fy":465.0,"cx":319.5,"cy":239.5,"distortion":[]}'
_VOXELS = 200
"""Of an instance: a tenth of what a build keeps, so that a large memory fits a disk."""


@dataclass(frozen=True)
class Made:
    """How much of what a made-up memory holds."""

    instances: int
    observations: int
    keyframes: int
    traversals: int


def make_memory(path: Path, things: int, traversals: int, seed: int, progress: Progress) -> Made:
    """Write the memory of a building with that many things into a new file."""
    rng = np.random.default_rng(seed)
    planned = courses(traversals, rooms_for(things))
    visits = visits_by_room(planned)
    writer = BulkWriter(path)
    lives = [live(thing, visits[thing.room], rng) for thing in furnish(things, rng) if thing.room in visits]
    _blur(lives, rng)
    progress(f"{len(lives)} instances live through {traversals} traversals")
    seen_in: dict[int, list[Life]] = defaultdict(list)
    for life in lives:
        for visit in life.seen:
            seen_in[visit.course.number].append(life)
    writer.add("traversal", (_traversal(course, len(seen_in[course.number])) for course in planned))
    _write_lives(writer, lives, rng)
    observations, keyframes = 0, 0
    depth_png, crop_jpeg = _pictures(rng)
    for course in planned:
        writer.add("keyframe", _keyframes(course, keyframes, depth_png))
        observations += _observe(writer, course, seen_in[course.number], (keyframes, crop_jpeg), rng)
        keyframes += len(course.rooms) * LOOKS
        progress(f"{course.name}: {observations} observations")
    progress("making indices")
    writer.finish()
    return Made(len(lives), observations, keyframes, traversals)


def _blur(lives: Sequence[Life], rng: np.random.Generator) -> None:
    """Some are parts of their neighbours, some were perhaps never there, some may be one with another."""
    chances = rng.random(len(lives))
    for at, (life, other) in enumerate(pairwise(lives)):
        if other.merged_into is not None or life.merged_into is not None:
            continue
        if chances[at] < MERGED and other.thing.room == life.thing.room:
            merge(other, life)
        elif chances[at] < MERGED + DOUBTED:
            life.presence = "doubted"
        elif chances[at] < MERGED + DOUBTED + CANDIDATE and other.thing.label == life.thing.label:
            link(life, other)


def _write_lives(writer: BulkWriter, lives: Sequence[Life], rng: np.random.Generator) -> None:
    counters: dict[str, int] = defaultdict(int)

    def named(label: str) -> str:
        counters[label] += 1
        return f"{label.replace(' ', '-')}-{counters[label]}"

    looks = _looks(lives)
    clouds = [_cloud(rng) for _ in range(32)]
    for start in range(0, len(lives), 5000):
        part = lives[start : start + 5000]
        writer.add(
            "instance", (_instance(life, named(life.thing.label), looks[life.thing.number], clouds) for life in part)
        )
        states = [(state, at) for life in part for state, at in zip(life.states, life.written_by, strict=True)]
        writer.add("state", (rows.state_values(state, at) for state, at in states))
        writer.add("visit", (rows.visit_values(visit, at) for life in part for at, visit in life.visits))
    for life in lives:
        writer.add("temporal_edge", (rows.temporal_edge_values(edge, at) for at, edge in life.events))
    rooms: dict[int, list[Life]] = defaultdict(list)
    for life in lives:
        if life.merged_into is None:
            rooms[life.thing.room].append(life)
    for inside in rooms.values():
        writer.add("spatial_edge", (rows.spatial_edge_values(edge, at) for edge, at in edges_of_room(inside)))


def _traversal(course: Course, seen: int) -> dict[str, object]:
    start = TraversalStart(f"{course.name}.mcap", f"made-up-{course.number}", course.start_ns, course.end_ns, np.eye(4))
    known = {"id": course.number, "mapped_ns": course.end_ns, "status": "complete", "timings": '{"total":1.0}'}
    counts = {"keyframes": len(course.rooms) * LOOKS, "observations": seen * LOOKS}
    return rows.traversal_values(start, course.number, course.name) | known | counts


def _looks(lives: Sequence[Life]) -> dict[int, int]:
    """How often each was observed, with what is a part of it."""
    looks = {life.thing.number: len(life.seen) * LOOKS for life in lives}
    for life in lives:
        if life.merged_into is not None:
            looks[life.merged_into] += len(life.seen) * LOOKS
    return looks


def _instance(life: Life, text_id: str, looks: int, clouds: Sequence[VoxelCloud]) -> dict[str, object]:
    thing, newest = life.thing, life.states[-1] if life.states else None
    other = "stool" if thing.label == "chair" else "box"
    belief = {thing.label: 0.93, other: 0.05, "bucket": 0.02}
    state = EngineState(
        label_logs={thing.label: -0.1, other: -3.0, "bucket": -4.0},
        unseen_log=-60.0,
        looks=20.0,
        viewpoints={f"{i},1,1": (4, 4, 4.0) for i in range(6)},
        state_index=max(len(life.states) - 1, 0),
        state_first_seen_ns=life.seen[0].first_ns if newest is None else newest.first_seen_ns,
        state_empty_before_ns=None if newest is None else newest.empty_before_ns,
        gone_ns=None if newest is None else newest.gone_ns,
        best_crop=50.0,
    )
    record = InstanceRecord(
        number=thing.number,
        label=thing.label,
        label_belief=belief,
        existence_log_odds=3.0 if life.presence == "present" else -3.0,
        presence=life.presence,
        first_seen_ns=life.seen[0].first_ns,
        last_seen_ns=life.seen[-1].last_ns,
        centroid_map=thing.box.center,
        box=thing.box,
        voxels=_placed(clouds[thing.number % len(clouds)], thing),
        observations=looks,
        merged_into=life.merged_into,
        engine_state=state.to_document(),
    )
    return rows.instance_values(record, life.seen[0].course.number, text_id)


def _keyframes(course: Course, before: int, depth_png: bytes) -> Iterator[dict[str, object]]:
    for at in range(len(course.rooms) * LOOKS):
        T_map_base = np.eye(4)
        T_map_base[:2, 3] = float(course.rooms[at // LOOKS]), float(at % LOOKS)
        keyframe = KeyframeRecord(
            course.stamp_ns(at), T_map_base, T_map_base, _CAMERA, depth_png, 16, None, detected=True
        )
        yield rows.keyframe_values(keyframe, course.number) | {"id": before + at + 1}


def _observe(
    writer: BulkWriter, course: Course, seen: Sequence[Life], given: tuple[int, bytes], rng: np.random.Generator
) -> int:
    """All observations of a traversal, in the order of its keyframes; given how many there are before, and a crop."""
    before, crop_jpeg = given
    if not seen:
        return 0
    order = {room: at for at, room in enumerate(course.rooms)}
    ranks = np.repeat([order[life.thing.room] for life in seen], LOOKS)
    looks = np.tile(np.arange(LOOKS), len(seen))
    which = np.repeat(np.arange(len(seen)), LOOKS)
    sequence = np.lexsort((which, looks, ranks))
    keyframe_ids = (before + 1 + ranks * LOOKS + looks)[sequence].tolist()
    who = [seen[at] for at in which[sequence].tolist()]
    n = len(who)
    scores = np.round(rng.uniform(0.35, 0.98, n), 4).tolist()
    corners = np.round(rng.uniform(0, 600, (n, 2)), 2)
    boxes = np.hstack((corners, corners + 40)).tolist()
    centers = np.array([life.thing.box.center for life in seen])[which[sequence]]
    places = np.round(centers + rng.normal(0, 0.01, (n, 3)), 4).tolist()
    crops = [None if look % 101 else crop_jpeg for look in (which[sequence] * LOOKS + looks[sequence]).tolist()]
    writer.add_values(
        "observation",
        _OBSERVED,
        (
            (frame, life.thing.number, life.thing.number, life.thing.label, score, *box, *place, 400, 3, said, crop)
            for frame, life, score, box, place, said, crop in zip(
                keyframe_ids, who, scores, boxes, places, _said(who, scores), crops, strict=True
            )
        ),
    )
    return n


def _said(who: Sequence[Life], scores: Sequence[float]) -> Iterator[str]:
    for life, score in zip(who, scores, strict=True):
        yield f'[["{life.thing.label}",{score}],["bucket",{round((1 - score) / 2, 4)}],["box",0.01]]'


def _cloud(rng: np.random.Generator) -> VoxelCloud:
    keys = np.unique(rng.integers(-8, 8, (_VOXELS, 3)), axis=0).astype(np.int32)
    n = len(keys)
    reals = [np.round(rng.uniform(0.5, 4, n), 1).astype(np.float32) for _ in range(3)]
    return VoxelCloud(0.02, keys, reals[0], reals[1], reals[2], rng.integers(0, 255, (n, 3)).astype(np.uint8))


def _placed(cloud: VoxelCloud, thing: Thing) -> VoxelCloud:
    steps = np.rint(thing.box.center / cloud.voxel_m).astype(np.int32)
    return VoxelCloud(cloud.voxel_m, cloud.keys + steps, cloud.log_odds, cloud.inside, cloud.outside, cloud.rgb)


def _pictures(rng: np.random.Generator) -> tuple[bytes, bytes]:
    """40 x 30 pixels of a depth image as PNG, and a crop as JPEG of 2 kB: a build keeps the best ones of an instance,
    and here one of a hundred.
    """
    import cv2  # noqa: PLC0415 - keeps start-up light

    depth_mm = (2000 + 20 * rng.standard_normal((30, 40))).astype(np.uint16)
    crop = rng.integers(0, 255, (48, 48, 3)).astype(np.uint8)
    return cv2.imencode(".png", depth_mm)[1].tobytes(), cv2.imencode(".jpg", crop)[1].tobytes()
