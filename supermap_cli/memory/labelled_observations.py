"""Reads the observations of many instances together: when each was made, with which label and score."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence

from sqlalchemy import select

from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import LabelledObservation, StoredInstance
from supermap_schema import models

_Keyframe, _Observation = models.Keyframe, models.Observation
_COLUMNS = (
    _Observation.instance_number,
    _Observation.id,
    _Observation.keyframe_id,
    _Observation.label,
    _Observation.score,
    _Observation.crop_jpeg.is_not(None).label("has_crop"),
)


class LabelledObservations:
    """The observations of some traversals, or of all.

    For single traversals the observations are found by ranges of the index on instance and keyframe, with keyframe ids
    read beforehand; those of other traversals are not read.
    """

    def __init__(self, reader: MapReader, traversal_ids: Iterable[int] | None = None) -> None:
        self._connection = reader.connection
        self._stamps_ns: dict[int, dict[int, int]] | None = None
        if traversal_ids is not None:
            self._stamps_ns = {id_: self._keyframes(id_) for id_ in sorted(set(traversal_ids))}

    def of(self, instances: Collection[StoredInstance]) -> dict[int, list[LabelledObservation]]:
        """The observations of instances by their numbers, in the order of time."""
        survivors = {part: instance.number for instance in instances for part in instance.numbers}
        found: dict[int, list[LabelledObservation]] = defaultdict(list)
        for batch in batches(sorted(survivors)):
            for number, observation in self._read(batch):
                found[survivors[number]].append(observation)
        for observations in found.values():
            observations.sort(key=lambda observation: (observation.stamp_ns, observation.id))
        return found

    def _read(self, numbers: Sequence[int]) -> Iterator[tuple[int, LabelledObservation]]:
        statement = select(*_COLUMNS).where(_Observation.instance_number.in_(numbers))
        if self._stamps_ns is None:
            dated = statement.add_columns(_Keyframe.traversal_id, _Keyframe.stamp_ns)
            dated = dated.join(_Keyframe, _Keyframe.id == _Observation.keyframe_id)
            for number, id_, _, label, score, has_crop, traversal_id, stamp_ns in self._connection.execute(dated):
                yield number, LabelledObservation(id_, traversal_id, stamp_ns, label, score, bool(has_crop))
            return
        for traversal_id, stamps_ns in self._stamps_ns.items():
            if stamps_ns:
                within = statement.where(_Observation.keyframe_id.between(min(stamps_ns), max(stamps_ns)))
                for number, id_, keyframe_id, label, score, has_crop in self._connection.execute(within):
                    if (stamp_ns := stamps_ns.get(keyframe_id)) is not None:
                        yield number, LabelledObservation(id_, traversal_id, stamp_ns, label, score, bool(has_crop))

    def _keyframes(self, traversal_id: int) -> dict[int, int]:
        """The stamps of a traversal's keyframes by id; ids of other traversals may lie in between."""
        statement = select(_Keyframe.id, _Keyframe.stamp_ns).where(_Keyframe.traversal_id == traversal_id)
        return {row.id: row.stamp_ns for row in self._connection.execute(statement)}
