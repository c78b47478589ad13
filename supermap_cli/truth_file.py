"""Ground truth as a file: JSON by `truth.schema.json`, compact, and the same bytes for the same truth.

Lengths are rounded to 0.1 mm and rotations to 1e-6; a surface is a flat list of whole millimetres, its seen samples
first, so that one number says which were seen.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from supermap_cli.errors import TruthError
from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.input_files import check_readable
from supermap_cli.types.truth import (
    GroundTruth,
    TrueChange,
    TrueChangeKind,
    TrueKind,
    TrueMotion,
    TrueObject,
    TrueQuestion,
    TrueSightings,
    TrueState,
    TrueSurface,
    TrueTraversal,
)

FORMAT = "supermap truth"
VERSION = 1
TRUTH_FILE = "truth.json"
"""Its name in the folder of a simulation."""

_LENGTH_DIGITS = 4
"""Decimals of metres: 0.1 mm."""
_ROTATION_DIGITS = 6
"""Decimals of rotation matrices and of yaw in radians."""
_SHARE_DIGITS = 3
"""Decimals of visible shares."""
_DISTANCE_DIGITS = 3
"""Decimals of metres to the camera."""

Document = Mapping[str, Any]


def write_truth(truth: GroundTruth, path: Path) -> None:
    """Write a truth; the folder has to be there."""
    path.write_text(json.dumps(to_document(truth), separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def read_truth(path: Path) -> GroundTruth:
    """Read a truth. Raises `TruthError` for a file that is missing, none of these, damaged, or of a newer version."""
    check_readable(path, TruthError, what="a truth.json")
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        cure = "make one with `supermap simulate`"
        raise TruthError("there is no ground truth", where=str(path), cure=cure) from error
    except (OSError, UnicodeDecodeError) as error:
        raise _no_truth(path, "it cannot be read as text") from error
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        damaged = text.startswith(f'{{"format":"{FORMAT}"')
        raise (_damaged(path, str(error)) if damaged else _no_truth(path, "it is no JSON")) from error
    _check_format(document, path)
    try:
        return from_document(document)
    except KeyError as error:
        raise _damaged(path, f"{error} is missing") from error
    except (TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise _damaged(path, str(error)) from error


def _check_format(document: object, path: Path) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise _no_truth(path, f'its "format" is not "{FORMAT}"')
    version = document.get("version")
    if not isinstance(version, int) or version < 1:
        raise _damaged(path, f"version {version!r}")
    if version > VERSION:
        raise TruthError(
            f"a ground truth of version {version}, newer than this program's {VERSION}",
            where=str(path),
            cure="update supermap, or simulate it again with this one",
        )


def _no_truth(path: Path, why: str) -> TruthError:
    return TruthError(
        f"not a ground truth: {why}", where=str(path), cure="give the truth.json that `supermap simulate` wrote"
    )


def _damaged(path: Path, why: str) -> TruthError:
    cure = "copy it again, or write it anew with `supermap simulate`"
    return TruthError(f"a damaged ground truth: {why}", where=str(path), cure=cure)


# -- values to JSON


def to_document(truth: GroundTruth) -> dict[str, Any]:
    """The truth as JSON values."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "scenario": truth.scenario,
        "seed": truth.seed,
        **({"levels": dict(truth.levels)} if truth.levels else {}),
        "traversals": [_traversal(traversal) for traversal in truth.traversals],
        "objects": [_object(obj) for obj in truth.objects],
        "surfaces": [
            {"label": surface.label, "points_mm": _millimetres(surface.points_world)} for surface in truth.surfaces
        ],
        "changes": [_change(change) for change in truth.changes],
        "questions": [{"text": question.text, "answer": list(question.answer)} for question in truth.questions],
    }


def _traversal(traversal: TrueTraversal) -> dict[str, Any]:
    return {
        "name": traversal.name,
        "recording": traversal.recording,
        "fingerprint": traversal.fingerprint,
        "start_ns": traversal.start_ns,
        "end_ns": traversal.end_ns,
        "T_world_odom": _transform(traversal.T_world_odom),
        "stamps_ns": traversal.stamps_ns.tolist(),
        "T_world_base": [_transform(T) for T in traversal.T_world_base],
        "sightings": _sightings(traversal.sightings),
        **({"camera_ids": list(traversal.camera_ids)} if traversal.camera_ids else {}),
    }


