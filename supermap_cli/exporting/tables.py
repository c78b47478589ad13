"""The map as flat tables, shared by all table formats.

Rows refer to instances and traversals by name. A time is in nanoseconds, with its text beside it where recordings have
wall time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from supermap_cli.exporting.exported_instance import ExportedInstance
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory import streaming
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.query.traversal_spans import stamp_to_datetime

ColumnKind = Literal["text", "integer", "real", "time"]
Cell = int | float | str | None
Cells = tuple[Cell, ...]


@dataclass(frozen=True)
class Column:
    """A column; kind "time" is nanoseconds, and its name ends in `_ns`."""

    name: str
    kind: ColumnKind = "text"


@dataclass(frozen=True)
class Table:
    """A table and its rows, which are read as they are consumed."""

    name: str
    columns: tuple[Column, ...]
    rows: Callable[[ExportSource], Iterator[Cells]]

    @property
    def written_columns(self) -> tuple[Column, ...]:
        """The columns, each time followed by its text."""
        return tuple(
            written
            for column in self.columns
            for written in ((column, Column(column.name.removesuffix("_ns"))) if column.kind == "time" else (column,))
        )

    def written_rows(self, source: ExportSource) -> Iterator[Cells]:
        """The rows for `written_columns`."""
        times = [column.kind == "time" for column in self.columns]
        time_text = _utc if all(span.has_wall_time for span in source.clock.spans) else _no_text
        for row in self.rows(source):
            cells: list[Cell] = []
            for cell, is_time in zip(row, times, strict=True):
                cells.append(cell)
                if is_time:
                    cells.append(None if cell is None else time_text(int(cell)))
            yield tuple(cells)


def _columns(*names: str) -> tuple[Column, ...]:
    """Columns from "name" (text), "name:integer", "name:real", and "name_ns" (a time)."""
    kinds: dict[str, ColumnKind] = {"integer": "integer", "real": "real"}
    parts = (name.partition(":") for name in names)
    return tuple(Column(name, kinds.get(kind, "time" if name.endswith("_ns") else "text")) for name, _, kind in parts)


_PLACE = tuple(
    f"{name}:real"
    for name in (*"xyz", "center_x", "center_y", "center_z", "size_x", "size_y", "size_z", "yaw")
)  # fmt: skip
_BOUNDS = ("not_before_ns", "not_after_ns")
"""As of a time: the bounds within which an instance left or came, where its presence is not certain."""


def _place(centroid: Any, box: Box3D) -> Cells:
    return (*centroid.tolist(), *box.center.tolist(), *box.size.tolist(), float(box.yaw))


def _traversals(source: ExportSource) -> Iterator[Cells]:
    for traversal in source.traversals:
        yield (
            *(
                traversal.name,
                traversal.number,
                traversal.recording,
                traversal.fingerprint,
                traversal.status,
                traversal.start_ns,
                traversal.end_ns,
            ),
            *(
                traversal.keyframes,
                traversal.clock_shift_ns,
                traversal.crops_kept_from_ns,
                traversal.observations_kept_from_ns,
            ),
            traversal.thumbnails_kept_from_ns,
            *(json.dumps(traversal.T_map_odom.tolist()), _json(traversal.config), _json(traversal.versions)),
        )


def _keyframes(source: ExportSource) -> Iterator[Cells]:
    for row in streaming.stream_keyframes(source.reader, *source.selection.keyframes):
        x, y, z = parsed_transform(row.T_map_base, f"the pose of keyframe {row.id}")[:3, 3].tolist()
        traversal = source.traversal_names[row.traversal_id]
        yield (
            *(row.id, traversal, row.stamp_ns, row.camera_id, x, y, z, row.detected),
            *(row.T_map_base, row.T_map_camera, row.camera),
        )


def _instances(source: ExportSource) -> Iterator[Cells]:
    for instance in source.instances():
        yield (
            *(
                instance.id,
                instance.number,
                instance.label,
                instance.presence,
                instance.existence_log_odds,
                instance.first_seen_ns,
            ),
            *(instance.last_seen_ns, *_place(instance.centroid_map, instance.box), instance.observations),
            *(source.traversal_names[instance.traversal_id], _json(instance.label_belief), *instance.change_bounds_ns),
        )


def _states(source: ExportSource) -> Iterator[Cells]:
    for instance in source.instances(named=False):
        for state in instance.states:
            yield (
                *(instance.id, state.index, state.label, instance.presence_in(state), float(state.confidence)),
                *(state.empty_before_ns, state.first_seen_ns, state.last_seen_ns, state.gone_ns),
                *(*_place(state.centroid_map, state.box), *instance.change_bounds_ns),
            )


def _observations(source: ExportSource) -> Iterator[Cells]:
    for row in streaming.stream_observations(source.reader, *source.selection.keyframes):
        text_id = source.current_id(row.instance_number, row.instance_id)
        if text_id is not None:
            yield (
                *(row.id, text_id, row.keyframe_id, source.traversal_names[row.traversal_id], row.stamp_ns),
                *(row.label, row.score, row.u_min, row.v_min, row.u_max, row.v_max, row.x, row.y, row.z),
                *(row.evidence_for, row.evidence_against, row.track_id, row.hypotheses, int(row.has_crop)),
            )


def _visits(source: ExportSource) -> Iterator[Cells]:
    for instance in source.instances(visits=True, named=False):
        yield from visits_of(instance, source)


def visits_of(instance: ExportedInstance, source: ExportSource) -> Iterator[Cells]:
    """The rows of one instance in `VISITS`."""
    shown = {traversal.id for traversal in source.traversals}
    for visit in instance.visits:
        if visit.traversal_id in shown:
            yield (
                *(instance.id, source.traversal_names[visit.traversal_id], visit.supported, visit.in_view),
                *(visit.contradicted, visit.first_support_ns, visit.last_support_ns),
            )


def _spatial_edges(source: ExportSource) -> Iterator[Cells]:
    for row in streaming.stream_spatial_edges(source.reader):
        subject = source.current_id(row.subject_number, row.subject_id)
        other = source.current_id(row.object_number, row.object_id)
        ends_leave = subject is not None and other is not None and subject != other
        if ends_leave and source.selection.includes_interval(row.since_ns, row.until_ns):
            traversal = source.traversal_names[row.traversal_id]
            yield (subject, row.relation, other, row.since_ns, row.until_ns, row.confidence, traversal)


def _temporal_edges(source: ExportSource) -> Iterator[Cells]:
    for row in streaming.stream_temporal_edges(source.reader):
        ends = (
            source.current_id(row.from_number, row.from_id),
            source.current_id(row.to_number, row.to_id),
        )
        if any(ends) and source.selection.includes_event(row.traversal_id, row.not_after_ns):
            yield (
                *(row.kind, row.from_id, row.from_state, row.to_id, row.to_state),
                *(row.not_before_ns, row.not_after_ns, row.distance_m, row.probability),
                source.traversal_names[row.traversal_id],
            )


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _utc(stamp_ns: int) -> str:
    """A time as ISO 8601, to a tenth of a second."""
    return f"{stamp_to_datetime(stamp_ns):%Y-%m-%dT%H:%M:%S}.{stamp_ns % 10**9 // 10**8}Z"


def _no_text(_: int) -> None:
    return None


TRAVERSALS = Table(
    "traversals",
    _columns(
        *("name", "number:integer", "recording", "fingerprint", "status", "start_ns", "end_ns", "keyframes:integer"),
        *("clock_shift_ns:integer", "crops_kept_from_ns", "observations_kept_from_ns"),
        "thumbnails_kept_from_ns",
        *("T_map_odom", "config", "versions"),
    ),
    _traversals,
)
KEYFRAMES = Table(
    "keyframes",
    _columns(
        *("keyframe:integer", "traversal", "stamp_ns", "camera_id", "x:real", "y:real", "z:real", "detected:integer"),
        *("T_map_base", "T_map_camera", "camera"),
    ),
    _keyframes,
)
INSTANCES = Table(
    "instances",
    _columns(
        *("id", "number:integer", "label", "presence", "existence_log_odds:real", "first_seen_ns", "last_seen_ns"),
        *(*_PLACE, "observations:integer", "first_traversal", "label_belief", *_BOUNDS),
    ),
    _instances,
)
STATES = Table(
    "states",
    _columns(
        *("id", "state:integer", "label", "presence", "confidence:real", "empty_before_ns", "first_seen_ns"),
        *("last_seen_ns", "gone_ns", *_PLACE, *_BOUNDS),
    ),
    _states,
)
OBSERVATIONS = Table(
    "observations",
    _columns(
        *("observation:integer", "id", "keyframe:integer", "traversal", "stamp_ns", "label", "score:real"),
        *("u_min:real", "v_min:real", "u_max:real", "v_max:real", "x:real", "y:real", "z:real"),
        *("evidence_for:integer", "evidence_against:integer", "track:integer", "hypotheses", "has_crop:integer"),
    ),
    _observations,
)
VISITS = Table(
    "visits",
    _columns(
        *("id", "traversal", "supported:integer", "in_view:integer", "contradicted:integer"),
        *("first_support_ns", "last_support_ns"),
    ),
    _visits,
)
SPATIAL_EDGES = Table(
    "spatial_edges",
    _columns("subject", "relation", "object", "since_ns", "until_ns", "confidence:real", "traversal"),
    _spatial_edges,
)
TEMPORAL_EDGES = Table(
    "temporal_edges",
    _columns(
        *("kind", "from_id", "from_state:integer", "to_id", "to_state:integer", "not_before_ns", "not_after_ns"),
        *("distance_m:real", "probability:real", "traversal"),
    ),
    _temporal_edges,
)
TABLES = (TRAVERSALS, KEYFRAMES, INSTANCES, STATES, OBSERVATIONS, VISITS, SPATIAL_EDGES, TEMPORAL_EDGES)
