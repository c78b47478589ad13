"""Makes map memories from values, for tests of the memory and of questions. Times are given in seconds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.cameras import PinholeCamera, camera_to_json
from supermap_cli.memory import MapStore, TraversalStart, open_store
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import (
    InstanceRecord,
    KeyframeRecord,
    MapDelta,
    Observation,
    Presence,
    SpatialEdge,
    StateRecord,
    TemporalEdge,
    TemporalKind,
    Visit,
    VoxelCloud,
)
from supermap_cli.types.sensing import MAIN_CAMERA
from support.databases import query, run_sql  # noqa: F401 - beside what makes memories

EPOCH_S = 1_767_603_600  # 2026-01-05T09:00:00Z, a Monday
SIZE = (0.5, 0.5, 1.0)

CAMERA = camera_to_json(PinholeCamera(64, 48, 50.0, 50.0, 31.5, 23.5))
DEPTH_PNG = cv2.imencode(".png", np.full((6, 8), 2000, np.uint16))[1].tobytes()
"""Every eighth pixel of the camera sees something 2 m ahead."""

Point = tuple[float, float, float]


def ns(seconds: float) -> int:
    """Sensor time `seconds` after the epoch of these tests."""
    return EPOCH_S * 10**9 + round(seconds * 1e9)


def maybe_ns(seconds: float | None) -> int | None:
    return None if seconds is None else ns(seconds)


def upright_box(center: Point, size: Point = SIZE, yaw: float = 0.0) -> Box3D:
    return Box3D(np.array(center, dtype=float), np.array(size, dtype=float), yaw)


def voxels(n: int = 3) -> VoxelCloud:
    keys = np.arange(3 * n, dtype=np.int32).reshape(n, 3)
    ones = np.ones(n, np.float32)
    return VoxelCloud(0.02, keys, ones * 2, ones, ones * 0, np.full((n, 3), 128, np.uint8))


def instance(
    number: int,
    label: str,
    center: Point = (0.0, 0.0, 0.5),
    size: Point = SIZE,
    *,
    seen: tuple[float, float] = (0, 10),
    presence: Presence = "present",
    merged_into: int | None = None,
    observations: int = 6,
) -> InstanceRecord:
    return InstanceRecord(
        number=number,
        label=label,
        label_belief={label: 0.9, "other": 0.1},
        existence_log_odds=3.0 if presence == "present" else -3.0,
        presence=presence,
        first_seen_ns=ns(seen[0]),
        last_seen_ns=ns(seen[1]),
        centroid_map=np.array(center, dtype=float),
        box=upright_box(center, size),
        voxels=voxels(),
        observations=observations,
        merged_into=merged_into,
        engine_state=EngineState(
            {label: 0.9}, 1.25, {"1,1,1": (1, 1, 1.0)}, 0, ns(seen[0]), None, None, 0.0
        ).to_document(),
    )


def state(
    number: int,
    index: int,
    seen: tuple[float, float],
    center: Point = (0.0, 0.0, 0.5),
    size: Point = SIZE,
    *,
    gone: float | None = None,
    empty_before: float | None = None,
    label: str = "chair",
    confidence: float = 0.9,
) -> StateRecord:
    return StateRecord(
        object_number=number,
        index=index,
        first_seen_ns=ns(seen[0]),
        last_seen_ns=ns(seen[1]),
        gone_ns=maybe_ns(gone),
        empty_before_ns=maybe_ns(empty_before),
        centroid_map=np.array(center, dtype=float),
        box=upright_box(center, size),
        label=label,
        confidence=confidence,
    )


def keyframe(at: float, x: float = 0.0, camera_id: str = MAIN_CAMERA) -> KeyframeRecord:
    T = np.eye(4)
    T[0, 3] = x
    return KeyframeRecord(ns(at), T, T, CAMERA, DEPTH_PNG, 8, None, detected=True, camera_id=camera_id)


def observation(
    number: int, at: float, label: str = "chair", score: float = 0.8, camera_id: str = MAIN_CAMERA
) -> Observation:
    return Observation(
        stamp_ns=ns(at),
        object_number=number,
        box_xyxy=np.array([10, 20, 110, 220], np.float32),
        score=score,
        hypotheses=(Hypothesis(label, score), Hypothesis("other", 1 - score)),
        centroid_map=np.array([1.0, 2.0, 0.5]),
        crop_jpeg=None,
        evidence_for=100,
        evidence_against=2,
        track_id=number,
        camera_id=camera_id,
    )


def visit(
    number: int, supported: int, in_view: int, contradicted: int = 0, seen: tuple[float, float] | None = None
) -> Visit:
    first, last = seen if seen is not None else (None, None)
    return Visit(number, supported, in_view, contradicted, maybe_ns(first), maybe_ns(last))


def spatial(subject: int, relation: str, obj: int, since: float, until: float | None = None) -> SpatialEdge:
    return SpatialEdge(subject, relation, obj, ns(since), maybe_ns(until), 0.9)


def temporal(
    kind: TemporalKind,
    start: tuple[int, int | None],
    end: tuple[int, int | None],
    not_before: float | None,
    not_after: float,
    *,
    probability: float = 0.8,
    distance_m: float | None = None,
) -> TemporalEdge:
    return TemporalEdge(kind, *start, *end, maybe_ns(not_before), ns(not_after), probability, distance_m)


def start(name: str, span: tuple[float, float]) -> TraversalStart:
    return TraversalStart(
        recording=f"recordings/{name}.mcap",
        fingerprint=f"fingerprint of {name}",
        start_ns=ns(span[0]),
        end_ns=ns(span[1]),
        T_map_odom=np.eye(4),
        config={"keyframes": {"rate_hz": 3.0}},
        versions={"supermap-cli": "0.1.0"},
    )


def add_traversal(store: MapStore, name: str, span: tuple[float, float], *deltas: MapDelta) -> int:
    """Build one whole traversal."""
    traversal_id = store.begin_traversal(start(name, span))
    for delta in deltas:
        store.commit(traversal_id, delta)
    store.finish_traversal(traversal_id, {"detect": 1.5})
    return traversal_id


def make_memory(path: Path, *traversals: tuple[str, tuple[float, float], MapDelta]) -> Path:
    """A database with the given traversals."""
    with open_store(str(path), create=True) as store:
        for name, span, delta in traversals:
            add_traversal(store, name, span, delta)
    return path


def keyframes(stamps: Sequence[float]) -> tuple[KeyframeRecord, ...]:
    return tuple(keyframe(at) for at in stamps)


def renew_checksums(path: Path) -> tuple[str, ...]:
    """Take the rows as they are, after a change behind the program's back. Returns what a repair says."""
    with open_store(str(path)) as store:
        return store.repair()
