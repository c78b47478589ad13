"""Generates a synthetic building and writes its memory; deterministic in the seed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from supermap_cli.costs.memory.histories import (
    CANDIDATE_SHARE,
    DOUBTED_SHARE,
    EXISTENCE_LOG_ODDS,
    MERGED_SHARE,
    SyntheticHistory,
    link_candidates,
    merge,
    simulate_history,
)
from supermap_cli.costs.memory.relations import edges_of_room
from supermap_cli.costs.memory.rooms import SyntheticObject, furnish, room_count
from supermap_cli.costs.memory.traversals import KEYFRAMES_PER_ROOM, SyntheticTraversal, plan_traversals, visits_by_room
from supermap_cli.memory import rows
from supermap_cli.memory.bulk import BulkWriter
from supermap_cli.memory.values import TraversalStart
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, VoxelCloud
from supermap_cli.types.relations import PredicateParameters

Progress = Callable[[str], None]

_OBSERVATION_COLUMNS = (
    *("keyframe_id", "instance_number", "track_id", "label", "score", "u_min", "v_min", "u_max", "v_max"),
    *("x", "y", "z", "evidence_for", "evidence_against", "hypotheses", "crop_jpeg"),
)
_CAMERA = '{"model":"pinhole","width":640,"height":480,"fx":465.0,"fy":465.0,"cx":319.5,"cy":239.5,"distortion":[]}'
_SAMPLES_PER_CLOUD = 200
"""Voxels drawn for each cloud: about a tenth of what a build keeps, so that a large memory fits on a disk."""
_OBSERVATIONS_PER_CROP = 101
"""One of so many observations keeps an image crop; a prime, so that all keyframes of a visit get crops."""
_VOXEL_M = 0.02
"""Edge of the clouds' voxels in metres. Chosen."""
_CLOUDS = 32
"""Different clouds, shared by all instances."""
_LABEL_BELIEF, _LABEL_COUNTS = (0.93, 0.05, 0.02), (12.0, 1.5, 0.6)
"""Probabilities and log likelihoods of an instance's label and of two others."""
_LABEL_VIEWS, _CROP_QUALITY = 20.0, 50.0
"""Further stored beliefs. As of a well-seen object; no query computes with them."""
_SCORE_RANGE = (0.35, 0.98)
"""Least and greatest score of an observation."""
_BOX_PX, _BOX_CORNER_RANGE_PX = 40, 600
"""Side of all image boxes, and range of their upper left corners, in pixels of a 640 x 480 image."""
_CENTROID_STD_M = 0.01
"""Standard deviation of the observed centroids, metres."""
_EVIDENCE_FOR, _EVIDENCE_AGAINST = 400, 3
"""Points of the object that an observation supports and contradicts."""
_BATCH = 5000
"""Instances written at a time."""


@dataclass(frozen=True)
class WrittenCounts:
    """How many rows of each kind were written."""

    instances: int
    observations: int
    keyframes: int
    traversals: int


def make_memory(path: Path, objects: int, traversals: int, seed: int, progress: Progress) -> WrittenCounts:
    """Write the memory of a building with that many objects into a new file."""
    rng = np.random.default_rng(seed)
    planned = plan_traversals(traversals, room_count(objects))
    visits = visits_by_room(planned)
    writer = BulkWriter(path)
    histories = [simulate_history(obj, visits[obj.room], rng) for obj in furnish(objects, rng) if obj.room in visits]
    _add_merges_and_doubts(histories, rng)
    progress(f"{len(histories)} instances live through {traversals} traversals")
    seen_in: dict[int, list[SyntheticHistory]] = defaultdict(list)
    for history in histories:
        for visit in history.seen:
            seen_in[visit.traversal.number].append(history)
    writer.add("traversal", (_traversal(traversal, len(seen_in[traversal.number])) for traversal in planned))
    _write_histories(writer, histories, rng)
    observations, keyframes = 0, 0
    depth_png, crop_jpeg = _sample_images(rng)
    for traversal in planned:
        writer.add("keyframe", _keyframes(traversal, keyframes, depth_png))
        observations += _write_observations(writer, traversal, seen_in[traversal.number], (keyframes, crop_jpeg), rng)
        keyframes += len(traversal.rooms) * KEYFRAMES_PER_ROOM
        progress(f"{traversal.name}: {observations} observations")
    progress("making indices")
    writer.finish()
    return WrittenCounts(len(histories), observations, keyframes, traversals)


