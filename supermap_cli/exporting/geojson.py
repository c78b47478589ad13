"""The map as GeoJSON: footprints of objects and trajectories of the robot, in metres of the map frame.

GeoJSON (RFC 7946) is in degrees only. This file has its structure, and `crs` is null, which GeoJSON 2008 defines as "no
coordinate reference system can be assumed"; tools then take the numbers as plain x and y.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from typing import TextIO

from supermap_cli.exporting.exported_instance import ExportedInstance
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.exporting.tables import KEYFRAMES
from supermap_cli.query.clock import Clock
from supermap_cli.query.presence_at import describe_presence
from supermap_cli.types.memory import StateRecord

NOTE = (
    "x and y are metres in the level map frame of a SuperMap memory, not degrees; z ranges are metres above its floor."
)


def write_geojson(source: ExportSource, file: TextIO) -> None:
    """Write a FeatureCollection, one feature per line: a Polygon per exported state, a LineString per traversal."""
    file.write('{"type": "FeatureCollection", "crs": null,\n')
    about = {"frame": "map", "unit": "m", "note": NOTE}
    if source.selection.at is not None:
        about |= {"as_of": source.selection.at.text}
    file.write(f'"supermap": {json.dumps(about, ensure_ascii=False)},\n"features": [')
    for index, feature in enumerate(source.with_progress("features", _features(source))):
        file.write(f"{',' if index else ''}\n{json.dumps(feature, ensure_ascii=False, allow_nan=False)}")
    file.write("\n]}\n")


def _features(source: ExportSource) -> Iterator[dict[str, object]]:
    yield from _trajectories(source)
    for instance in source.instances():
        for state in instance.states:
            yield _footprint(instance, state, source)


def _footprint(instance: ExportedInstance, state: StateRecord, source: ExportSource) -> dict[str, object]:
    clock = source.clock
    corners = [_coordinates(x, y) for x, y in state.box.outline]
    return {
        "type": "Feature",
        "id": f"{instance.id}#{state.index}",
        "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        "properties": {
            "kind": "object",
            "id": instance.id,
            "label": instance.label,
            "presence": instance.presence_in(state),
            **_presence_properties(instance, source),
            "state": state.index,
            "confidence": round(state.confidence, 4),
            "z_min": round(state.box.z_min, 4),
            "z_max": round(state.box.z_max, 4),
            "x": round(float(state.centroid_map[0]), 4),
            "y": round(float(state.centroid_map[1]), 4),
            "z": round(float(state.centroid_map[2]), 4),
            **_time_properties("empty_before", state.empty_before_ns, clock),
            **_time_properties("first_seen", state.first_seen_ns, clock),
            **_time_properties("last_seen", state.last_seen_ns, clock),
            **_time_properties("gone", state.gone_ns, clock),
        },
    }


def _presence_properties(instance: ExportedInstance, source: ExportSource) -> dict[str, object]:
    """As of a time: the basis of the presence, and the bounds within which the object left or came."""
    at_ns, presence_then = source.selection.at_ns, instance.presence_then
    if at_ns is None or presence_then is None:
        return {}
    not_before_ns, not_after_ns = instance.change_bounds_ns
    return {
        "why": describe_presence(presence_then, at_ns, source.clock),
        **_time_properties("not_before", not_before_ns, source.clock),
        **_time_properties("not_after", not_after_ns, source.clock),
    }


def _trajectories(source: ExportSource) -> Iterator[dict[str, object]]:
    """The robot's trajectory in each traversal; a single keyframe gives a Point."""
    column = {column.name: index for index, column in enumerate(KEYFRAMES.columns)}

    by_name = {traversal.name: traversal for traversal in source.traversals}
    for name, rows in groupby(KEYFRAMES.rows(source), lambda row: str(row[column["traversal"]])):
        traversal = by_name.get(name)
        if traversal is None:
            continue
        points = [_coordinates(float(row[column["x"]] or 0), float(row[column["y"]] or 0)) for row in rows]
        geometry: dict[str, object] = (
            {"type": "LineString", "coordinates": points}
            if len(points) > 1
            else {"type": "Point", "coordinates": points[0]}
        )
        yield {
            "type": "Feature",
            "id": f"trajectory {name}",
            "geometry": geometry,
            "properties": {
                "kind": "trajectory",
                "traversal": name,
                "number": traversal.number,
                "recording": traversal.recording,
                "keyframes": len(points),
                **_time_properties("start", traversal.start_ns, source.clock),
                **_time_properties("end", traversal.end_ns, source.clock),
            },
        }


def _coordinates(x: float, y: float) -> list[float]:
    """Metres, rounded to 0.1 mm."""
    return [round(x, 4), round(y, 4)]


def _time_properties(name: str, stamp_ns: int | None, clock: Clock) -> dict[str, object]:
    return {f"{name}_ns": stamp_ns, name: None if stamp_ns is None else clock.text(stamp_ns)}