def _sightings(sightings: TrueSightings) -> dict[str, Any]:
    return {
        "frame": sightings.frame.tolist(),
        "object": sightings.object.tolist(),
        "state": sightings.state.tolist(),
        "present": sightings.present.tolist(),
        "in_image": _rounded(sightings.in_image, _SHARE_DIGITS),
        "visible": _rounded(sightings.visible, _SHARE_DIGITS),
        "pixels": sightings.pixels.tolist(),
        "distance_m": _rounded(sightings.distance_m, _DISTANCE_DIGITS),
    }


def _object(obj: TrueObject) -> dict[str, Any]:
    seen_first = np.concatenate([obj.surface_object[obj.surface_seen], obj.surface_object[~obj.surface_seen]])
    return {
        "id": obj.id,
        "label": obj.label,
        "kind": obj.kind,
        "states": [_state(state) for state in obj.states],
        "motions": [
            {"stamps_ns": motion.stamps_ns.tolist(), "centers": _rounded(motion.centers_world, _LENGTH_DIGITS)}
            for motion in obj.motions
        ],
        "surface_mm": _millimetres(seen_first),
        "surface_seen": int(obj.surface_seen.sum()),
    }


def _state(state: TrueState) -> dict[str, Any]:
    return {
        "since_ns": state.since_ns,
        "until_ns": state.until_ns,
        "T_world_object": _transform(state.T_world_object),
        "box": {
            "center": _rounded(state.box.center, _LENGTH_DIGITS),
            "size": _rounded(state.box.size, _LENGTH_DIGITS),
            "yaw": round(state.box.yaw, _ROTATION_DIGITS) + 0.0,
        },
        "centroid": _rounded(state.centroid, _LENGTH_DIGITS),
        "on": state.on,
    }


def _change(change: TrueChange) -> dict[str, Any]:
    return {
        "kind": change.kind,
        "object": change.object_id,
        "from_state": change.from_state,
        "to_state": change.to_state,
        "stamp_ns": change.stamp_ns,
        "until_ns": change.until_ns,
        "distance_m": None if change.distance_m is None else round(change.distance_m, _LENGTH_DIGITS),
        "between": list(change.between),
    }


def _rounded(values: NDArray[np.floating], digits: int) -> Any:
    """Nested lists; no negative zero, which would not come back as the same text."""
    return (np.round(values.astype(np.float64), digits) + 0.0).tolist()


def _transform(T: FloatArray) -> list[float]:
    """The upper three rows, one after the other."""
    rows = np.column_stack([np.round(T[:3, :3], _ROTATION_DIGITS), np.round(T[:3, 3], _LENGTH_DIGITS)])
    listed: list[float] = (rows + 0.0).ravel().tolist()
    return listed


def _millimetres(points: Float32Array) -> list[int]:
    listed: list[int] = np.rint(points.astype(np.float64) * 1000).astype(np.int64).ravel().tolist()
    return listed


# -- JSON to values


def from_document(document: Document) -> GroundTruth:
    """The truth of JSON values. Raises `KeyError`, `TypeError` or `ValueError` where they are none."""
    truth = GroundTruth(
        scenario=_text(document["scenario"]),
        seed=int(document["seed"]),
        traversals=tuple(_read_traversal(entry) for entry in document["traversals"]),
        objects=tuple(_read_object(entry) for entry in document["objects"]),
        surfaces=tuple(
            TrueSurface(_text(entry["label"]), _metres(entry["points_mm"])) for entry in document["surfaces"]
        ),
        changes=tuple(_read_change(entry) for entry in document["changes"]),
        questions=tuple(
            TrueQuestion(_text(entry["text"]), tuple(map(_text, entry["answer"]))) for entry in document["questions"]
        ),
        levels={_text(axis): _text(level) for axis, level in document.get("levels", {}).items()},
    )
    _check_references(truth)
    return truth


def _read_traversal(entry: Document) -> TrueTraversal:
    return TrueTraversal(
        name=_text(entry["name"]),
        recording=_text(entry["recording"]),
        start_ns=int(entry["start_ns"]),
        end_ns=int(entry["end_ns"]),
        T_world_odom=_read_transforms([entry["T_world_odom"]])[0],
        stamps_ns=np.array(entry["stamps_ns"], np.int64),
        T_world_base=_read_transforms(entry["T_world_base"]),
        sightings=_read_sightings(entry["sightings"]),
        fingerprint=_optional(_text, entry.get("fingerprint")),
        camera_ids=tuple(map(_text, entry.get("camera_ids", ()))),
    )