def _add_merges_and_doubts(histories: Sequence[SyntheticHistory], rng: np.random.Generator) -> None:
    """Mark shares of the instances as merged, doubted and identity candidates."""
    draws = rng.random(len(histories))
    for at, (history, other) in enumerate(pairwise(histories)):
        if other.merged_into is not None or history.merged_into is not None:
            continue
        if draws[at] < MERGED_SHARE and other.obj.room == history.obj.room:
            merge(other, history)
        elif draws[at] < MERGED_SHARE + DOUBTED_SHARE:
            history.presence = "doubted"
        elif draws[at] < MERGED_SHARE + DOUBTED_SHARE + CANDIDATE_SHARE and other.obj.label == history.obj.label:
            link_candidates(history, other)


def _write_histories(writer: BulkWriter, histories: Sequence[SyntheticHistory], rng: np.random.Generator) -> None:
    counters: dict[str, int] = defaultdict(int)

    def next_text_id(label: str) -> str:
        counters[label] += 1
        return f"{label.replace(' ', '-')}-{counters[label]}"

    observation_counts = _observation_counts(histories)
    clouds = [_cloud(rng) for _ in range(_CLOUDS)]
    for start in range(0, len(histories), _BATCH):
        part = histories[start : start + _BATCH]
        writer.add(
            "instance",
            (
                _instance(history, next_text_id(history.obj.label), observation_counts[history.obj.number], clouds)
                for history in part
            ),
        )
        states = [(state, at) for history in part for state, at in zip(history.states, history.written_by, strict=True)]
        writer.add("state", (rows.state_values(state, at) for state, at in states))
        writer.add("visit", (rows.visit_values(visit, at) for history in part for at, visit in history.visits))
    for history in histories:
        writer.add("temporal_edge", (rows.temporal_edge_values(edge, at) for at, edge in history.events))
    rooms: dict[int, list[SyntheticHistory]] = defaultdict(list)
    for history in histories:
        if history.merged_into is None:
            rooms[history.obj.room].append(history)
    for inside in rooms.values():
        writer.add("spatial_edge", (rows.spatial_edge_values(edge, at) for edge, at in edges_of_room(inside)))


def _traversal(traversal: SyntheticTraversal, seen: int) -> dict[str, object]:
    start = TraversalStart(
        f"{traversal.name}.mcap",
        f"made-up-{traversal.number}",
        traversal.start_ns,
        traversal.end_ns,
        np.eye(4),
        {"parameters": {"predicates": asdict(PredicateParameters())}},  # as a build says that it kept relations
    )
    known = {"id": traversal.number, "mapped_ns": traversal.end_ns, "status": "complete", "timings": '{"total":1.0}'}
    counts = {"keyframes": len(traversal.rooms) * KEYFRAMES_PER_ROOM, "observations": seen * KEYFRAMES_PER_ROOM}
    return rows.traversal_values(start, traversal.number, traversal.name) | known | counts


def _observation_counts(histories: Sequence[SyntheticHistory]) -> dict[int, int]:
    """Instance number -> observations, those of merged parts included."""
    counts = {history.obj.number: len(history.seen) * KEYFRAMES_PER_ROOM for history in histories}
    for history in histories:
        if history.merged_into is not None:
            counts[history.merged_into] += len(history.seen) * KEYFRAMES_PER_ROOM
    return counts


def _instance(
    history: SyntheticHistory, text_id: str, observations: int, clouds: Sequence[VoxelCloud]
) -> dict[str, object]:
    obj, newest = history.obj, history.states[-1] if history.states else None
    other = "stool" if obj.label == "chair" else "box"
    belief = dict(zip((obj.label, other, "bucket"), _LABEL_BELIEF, strict=True))
    state = EngineState(
        label_counts=dict(zip((obj.label, other, "bucket"), _LABEL_COUNTS, strict=True)),
        label_weight=_LABEL_VIEWS,
        viewpoints={f"{i},1,1": (4, 4, 4.0, 4.0, 1.0) for i in range(6)},
        state_index=max(len(history.states) - 1, 0),
        state_first_seen_ns=history.seen[0].first_ns if newest is None else newest.first_seen_ns,
        state_empty_before_ns=None if newest is None else newest.empty_before_ns,
        gone_ns=None if newest is None else newest.gone_ns,
        best_crop=_CROP_QUALITY,
    )
    record = InstanceRecord(
        number=obj.number,
        label=obj.label,
        label_belief=belief,
        existence_log_odds=EXISTENCE_LOG_ODDS if history.presence == "present" else -EXISTENCE_LOG_ODDS,
        presence=history.presence,
        first_seen_ns=history.seen[0].first_ns,
        last_seen_ns=history.seen[-1].last_ns,
        centroid_map=obj.box.center,
        box=obj.box,
        voxels=_placed_cloud(clouds[obj.number % len(clouds)], obj),
        observations=observations,
        merged_into=history.merged_into,
        engine_state=state.to_document(),
    )
    return rows.instance_values(record, history.seen[0].traversal.number, text_id)


