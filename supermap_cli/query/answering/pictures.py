"""The stored picture that proves an answer."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.errors import QueryError
from supermap_cli.memory.images import crop_jpegs, crops_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answering.document import Answer


@dataclass(frozen=True)
class Picture:
    """A crop (JPEG) of an instance, and when it was taken."""

    id: str
    observation: int
    stamp_ns: int
    jpeg: bytes


def picture_of(answer: Answer, reader: MapReader) -> Picture:
    """The best crop of the first instance of an answer that has one, of the time that the answer speaks of if possible.

    Raises `QueryError` where no instance of the answer has a picture.
    """
    cure = "ask for things that are in the map; pictures may have been pruned (`supermap db info`)"
    for view in answer.instances:
        instance = reader.instance(view.id)
        if instance is None:
            continue
        crops = crops_of(reader, [instance.number]).get(instance.number, [])
        spans = [(interval.first_seen_ns, interval.last_seen_ns) for interval in view.intervals]
        then = [crop for crop in crops if any(low <= crop.stamp_ns <= high for low, high in spans)]
        for crop in sorted(then, key=lambda crop: -crop.score) + sorted(crops, key=lambda crop: -crop.score):
            jpeg = crop_jpegs(reader, [crop.observation]).get(crop.observation)
            if jpeg is not None:
                return Picture(view.id, crop.observation, crop.stamp_ns, jpeg)
    raise QueryError("no picture proves this answer", where=answer.query, cure=cure)
