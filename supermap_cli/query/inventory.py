"""The contents of a map database, their sources and timings (`supermap db info`)."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.memory.reading import MapReader
from supermap_cli.query.views import TraversalView, traversal_view
from supermap_schema import SCHEMA_VERSION


@dataclass(frozen=True)
class Inventory:
    """The database as a whole; `versions` and `config` are per traversal, by name."""

    path: str
    version: int
    revision: str
    size_bytes: int
    counts: dict[str, int]
    traversals: tuple[TraversalView, ...]
    versions: dict[str, dict[str, str]]
    config: dict[str, dict[str, object]]


def inventory(reader: MapReader) -> Inventory:
    """Read the inventory of a map."""
    return Inventory(
        path=reader.where,
        version=SCHEMA_VERSION,
        revision=reader.revision(),
        size_bytes=reader.size_bytes(),
        counts=reader.counts(),
        traversals=tuple(map(traversal_view, reader.traversals)),
        versions={traversal.name: dict(traversal.versions) for traversal in reader.traversals},
        config={traversal.name: dict(traversal.config) for traversal in reader.traversals},
    )
