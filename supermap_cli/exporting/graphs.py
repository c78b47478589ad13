"""The scene graph as GraphML (Gephi, yEd, networkx) or DOT (Graphviz): a node per instance, spatial and temporal edges.

GraphML 1.0: http://graphml.graphdrawing.org/specification.html; DOT: https://graphviz.org/doc/info/lang.html. A
temporal edge within one instance (it moved) is a loop; a pair of nodes may have several edges.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TextIO
from xml.sax.saxutils import escape, quoteattr

from supermap_cli.drawing.colours import colour_of, hex_of
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.exporting.tables import SPATIAL_EDGES, TEMPORAL_EDGES
from supermap_cli.printable import printable_line

Value = str | int | float | None
_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML 1.0 cannot hold, not even as a reference (production 2, Char)."""

NODE_KEYS: Mapping[str, str] = {
    "label": "string",
    "presence": "string",
    "confidence": "double",
    "observations": "long",
    **dict.fromkeys(("x", "y", "z", "size_x", "size_y", "size_z", "yaw"), "double"),
    "first_seen_ns": "long",
    "last_seen_ns": "long",
    "first_traversal": "string",
}
EDGE_KEYS: Mapping[str, str] = {
    "layer": "string",
    "kind": "string",
    "since_ns": "long",
    "until_ns": "long",
    "not_before_ns": "long",
    "not_after_ns": "long",
    "from_state": "long",
    "to_state": "long",
    "distance_m": "double",
    "confidence": "double",
    "traversal": "string",
}
"""Name of an attribute -> its type in GraphML. A spatial edge has an interval, a temporal one bounds of its time."""


@dataclass(frozen=True)
class _Edge:
    start: str
    end: str
    values: Mapping[str, Value]


def write_graphml(source: ExportSource, file: TextIO) -> tuple[int, int]:
    """Write the graph; returns the numbers of nodes and edges."""
    file.write('<?xml version="1.0" encoding="UTF-8"?>\n<graphml xmlns="http://graphml.graphdrawing.org/xmlns">\n')
    for about, keys in (("node", NODE_KEYS), ("edge", EDGE_KEYS)):
        for name, kind in keys.items():
            file.write(f'<key id="{about}_{name}" for="{about}" attr.name="{name}" attr.type="{kind}"/>\n')
    file.write('<graph edgedefault="directed">\n')

    def node(text_id: str, values: Mapping[str, Value]) -> None:
        file.write(f"<node id={_attribute(text_id)}>{_data('node', values)}</node>\n")

    def edge(number: int, found: _Edge) -> None:
        ends = f"source={_attribute(found.start)} target={_attribute(found.end)}"
        file.write(f'<edge id="e{number}" {ends}>{_data("edge", found.values)}</edge>\n')

    counts = _write(source, node, edge)
    file.write("</graph>\n</graphml>\n")
    return counts


def write_dot(source: ExportSource, file: TextIO) -> tuple[int, int]:
    """Write the graph, ready to be drawn; returns the numbers of nodes and edges."""
    file.write('digraph "supermap" {\n  graph [overlap=false, splines=true, rankdir=BT];\n')
    file.write('  node [shape=box, style="rounded,filled", fontname="Helvetica"];\n')
    file.write('  edge [fontname="Helvetica", fontsize=10];\n')

    def node(text_id: str, values: Mapping[str, Value]) -> None:
        colour = hex_of(colour_of(str(values["label"])))
        faint = values["presence"] != "present"
        style = "rounded,dashed" if faint else "rounded,filled"
        tip = f"{values['label']}, {values['presence']}, at {values['x']:.2f} {values['y']:.2f} {values['z']:.2f} m"
        attributes = {"label": text_id, "color": colour, "fillcolor": f"{colour}33", "style": style, "tooltip": tip}
        file.write(f"  {_quoted(text_id)} [{_attributes(attributes)}];\n")

    def edge(_: int, found: _Edge) -> None:
        spatial = found.values["layer"] == "spatial"
        moved = found.values.get("distance_m")
        label = f"{found.values['kind']}" if moved is None else f"{found.values['kind']} {moved:.1f} m"
        colour = "#475569" if spatial else "#b45309"
        attributes = {"label": label, "color": colour, "fontcolor": colour, "style": "solid" if spatial else "dashed"}
        file.write(f"  {_quoted(found.start)} -> {_quoted(found.end)} [{_attributes(attributes)}];\n")

    counts = _write(source, node, edge)
    file.write("}\n")
    return counts


def _write(
    source: ExportSource,
    node: Callable[[str, Mapping[str, Value]], None],
    edge: Callable[[int, _Edge], None],
) -> tuple[int, int]:
    ids: set[str] = set()
    for instance in source.with_progress("nodes", source.instances()):
        (x, y, z), size = instance.centroid_map.tolist(), instance.box.size.tolist()
        values: dict[str, Value] = {
            "label": instance.label,
            "presence": instance.presence,
            "observations": instance.observations,
            "confidence": float(instance.states[-1].confidence),
            "x": x,
            "y": y,
            "z": z,
            "size_x": size[0],
            "size_y": size[1],
            "size_z": size[2],
            "yaw": float(instance.box.yaw),
            "first_seen_ns": instance.first_seen_ns,
            "last_seen_ns": instance.last_seen_ns,
            "first_traversal": source.traversal_names[instance.traversal_id],
        }
        node(instance.id, values)
        ids.add(instance.id)
    count = 0
    for found in source.with_progress("edges", _edges(source)):
        if found.start in ids and found.end in ids:
            edge(count, found)
            count += 1
    return len(ids), count


def _edges(source: ExportSource) -> Iterator[_Edge]:
    spatial = [column.name for column in SPATIAL_EDGES.columns]
    for row in SPATIAL_EDGES.rows(source):
        cells = dict(zip(spatial, row, strict=True))
        start, end, kind = (str(cells.pop(name)) for name in ("subject", "object", "relation"))
        yield _Edge(start, end, {"layer": "spatial", "kind": kind, **cells})
    temporal = [column.name for column in TEMPORAL_EDGES.columns]
    for row in TEMPORAL_EDGES.rows(source):
        cells = dict(zip(temporal, row, strict=True))
        start, end, confidence = str(cells.pop("from_id")), str(cells.pop("to_id")), cells.pop("probability")
        yield _Edge(start, end, {"layer": "temporal", **cells, "confidence": confidence})


def _data(about: str, values: Mapping[str, Value]) -> str:
    return "".join(
        f'<data key="{about}_{name}">{escape(_xml_text(value))}</data>'
        for name, value in values.items()
        if value is not None
    )


def _xml_text(value: Value) -> str:
    """What XML can hold: other characters become U+FFFD."""
    return _NOT_IN_XML.sub("\ufffd", str(value))


def _attribute(text: str) -> str:
    return quoteattr(_xml_text(text))


def _attributes(values: Mapping[str, str]) -> str:
    return ", ".join(f"{name}={_quoted(text)}" for name, text in values.items())


def _quoted(text: str) -> str:
    """A quoted string of DOT. A backslash would begin an escape in a label: it is doubled."""
    line = printable_line(text).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{line}"'
