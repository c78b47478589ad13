"""The memory as a plan: GeoJSON with footprints of objects and the ways of the robot, in metres of the map frame.

GeoJSON proper (RFC 7946) knows degrees only. This has the form of it and says so: `crs` is null, which GeoJSON 2008
defines as "no coordinate reference system can be assumed", and tools take the numbers as plain x and y.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import groupby
from typing import TextIO

from supermap_cli.exporting.exported_instance import Leaving
from supermap_cli.exporting.selection import Source
from supermap_cli.exporting.tables import KEYFRAMES
from supermap_cli.query.clock import Clock
from supermap_cli.query.presence_at import in_words
from supermap_cli.types.memory import StateRecord

NOTE = (
    "x and y are metres in the level map frame of a SuperMap memory, not degrees; z ranges are metres above its floor."
)


def write_plan(source: Source, file: TextIO) -> None:
    """Write a FeatureCollection, a feature a line: a Polygon for each state that leaves, a line for each traversal."""
    file.write('{"type": "FeatureCollection", "crs": null,\n')
    about = {"frame": "map", "unit": "m", "note": NOTE}
    if source.selection.at is not None:
        about |= {"as_of": source.selection.at.text}
    file.write(f'"supermap": {json.dumps(about, ensure_ascii=False)},\n"features": [')
    for index, feature in enumerate(source.counted("features", _features(source))):
        file.write(f"{',' if index else ''}\n{json.dumps(feature, ensure_ascii=False, allow_nan=False)}")
    file.write("\n]}\n")


def _features(source: Source) -> Iterator[dict[str, object]]:
    yield from _ways(source)
    for instance in source.instances():
        for state in instance.states:
            yield _footprint(instance, state, source)


def _footprint(instance: Leaving, state: StateRecord, source: Source) -> dict[str, object]:
    clock = source.clock
    corners = [_place(x, y) for x, y in state.box.outline]
    return {
        "type": "Feature",
        "id": f"{instance.id}#{state.index}",
        "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
        "properties": {
            "kind": "object",
            "id": instance.id,
            "label": instance.label,
            "presence": instance.presence_in(state),
            **_gap(instance, source),
            "state": state.index,
            "confidence": round(state.confidence, 4),
            "z_min": round(state.box.z_min, 4),
            "z_max": round(state.box.z_max, 4),
            "x": round(float(state.centroid_map[0]), 4),
            "y": round(float(state.centroid_map[1]), 4),
            "z": round(float(state.centroid_map[2]), 4),
            **_time("empty_before", state.empty_before_ns, clock),
            **_time("first_seen", state.first_seen_ns, clock),
            **_time("last_seen", state.last_seen_ns, clock),
            **_time("gone", state.gone_ns, clock),
        },
    }


def _gap(instance: Leaving, source: Source) -> dict[str, object]:
    """As of a time: why its presence is what it is, and within which bounds it left or came."""
    at_ns, standing = source.selection.at_ns, instance.standing
    if at_ns is None or standing is None:
        return {}
    not_before_ns, not_after_ns = instance.gap_ns
    return {
        "why": in_words(standing, at_ns, source.clock),
        **_time("not_before", not_before_ns, source.clock),
        **_time("not_after", not_after_ns, source.clock),
    }


def _ways(source: Source) -> Iterator[dict[str, object]]:
    """The robot's way in each traversal; one of a single keyframe is a point."""
    column = {column.name: index for index, column in enumerate(KEYFRAMES.columns)}

    by_name = {traversal.name: traversal for traversal in source.traversals}
    for name, rows in groupby(KEYFRAMES.rows(source), lambda row: str(row[column["traversal"]])):
        traversal = by_name.get(name)
        if traversal is None:
            continue
        places = [_place(float(row[column["x"]] or 0), float(row[column["y"]] or 0)) for row in rows]
        geometry: dict[str, object] = (
            {"type": "LineString", "coordinates": places}
            if len(places) > 1
            else {"type": "Point", "coordinates": places[0]}
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
                "keyframes": len(places),
                **_time("start", traversal.start_ns, source.clock),
                **_time("end", traversal.end_ns, source.clock),
            },
        }


def _place(x: float, y: float) -> list[float]:
    """To a tenth of a millimetre."""
    return [round(x, 4), round(y, 4)]


def _time(name: str, stamp_ns: int | None, clock: Clock) -> dict[str, object]:
    return {f"{name}_ns": stamp_ns, name: None if stamp_ns is None else clock.text(stamp_ns)}
