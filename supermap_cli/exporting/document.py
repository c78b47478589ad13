"""The memory as one JSON document (schema `export`), written piece by piece."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import TextIO

from supermap_cli.exporting.selection import Source
from supermap_cli.exporting.tables import KEYFRAMES, OBSERVATIONS, SPATIAL_EDGES, TEMPORAL_EDGES, Table
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.views import box_view, interval_view, to_document, vector
from supermap_cli.types.memory import StateRecord
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
_JSON_COLUMNS = frozenset({"T_map_base", "T_map_camera", "camera", "hypotheses"})


def write_document(source: Source, file: TextIO, *, observations: bool = False) -> None:
    """Write the document; `observations` adds every single one (without its crop)."""
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
        ("traversals", _traversals(source)),
        ("instances", (_instance(source, *each) for each in source.instances(visits=True))),
        ("spatial_edges", _objects(source, SPATIAL_EDGES)),
        ("temporal_edges", _objects(source, TEMPORAL_EDGES)),
        ("keyframes", _objects(source, KEYFRAMES)),
    ]
    if observations:
        parts.append(("observations", _objects(source, OBSERVATIONS)))
    for index, (name, values) in enumerate(parts):
        file.write(f"{',' if index else ''}\n{_dumps(name)}: ")
        write_array(file.write, source.counted(name, values))
    file.write("\n}\n")


def write_array(write: Callable[[str], object], values: Iterable[object]) -> None:
    """Write a JSON array, a value a line, while the values come."""
    write("[")
    for index, value in enumerate(values):
        write(f"{',' if index else ''}\n{_dumps(value)}")
    write("\n]")


def _selection(source: Source) -> dict[str, object]:
    selection = source.selection
    return {
        "labels": sorted(selection.labels),
        "presences": sorted(selection.presences),
        "traversal": None if selection.traversal is None else selection.traversal.name,
        "at_ns": selection.at_ns,
    }


def _traversals(source: Source) -> Iterator[dict[str, object]]:
    for each in source.traversals:
        yield {
            "number": each.number,
            "name": each.name,
            "recording": each.recording,
            "fingerprint": each.fingerprint,
            "status": each.status,
            "start_ns": each.start_ns,
            "end_ns": each.end_ns,
            "keyframes": each.keyframes,
            "T_map_odom": each.T_map_odom.tolist(),
            "clock_shift_ns": each.clock_shift_ns,
            "crops_kept_from_ns": each.crops_kept_from_ns,
            "observations_kept_from_ns": each.observations_kept_from_ns,
            "thumbnails_kept_from_ns": each.thumbnails_kept_from_ns,
            "versions": dict(each.versions),
            "config": dict(each.config),
        }


def _instance(source: Source, instance: StoredInstance, states: tuple[StateRecord, ...]) -> dict[str, object]:
    shown = {each.id for each in source.traversals}
    return {
        "id": instance.id,
        "label": instance.label,
        "label_belief": dict(instance.label_belief),
        "presence": instance.presence,
        "existence_log_odds": instance.existence_log_odds,
        "first_seen_ns": instance.first_seen_ns,
        "last_seen_ns": instance.last_seen_ns,
        "position": vector(instance.centroid_map),
        "box": to_document(box_view(instance.box)),
        "observation_count": instance.observations,
        "first_traversal": source.traversal_names[instance.traversal_id],
        "intervals": [to_document(interval_view(each)) for each in states],
        "visits": [
            {
                "traversal": source.traversal_names[each.traversal_id],
                "supported": each.supported,
                "in_view": each.in_view,
                "contradicted": each.contradicted,
                "first_support_ns": each.first_support_ns,
                "last_support_ns": each.last_support_ns,
            }
            for each in instance.visits
            if each.traversal_id in shown
        ],
    }


def _objects(source: Source, table: Table) -> Iterator[dict[str, object]]:
    """A table's rows as objects; what it holds as JSON is a value here."""
    names = [column.name for column in table.columns]
    for row in table.rows(source):
        named = zip(names, row, strict=True)
        yield {name: json.loads(str(cell)) if name in _JSON_COLUMNS else cell for name, cell in named}


def _dumps(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
