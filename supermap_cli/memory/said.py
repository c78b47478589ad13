"""What traversals said of many things, read together: which observation, when, what it was called, how surely."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence

from sqlalchemy import select

from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import Said, StoredInstance
from supermap_schema import models

_Keyframe, _Observation = models.Keyframe, models.Observation
_TOLD = (
    _Observation.instance_number,
    _Observation.id,
    _Observation.keyframe_id,
    _Observation.label,
    _Observation.score,
    _Observation.crop_jpeg.is_not(None).label("cropped"),
)


class Hearing:
    """What some traversals said, or all of them.

    Of one traversal the observations of an instance lie together in the index, and its keyframes are known beforehand:
    others' are not read.
    """

    def __init__(self, reader: MapReader, traversal_ids: Iterable[int] | None = None) -> None:
        self._connection = reader.connection
        self._stamps_ns: dict[int, dict[int, int]] | None = None
        if traversal_ids is not None:
            self._stamps_ns = {each: self._keyframes(each) for each in sorted(set(traversal_ids))}

    def of(self, things: Collection[StoredInstance]) -> dict[int, list[Said]]:
        """What they said of instances, by their numbers, in the order of time."""
        survivors = {part: each.number for each in things for part in each.numbers}
        said: dict[int, list[Said]] = defaultdict(list)
        for batch in batches(sorted(survivors)):
            for number, each in self._said(batch):
                said[survivors[number]].append(each)
        for of_one in said.values():
            of_one.sort(key=lambda each: (each.stamp_ns, each.id))
        return said

    def _said(self, numbers: Sequence[int]) -> Iterator[tuple[int, Said]]:
        statement = select(*_TOLD).where(_Observation.instance_number.in_(numbers))
        if self._stamps_ns is None:
            dated = statement.add_columns(_Keyframe.traversal_id, _Keyframe.stamp_ns)
            dated = dated.join(_Keyframe, _Keyframe.id == _Observation.keyframe_id)
            for number, id_, _, label, score, cropped, traversal_id, stamp_ns in self._connection.execute(dated):
                yield number, Said(id_, traversal_id, stamp_ns, label, score, bool(cropped))
            return
        for traversal_id, stamps_ns in self._stamps_ns.items():
            if stamps_ns:
                within = statement.where(_Observation.keyframe_id.between(min(stamps_ns), max(stamps_ns)))
                for number, id_, keyframe_id, label, score, cropped in self._connection.execute(within):
                    if (stamp_ns := stamps_ns.get(keyframe_id)) is not None:
                        yield number, Said(id_, traversal_id, stamp_ns, label, score, bool(cropped))

    def _keyframes(self, traversal_id: int) -> dict[int, int]:
        """A traversal's keyframes with their stamps: others' may lie between the first and the last."""
        statement = select(_Keyframe.id, _Keyframe.stamp_ns).where(_Keyframe.traversal_id == traversal_id)
        return {row.id: row.stamp_ns for row in self._connection.execute(statement)}
