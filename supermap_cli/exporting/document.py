"""The map as one JSON document (schema `export`), written incrementally."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import TextIO

from supermap_cli.exporting.exported_instance import ExportedInstance
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.exporting.tables import (
    KEYFRAMES,
    OBSERVATIONS,
    SPATIAL_EDGES,
    TEMPORAL_EDGES,
    TRAVERSALS,
    VISITS,
    Cells,
    Table,
    visits_of,
)
from supermap_cli.memory.stored_values import parsed
from supermap_cli.query.presence_at import presence_view
from supermap_cli.query.views import box_view, interval_view, to_document, vector
from supermap_cli.version import __version__

FORMAT = "supermap-export"
FORMAT_VERSION = 1
FRAMES = {
    "map": "Right-handed, metres, z up, level. All places, boxes and poses are in it.",
    "odom": "A traversal's odometry: T_map_odom places it in the map.",
    "base": "The robot (REP-103: x forward, y left, z up): T_map_base is its pose.",
    "camera": "A camera's optical frame (z forward, x right, y down): T_map_camera is its pose.",
}
UNITS = {"length": "m", "angle": "rad", "time": "ns", "image": "px"}
_JSON_COLUMNS = frozenset({"T_map_base", "T_map_camera", "T_map_odom", "camera", "config", "hypotheses", "versions"})


def write_document(source: ExportSource, file: TextIO, *, observations: bool = False) -> None:
    """Write the document; `observations` adds all observations (without crops)."""
    head = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "written_by": f"supermap-cli {__version__}",
        "frames": FRAMES,
        "units": UNITS,
        "selection": _selection(source),
    }
    file.write("{")
    for key, value in head.items():
        file.write(f"\n{_dumps(key)}: {_dumps(value)},")
    parts: list[tuple[str, Iterable[object]]] = [
        ("traversals", _rows_as_objects(source, TRAVERSALS)),
        ("instances", (_instance_object(source, instance) for instance in source.instances(visits=True))),
        ("spatial_edges", _rows_as_objects(source, SPATIAL_EDGES)),
        ("temporal_edges", _rows_as_objects(source, TEMPORAL_EDGES)),
        ("keyframes", _rows_as_objects(source, KEYFRAMES)),
    ]
    if observations:
        parts.append(("observations", _rows_as_objects(source, OBSERVATIONS)))
    for index, (name, values) in enumerate(parts):
        file.write(f"{',' if index else ''}\n{_dumps(name)}: ")
        write_array(file.write, source.with_progress(name, values))
    file.write("\n}\n")


def write_array(write: Callable[[str], object], values: Iterable[object]) -> None:
    """Write a JSON array, one value per line, as the values arrive."""
    write("[")
    for index, value in enumerate(values):
        write(f"{',' if index else ''}\n{_dumps(value)}")
    write("\n]")


def _selection(source: ExportSource) -> dict[str, object]:
    selection = source.selection
    return {
        "labels": sorted(selection.labels),
        "presences": sorted(selection.presences),
        "traversal": None if selection.traversal is None else selection.traversal.name,
        "at_ns": selection.at_ns,
        "as_of": None if selection.at is None else selection.at.text,
    }


def _instance_object(source: ExportSource, instance: ExportedInstance) -> dict[str, object]:
    at_ns, presence_then = source.selection.at_ns, instance.presence_then
    standing = {}
    if at_ns is not None and presence_then is not None:
        standing = {"standing": to_document(presence_view(presence_then, at_ns, source.clock))}
    visits = (_row_as_object(VISITS, row) for row in visits_of(instance, source))
    return {
        "id": instance.id,
        "label": instance.label,
        "label_belief": dict(instance.label_belief),
        "presence": instance.presence,
        **standing,
        "existence_log_odds": instance.existence_log_odds,
        "first_seen_ns": instance.first_seen_ns,
        "last_seen_ns": instance.last_seen_ns,
        "position": vector(instance.centroid_map),
        "box": to_document(box_view(instance.box)),
        "observation_count": instance.observations,
        "first_traversal": source.traversal_names[instance.traversal_id],
        "intervals": [to_document(interval_view(state)) for state in instance.states],
        "visits": [{name: cell for name, cell in visit.items() if name != "id"} for visit in visits],
    }


def _rows_as_objects(source: ExportSource, table: Table) -> Iterator[dict[str, object]]:
    """A table's rows as objects."""
    return (_row_as_object(table, row) for row in table.rows(source))


def _row_as_object(table: Table, row: Cells) -> dict[str, object]:
    """A row as an object; cells with JSON text become values."""
    named = zip((column.name for column in table.columns), row, strict=True)
    return {name: parsed(cell, f"the {name} of a row") if name in _JSON_COLUMNS else cell for name, cell in named}


def _dumps(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