def _keyframes(traversal: SyntheticTraversal, before: int, depth_png: bytes) -> Iterator[dict[str, object]]:
    for at in range(len(traversal.rooms) * KEYFRAMES_PER_ROOM):
        T_map_base = np.eye(4)
        T_map_base[:2, 3] = float(traversal.rooms[at // KEYFRAMES_PER_ROOM]), float(at % KEYFRAMES_PER_ROOM)
        keyframe = KeyframeRecord(
            traversal.stamp_ns(at), T_map_base, T_map_base, _CAMERA, depth_png, 16, None, detected=True
        )
        yield rows.keyframe_values(keyframe, traversal.number) | {"id": before + at + 1}


def _write_observations(
    writer: BulkWriter,
    traversal: SyntheticTraversal,
    seen: Sequence[SyntheticHistory],
    numbering_and_crop: tuple[int, bytes],
    rng: np.random.Generator,
) -> int:
    """Write all observations of a traversal in the order of its keyframes, and return how many.

    `numbering_and_crop`: the number of keyframes before this traversal, and a crop as JPEG.
    """
    before, crop_jpeg = numbering_and_crop
    if not seen:
        return 0
    order = {room: at for at, room in enumerate(traversal.rooms)}
    ranks = np.repeat([order[history.obj.room] for history in seen], KEYFRAMES_PER_ROOM)
    keyframes = np.tile(np.arange(KEYFRAMES_PER_ROOM), len(seen))
    which = np.repeat(np.arange(len(seen)), KEYFRAMES_PER_ROOM)
    sequence = np.lexsort((which, keyframes, ranks))
    keyframe_ids = (before + 1 + ranks * KEYFRAMES_PER_ROOM + keyframes)[sequence].tolist()
    observed = [seen[at] for at in which[sequence].tolist()]
    n = len(observed)
    scores = np.round(rng.uniform(*_SCORE_RANGE, n), 4).tolist()
    corners = np.round(rng.uniform(0, _BOX_CORNER_RANGE_PX, (n, 2)), 2)
    boxes = np.hstack((corners, corners + _BOX_PX)).tolist()
    centers = np.array([history.obj.box.center for history in seen])[which[sequence]]
    places = np.round(centers + rng.normal(0, _CENTROID_STD_M, (n, 3)), 4).tolist()
    crops = [
        None if index % _OBSERVATIONS_PER_CROP else crop_jpeg
        for index in (which[sequence] * KEYFRAMES_PER_ROOM + keyframes[sequence]).tolist()
    ]
    writer.add_values(
        "observation",
        _OBSERVATION_COLUMNS,
        (
            (
                frame,
                history.obj.number,
                history.obj.number,
                history.obj.label,
                score,
                *box,
                *place,
                _EVIDENCE_FOR,
                _EVIDENCE_AGAINST,
                hypotheses,
                crop,
            )
            for frame, history, score, box, place, hypotheses, crop in zip(
                keyframe_ids, observed, scores, boxes, places, _hypotheses_json(observed, scores), crops, strict=True
            )
        ),
    )
    return n


def _hypotheses_json(observed: Sequence[SyntheticHistory], scores: Sequence[float]) -> Iterator[str]:
    for history, score in zip(observed, scores, strict=True):
        yield f'[["{history.obj.label}",{score}],["bucket",{round((1 - score) / 2, 4)}],["box",0.01]]'


def _cloud(rng: np.random.Generator) -> VoxelCloud:
    keys = np.unique(rng.integers(-8, 8, (_SAMPLES_PER_CLOUD, 3)), axis=0).astype(np.int32)
    n = len(keys)
    reals = [np.round(rng.uniform(0.5, 4, n), 1).astype(np.float32) for _ in range(3)]
    return VoxelCloud(_VOXEL_M, keys, reals[0], reals[1], reals[2], rng.integers(0, 255, (n, 3)).astype(np.uint8))


def _placed_cloud(cloud: VoxelCloud, obj: SyntheticObject) -> VoxelCloud:
    steps = np.rint(obj.box.center / cloud.voxel_m).astype(np.int32)
    return VoxelCloud(cloud.voxel_m, cloud.keys + steps, cloud.log_odds, cloud.inside, cloud.outside, cloud.rgb)


def _sample_images(rng: np.random.Generator) -> tuple[bytes, bytes]:
    """A depth image of 40 x 30 pixels as PNG and a crop of 48 x 48 pixels as JPEG (2 kB)."""
    import cv2  # noqa: PLC0415 - keeps start-up light

    depth_mm = (2000 + 20 * rng.standard_normal((30, 40))).astype(np.uint16)
    crop = rng.integers(0, 255, (48, 48, 3)).astype(np.uint8)
    return cv2.imencode(".png", depth_mm)[1].tobytes(), cv2.imencode(".jpg", crop)[1].tobytes()
