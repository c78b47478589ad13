"""The stored depth images that show the floor: of each viewpoint and traversal the newest ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from sqlalchemy import select

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping import free_space
from supermap_cli.memory.keyframe_views import keyframe_views
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.types.memory import KeyframeRecord
from supermap_schema.models import Keyframe


@dataclass(frozen=True)
class StoredViewpoint:
    """A keyframe's row id, its traversal's number, and `T_map_camera` and `T_map_base` (4, 4)."""

    id: int
    traversal: int
    T_map_camera: FloatArray
    T_map_base: FloatArray


def all_viewpoints(reader: MapReader) -> list[StoredViewpoint]:
    """Every keyframe's, in the order of traversals and of time."""
    numbers = {traversal.id: traversal.number for traversal in reader.traversals}
    columns = select(Keyframe.id, Keyframe.traversal_id, Keyframe.stamp_ns, Keyframe.T_map_camera, Keyframe.T_map_base)
    found = [
        (
            numbers[row.traversal_id],
            row.stamp_ns,
            StoredViewpoint(
                row.id,
                numbers[row.traversal_id],
                parsed_transform(row.T_map_camera, f"the camera of keyframe {row.id}"),
                parsed_transform(row.T_map_base, f"the pose of keyframe {row.id}"),
            ),
        )
        for row in reader.connection.execute(columns)
        if row.traversal_id in numbers
    ]
    return [viewpoint for _, _, viewpoint in sorted(found, key=lambda each: (each[0], each[1], each[2].id))]


def newest_of_each_place(viewpoints: list[StoredViewpoint], most: int, most_traversals: int) -> list[StoredViewpoint]:
    """Of each place (cells of position and direction), from each of the newest traversals that looked from there, at
    most so many: their number is that of the place, not of the traversals.
    """
    kept: dict[tuple[int, ...], dict[int, list[StoredViewpoint]]] = {}
    cell_m, cell_deg = free_space.DEFAULT.cell_m, free_space.DEFAULT.cell_deg
    T = np.array([viewpoint.T_map_camera for viewpoint in viewpoints]).reshape(-1, 4, 4)
    azimuth = np.degrees(np.arctan2(T[:, 1, 2], T[:, 0, 2])) // cell_deg
    elevation = np.degrees(np.arcsin(np.clip(T[:, 2, 2], -1, 1))) // cell_deg
    places = np.column_stack([np.floor(T[:, :3, 3] / cell_m), azimuth, elevation]).astype(np.int64)
    for viewpoint, place in zip(viewpoints, map(tuple, places.tolist()), strict=True):
        kept.setdefault(place, {}).setdefault(viewpoint.traversal, []).append(viewpoint)
    return [
        viewpoint
        for by_traversal in kept.values()
        for traversal in sorted(by_traversal)[-most_traversals:]
        for viewpoint in by_traversal[traversal][-most:]
    ]


def depth_records(
    reader: MapReader, viewpoints: list[StoredViewpoint]
) -> Iterator[tuple[StoredViewpoint, KeyframeRecord]]:
    """The stored depth images of viewpoints, traversal by traversal."""
    for number in sorted({viewpoint.traversal for viewpoint in viewpoints}):
        of_traversal = sorted((each for each in viewpoints if each.traversal == number), key=lambda each: each.id)
        records = keyframe_views(reader.connection, [each.id for each in of_traversal])
        yield from zip(of_traversal, records, strict=True)
