"""Depth images that show a place: those in which the things there were observed, found through indices."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from sqlalchemy import Connection, select

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory import rows
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.types.memory import KeyframeRecord
from supermap_schema import models

_COLUMNS = [column for column in models.Keyframe.__table__.columns if column.name != "thumbnail_jpeg"]


def observing_keyframes(connection: Connection, numbers: Collection[int], most: int) -> list[int]:
    """The ids, ordered, of keyframes in which instances with these numbers were observed: at most so many of each,
    spread evenly.
    """
    observation = models.Observation
    by_number: dict[int, set[int]] = {number: set() for number in numbers}
    for batch in batches(sorted(numbers)):
        columns = select(observation.instance_number, observation.keyframe_id)
        for row in connection.execute(columns.where(observation.instance_number.in_(batch))):
            by_number[row.instance_number].add(row.keyframe_id)
    spread = (sorted(ids)[:: -(-len(ids) // most)] for ids in by_number.values() if ids)
    return sorted({keyframe_id for ids in spread for keyframe_id in ids})


def camera_poses(connection: Connection, ids: Collection[int]) -> dict[int, FloatArray]:
    """`T_map_camera` (4, 4) of keyframes by their ids, in the order of these."""
    keyframe = models.Keyframe
    return {
        row.id: parsed_transform(row.T_map_camera, f"the camera of keyframe {row.id}")
        for batch in batches(sorted(ids))
        for row in connection.execute(
            select(keyframe.id, keyframe.T_map_camera).where(keyframe.id.in_(batch)).order_by(keyframe.id)
        )
    }


def keyframe_traversals(connection: Connection, ids: Collection[int]) -> dict[int, int]:
    """The row ids of the traversals of keyframes, by the keyframes' ids."""
    keyframe = models.Keyframe
    return {
        row.id: row.traversal_id
        for batch in batches(sorted(ids))
        for row in connection.execute(select(keyframe.id, keyframe.traversal_id).where(keyframe.id.in_(batch)))
    }


def keyframe_views(connection: Connection, ids: Collection[int]) -> Iterator[KeyframeRecord]:
    """The keyframes with these ids, in the order of these, without thumbnails."""
    keyframe = models.Keyframe
    for batch in batches(sorted(ids)):
        for row in connection.execute(select(*_COLUMNS).where(keyframe.id.in_(batch)).order_by(keyframe.id)):
            yield rows.keyframe_record(row)
