"""Reads stored images: crops of observations, thumbnails of keyframes with their cameras and poses."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import select

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.stored_values import parsed_transform
from supermap_cli.types.sensing import MAIN_CAMERA
from supermap_schema import models


@dataclass(frozen=True)
class Crop:
    """The stored crop of an observation, without its bytes."""

    observation: int
    traversal_id: int
    keyframe_id: int
    stamp_ns: int
    score: float


@dataclass(frozen=True)
class Thumbnail:
    """A keyframe's thumbnail (JPEG), its camera in full size as JSON, and `T_map_camera` (4, 4).

    `camera_id` names the camera among those of the rig.
    """

    keyframe_id: int
    stamp_ns: int
    jpeg: bytes
    camera: str
    T_map_camera: FloatArray
    camera_id: str = MAIN_CAMERA


def crops_of(reader: MapReader, numbers: Collection[int]) -> dict[int, list[Crop]]:
    """All crops of some instances and of those merged into them, by instance, in the order of time."""
    parts = reader.parts_of(numbers)
    observation, keyframe = models.Observation, models.Keyframe
    found: dict[int, list[Crop]] = defaultdict(list)
    for batch in batches(list(parts)):
        statement = (
            select(
                observation.id,
                observation.instance_number,
                observation.keyframe_id,
                observation.score,
                keyframe.traversal_id,
                keyframe.stamp_ns,
            )
            .join(keyframe, keyframe.id == observation.keyframe_id)
            .where(observation.instance_number.in_(batch), observation.crop_jpeg.is_not(None))
        )
        for row in reader.connection.execute(statement):
            crop = Crop(row.id, row.traversal_id, row.keyframe_id, row.stamp_ns, row.score)
            found[parts[row.instance_number]].append(crop)
    return {
        number: sorted(crops, key=lambda crop: (crop.stamp_ns, crop.observation)) for number, crops in found.items()
    }


def crop_jpegs(reader: MapReader, observations: Collection[int]) -> dict[int, bytes]:
    """The crops of observations as JPEG, by observation id; those that were pruned are missing."""
    observation = models.Observation
    jpegs: dict[int, bytes] = {}
    for batch in batches(sorted(observations)):
        statement = select(observation.id, observation.crop_jpeg).where(observation.id.in_(batch))
        jpegs |= {row.id: row.crop_jpeg for row in reader.connection.execute(statement) if row.crop_jpeg is not None}
    return jpegs


def thumbnails_of(reader: MapReader, stamps_ns: Collection[int]) -> dict[int, list[Thumbnail]]:
    """The thumbnails of the keyframes with these stamps, by stamp those of all cameras in the order of their keyframes.

    Thumbnails that were pruned are missing.
    """
    keyframe = models.Keyframe
    images: dict[int, list[Thumbnail]] = defaultdict(list)
    for batch in batches(sorted(stamps_ns)):
        statement = select(
            *(keyframe.id, keyframe.stamp_ns, keyframe.thumbnail_jpeg, keyframe.camera, keyframe.T_map_camera),
            keyframe.camera_id,
        ).where(keyframe.stamp_ns.in_(batch), keyframe.thumbnail_jpeg.is_not(None))
        for row in reader.connection.execute(statement.order_by(keyframe.id)):
            pose = parsed_transform(row.T_map_camera, f"the camera of keyframe {row.id}")
            image = Thumbnail(row.id, row.stamp_ns, row.thumbnail_jpeg, row.camera, pose, row.camera_id)
            images[row.stamp_ns].append(image)
    return images
