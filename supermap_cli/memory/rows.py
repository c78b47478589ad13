"""Converts values to rows and rows to values."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory import blobs
from supermap_cli.memory.names import clean_text
from supermap_cli.memory.stored_values import (
    finite,
    parsed_object,
    parsed_shares,
    parsed_texts,
    parsed_transform,
)
from supermap_cli.memory.values import ObservationRef, StoredInstance, StoredTraversal, StoredVisit, TraversalStart
from supermap_cli.types.memory import (
    InstanceRecord,
    KeyframeRecord,
    Observation,
    SpatialEdge,
    StateRecord,
    TemporalEdge,
    Visit,
)
from supermap_schema.models import Instance

if TYPE_CHECKING:
    from sqlalchemy import Row as SqlRow

    Row = SqlRow[*tuple[Any, ...]]

Values = dict[str, Any]

INSTANCE_WITHOUT_GEOMETRY = tuple(
    column for column in Instance.__table__.columns if column.name not in {"voxels", "embedding", "engine_state"}
)


def to_json(value: object) -> str:
    """Compact JSON. Raises `ValueError` for NaN and infinity."""
    return clean_text(json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")))


def _place_values(centroid_map: FloatArray, box: Box3D) -> Values:
    x, y, z = centroid_map.tolist()
    center_x, center_y, center_z = box.center.tolist()
    size_x, size_y, size_z = box.size.tolist()
    return {
        "x": x,
        "y": y,
        "z": z,
        "center_x": center_x,
        "center_y": center_y,
        "center_z": center_z,
        "size_x": size_x,
        "size_y": size_y,
        "size_z": size_z,
        "yaw": float(box.yaw),
    }


def _real(value: object, what: str) -> float:
    return float(finite((value,), what)[0])


def _centroid(row: Row) -> FloatArray:
    return finite((row.x, row.y, row.z), "a position")


def _box(row: Row) -> Box3D:
    center, size = (row.center_x, row.center_y, row.center_z), (row.size_x, row.size_y, row.size_z)
    numbers = finite((*center, *size, row.yaw), "a box")
    return Box3D(numbers[:3], numbers[3:6], float(row.yaw))


def traversal_values(start: TraversalStart, number: int, name: str) -> Values:
    """The row of a new traversal."""
    return {
        "number": number,
        "name": clean_text(name),
        "recording": clean_text(start.recording),
        "fingerprint": start.fingerprint,
        "start_ns": int(start.start_ns),
        "end_ns": int(start.end_ns),
        "T_map_odom": to_json(start.T_map_odom.tolist()),
        "config": to_json(start.config),
        "versions": to_json(start.versions),
        "status": "building",
        "clock_shift_ns": int(start.clock_shift_ns),
    }


def _timings(text: str | None) -> dict[str, float]:
    return {} if text in {None, "", "{}"} else parsed_shares(text, "the timings of a traversal")


def stored_traversal(row: Row) -> StoredTraversal:
    """A traversal from its row."""
    return StoredTraversal(
        id=row.id,
        number=row.number,
        name=row.name,
        recording=row.recording,
        fingerprint=row.fingerprint,
        start_ns=row.start_ns,
        end_ns=row.end_ns,
        T_map_odom=parsed_transform(row.T_map_odom, "the pose of a traversal"),
        config=parsed_object(row.config, "the configuration of a traversal"),
        versions=parsed_object(row.versions, "the versions of a traversal"),
        status=row.status,
        mapped_ns=row.mapped_ns,
        timings=_timings(row.timings),
        keyframes=row.keyframes,
        clock_shift_ns=row.clock_shift_ns,
        crops_kept_from_ns=row.crops_kept_from_ns,
        observations_kept_from_ns=row.observations_kept_from_ns,
        thumbnails_kept_from_ns=row.thumbnails_kept_from_ns,
        observations=row.observations,
        warnings=parsed_texts(row.warnings, "the warnings of a traversal"),
    )


def keyframe_values(keyframe: KeyframeRecord, traversal_id: int) -> Values:
    """The row of a keyframe."""
    return {
        "traversal_id": traversal_id,
        "stamp_ns": int(keyframe.stamp_ns),
        "detected": int(keyframe.detected),
        "T_map_base": to_json(keyframe.T_map_base.tolist()),
        "T_map_camera": to_json(keyframe.T_map_camera.tolist()),
        "camera": keyframe.camera,
        "depth_step": int(keyframe.depth_step),
        "depth_png": keyframe.depth_png,
        "thumbnail_jpeg": keyframe.thumbnail_jpeg,
        "camera_id": clean_text(keyframe.camera_id),
    }


def keyframe_record(row: Row) -> KeyframeRecord:
    """A keyframe from its row, without its thumbnail."""
    return KeyframeRecord(
        stamp_ns=row.stamp_ns,
        T_map_base=parsed_transform(row.T_map_base, "the pose of a keyframe"),
        T_map_camera=parsed_transform(row.T_map_camera, "the camera of a keyframe"),
        camera=row.camera,
        depth_png=row.depth_png,
        depth_step=row.depth_step,
        thumbnail_jpeg=None,
        detected=bool(row.detected),
        camera_id=row.camera_id,
    )


def instance_values(record: InstanceRecord, traversal_id: int, text_id: str) -> Values:
    """The row of an instance."""
    return {
        "number": int(record.number),
        "id": text_id,
        "label": clean_text(record.label),
        "presence": record.presence,
        "existence_log_odds": float(record.existence_log_odds),
        "first_seen_ns": int(record.first_seen_ns),
        "last_seen_ns": int(record.last_seen_ns),
        **_place_values(record.centroid_map, record.box),
        "observations": int(record.observations),
        "merged_into": None if record.merged_into is None else int(record.merged_into),
        "traversal_id": traversal_id,
        "label_belief": to_json({clean_text(label): float(share) for label, share in record.label_belief.items()}),
        "engine_state": to_json(record.engine_state),
        "voxels": blobs.encode_voxels(record.voxels),
        "embedding": None if record.embedding is None else blobs.encode_embedding(record.embedding),
    }


def instance_record(row: Row) -> InstanceRecord:
    """An instance from its whole row."""
    return InstanceRecord(
        number=row.number,
        label=row.label,
        label_belief=parsed_shares(row.label_belief, f"the label belief of instance {row.number}"),
        existence_log_odds=_real(row.existence_log_odds, "an existence"),
        presence=row.presence,
        first_seen_ns=row.first_seen_ns,
        last_seen_ns=row.last_seen_ns,
        centroid_map=_centroid(row),
        box=_box(row),
        voxels=blobs.decode_voxels(row.voxels),
        observations=row.observations,
        embedding=None if row.embedding is None else blobs.decode_embedding(row.embedding),
        merged_into=row.merged_into,
        engine_state=parsed_object(row.engine_state, f"the state of instance {row.number}"),
    )


def stored_instance(
    row: Row, numbers: tuple[int, ...], states: tuple[StateRecord, ...], visits: tuple[StoredVisit, ...]
) -> StoredInstance:
    """An instance from its row without the geometry, with the numbers, states and visits that belong to it."""
    return StoredInstance(
        number=row.number,
        id=row.id,
        label=row.label,
        label_belief=parsed_shares(row.label_belief, f"the label belief of instance {row.number}"),
        presence=row.presence,
        existence_log_odds=_real(row.existence_log_odds, "an existence"),
        first_seen_ns=row.first_seen_ns,
        last_seen_ns=row.last_seen_ns,
        centroid_map=_centroid(row),
        box=_box(row),
        observations=row.observations,
        traversal_id=row.traversal_id,
        numbers=numbers,
        states=states,
        visits=visits,
    )


def observation_values(observation: Observation, keyframe_id: int) -> Values:
    """The row of an observation."""
    u_min, v_min, u_max, v_max = observation.box_xyxy.tolist()
    x, y, z = observation.centroid_map.tolist()
    return {
        "keyframe_id": keyframe_id,
        "instance_number": int(observation.object_number),
        "track_id": int(observation.track_id),
        "label": clean_text(observation.hypotheses[0].label),
        "score": float(observation.score),
        "u_min": u_min,
        "v_min": v_min,
        "u_max": u_max,
        "v_max": v_max,
        "x": x,
        "y": y,
        "z": z,
        "evidence_for": int(observation.evidence_for),
        "evidence_against": int(observation.evidence_against),
        "hypotheses": to_json(
            [[clean_text(hypothesis.label), float(hypothesis.score)] for hypothesis in observation.hypotheses]
        ),
        "crop_jpeg": observation.crop_jpeg,
    }


def observation_ref(row: Row, survivors: Mapping[int, int]) -> ObservationRef:
    """An observation from its row joined with its keyframe; `survivors` maps numbers to surviving instances."""
    return ObservationRef(
        id=row.id,
        traversal_id=row.traversal_id,
        keyframe_id=row.keyframe_id,
        stamp_ns=row.stamp_ns,
        instance_number=survivors.get(row.instance_number, row.instance_number),
        label=row.label,
        score=_real(row.score, "a score"),
        evidence_for=row.evidence_for,
        evidence_against=row.evidence_against,
        centroid_map=_centroid(row),
    )


def state_values(state: StateRecord, traversal_id: int) -> Values:
    """The row of a state."""
    return {
        "instance_number": int(state.object_number),
        "state_index": int(state.index),
        "first_seen_ns": int(state.first_seen_ns),
        "last_seen_ns": int(state.last_seen_ns),
        "gone_ns": None if state.gone_ns is None else int(state.gone_ns),
        "empty_before_ns": None if state.empty_before_ns is None else int(state.empty_before_ns),
        "label": clean_text(state.label),
        "confidence": float(state.confidence),
        **_place_values(state.centroid_map, state.box),
        "traversal_id": traversal_id,
    }


def state_record(row: Row) -> StateRecord:
    """A state from its row."""
    return StateRecord(
        object_number=row.instance_number,
        index=row.state_index,
        first_seen_ns=row.first_seen_ns,
        last_seen_ns=row.last_seen_ns,
        gone_ns=row.gone_ns,
        empty_before_ns=row.empty_before_ns,
        centroid_map=_centroid(row),
        box=_box(row),
        label=row.label,
        confidence=_real(row.confidence, "a confidence"),
    )


def visit_values(visit: Visit, traversal_id: int) -> Values:
    """The row of a visit."""
    return {
        "traversal_id": traversal_id,
        "instance_number": int(visit.object_number),
        "supported": int(visit.supported),
        "in_view": int(visit.in_view),
        "contradicted": int(visit.contradicted),
        "first_support_ns": None if visit.first_support_ns is None else int(visit.first_support_ns),
        "last_support_ns": None if visit.last_support_ns is None else int(visit.last_support_ns),
    }


def added_visit(before: StoredVisit | None, row: Row, survivor: int) -> StoredVisit:
    """A visit from its row, summed with those of the same traversal by instances merged into the same `survivor`."""
    firsts, lasts = [row.first_support_ns], [row.last_support_ns]
    if before is not None:
        firsts.append(before.first_support_ns)
        lasts.append(before.last_support_ns)
    return StoredVisit(
        traversal_id=row.traversal_id,
        instance_number=survivor,
        supported=row.supported + (0 if before is None else before.supported),
        in_view=row.in_view + (0 if before is None else before.in_view),
        contradicted=row.contradicted + (0 if before is None else before.contradicted),
        first_support_ns=min((stamp for stamp in firsts if stamp is not None), default=None),
        last_support_ns=max((stamp for stamp in lasts if stamp is not None), default=None),
    )


def visit(row: Row) -> Visit:
    """A visit from its row."""
    return Visit(
        object_number=row.instance_number,
        supported=row.supported,
        in_view=row.in_view,
        contradicted=row.contradicted,
        first_support_ns=row.first_support_ns,
        last_support_ns=row.last_support_ns,
    )


def spatial_edge_values(edge: SpatialEdge, traversal_id: int) -> Values:
    """The row of a spatial edge."""
    return {
        "subject_number": int(edge.subject),
        "relation": edge.relation,
        "object_number": int(edge.object),
        "since_ns": int(edge.since_ns),
        "until_ns": None if edge.until_ns is None else int(edge.until_ns),
        "confidence": float(edge.confidence),
        "traversal_id": traversal_id,
    }


def spatial_edge(row: Row) -> SpatialEdge:
    """A spatial edge from its row."""
    return SpatialEdge(
        row.subject_number,
        row.relation,
        row.object_number,
        row.since_ns,
        row.until_ns,
        _real(row.confidence, "a confidence"),
    )


def temporal_edge_values(edge: TemporalEdge, traversal_id: int) -> Values:
    """The row of a temporal edge."""
    return {
        "kind": edge.kind,
        "from_number": int(edge.from_number),
        "from_state": None if edge.from_state is None else int(edge.from_state),
        "to_number": int(edge.to_number),
        "to_state": None if edge.to_state is None else int(edge.to_state),
        "not_before_ns": None if edge.not_before_ns is None else int(edge.not_before_ns),
        "not_after_ns": int(edge.not_after_ns),
        "probability": float(edge.probability),
        "distance_m": None if edge.distance_m is None else float(edge.distance_m),
        "traversal_id": traversal_id,
    }


def temporal_edge(row: Row) -> TemporalEdge:
    """A temporal edge from its row."""
    return TemporalEdge(
        kind=row.kind,
        from_number=row.from_number,
        from_state=row.from_state,
        to_number=row.to_number,
        to_state=row.to_state,
        not_before_ns=row.not_before_ns,
        not_after_ns=row.not_after_ns,
        probability=_real(row.probability, "a probability"),
        distance_m=None if row.distance_m is None else _real(row.distance_m, "a distance"),
    )