def _read_sightings(entry: Document) -> TrueSightings:
    return TrueSightings(
        frame=np.array(entry["frame"], np.int64),
        object=np.array(entry["object"], np.int64),
        state=np.array(entry["state"], np.int64),
        present=np.array(entry["present"], bool),
        in_image=np.array(entry["in_image"], np.float32),
        visible=np.array(entry["visible"], np.float32),
        pixels=np.array(entry["pixels"], np.int64),
        distance_m=np.array(entry["distance_m"], np.float32),
    )


def _read_object(entry: Document) -> TrueObject:
    surface = _metres(entry["surface_mm"])
    return TrueObject(
        id=_text(entry["id"]),
        label=_text(entry["label"]),
        kind=_one_of(get_args(TrueKind), entry["kind"]),
        states=tuple(_read_state(state) for state in entry["states"]),
        motions=tuple(
            TrueMotion(np.array(motion["stamps_ns"], np.int64), np.array(motion["centers"], np.float64).reshape(-1, 3))
            for motion in entry["motions"]
        ),
        surface_object=surface,
        surface_seen=np.arange(len(surface)) < int(entry["surface_seen"]),
    )


def _read_state(state: Document) -> TrueState:
    box = state["box"]
    return TrueState(
        since_ns=_optional(int, state["since_ns"]),
        until_ns=_optional(int, state["until_ns"]),
        T_world_object=_read_transforms([state["T_world_object"]])[0],
        box=Box3D(np.array(box["center"], np.float64), np.array(box["size"], np.float64), float(box["yaw"])),
        centroid=np.array(state["centroid"], np.float64),
        on=_optional(_text, state["on"]),
    )


def _read_change(change: Document) -> TrueChange:
    before, after = change["between"]
    return TrueChange(
        kind=_one_of(get_args(TrueChangeKind), change["kind"]),
        object_id=_text(change["object"]),
        from_state=_optional(int, change["from_state"]),
        to_state=_optional(int, change["to_state"]),
        stamp_ns=int(change["stamp_ns"]),
        until_ns=int(change["until_ns"]),
        distance_m=_optional(float, change["distance_m"]),
        between=(_text(before), _text(after)),
    )


def _check_references(truth: GroundTruth) -> None:
    """Raise `ValueError` where an index or an id points nowhere."""
    ids = {obj.id for obj in truth.objects}
    if len(ids) < len(truth.objects):
        raise ValueError("two objects share an id")
    named = {change.object_id for change in truth.changes} | {
        object_id for question in truth.questions for object_id in question.answer
    }
    if unknown := sorted(named - ids):
        raise ValueError(f"there is no object {unknown[0]!r}")
    states = np.array([len(obj.states) for obj in truth.objects], np.int64)
    for traversal in truth.traversals:
        seen = traversal.sightings
        if not len(seen.frame):
            continue
        if not (_within(seen.frame, len(traversal.stamps_ns)) and _within(seen.object, len(truth.objects))):
            raise ValueError(f"a sighting of {traversal.name} is of no frame or of no object")
        if (seen.state >= states[seen.object]).any() or seen.state.min() < -1:
            raise ValueError(f"a sighting of {traversal.name} is of no state")


def _within(indices: NDArray[np.int64], count: int) -> bool:
    return bool(indices.min() >= 0 and indices.max() < count)


def _read_transforms(rows: Sequence[Sequence[float]]) -> FloatArray:
    """(n, 4, 4) of n lists of twelve numbers."""
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :] = np.array(rows, np.float64).reshape(-1, 3, 4)
    return T


def _metres(flat_mm: Sequence[int]) -> Float32Array:
    metres: Float32Array = (np.array(flat_mm, np.float64).reshape(-1, 3) / 1000).astype(np.float32)
    return metres


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected a text, got {value!r}")
    return value


def _optional(read: Callable[[Any], Any], value: object) -> Any:
    return None if value is None else read(value)


def _one_of(known: tuple[str, ...], value: object) -> Any:
    if value not in known:
        raise ValueError(f"{value!r} is none of {', '.join(known)}")
    return value
