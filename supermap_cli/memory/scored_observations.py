"""Observations of many instances with their scores only, read together."""

from __future__ import annotations

from collections.abc import Collection

from sqlalchemy import select

from supermap_cli.memory.numbers import batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ScoredObservation, StoredInstance
from supermap_schema import models


def scored_observations_of(
    reader: MapReader, instances: Collection[StoredInstance]
) -> dict[int, tuple[ScoredObservation, ...]]:
    """The observations of several instances in the order of time, by instance number."""
    keyframe, observation = models.Keyframe, models.Observation
    owners = {part: instance.number for instance in instances for part in instance.numbers}
    found: dict[int, list[ScoredObservation]] = {instance.number: [] for instance in instances}
    for batch in batches(sorted(owners)):
        statement = (
            select(
                *(observation.id, observation.score, observation.instance_number),
                *(keyframe.traversal_id, keyframe.stamp_ns),
            )
            .join(keyframe, keyframe.id == observation.keyframe_id)
            .where(observation.instance_number.in_(batch))
        )
        for row in reader.connection.execute(statement):
            seen = ScoredObservation(row.id, row.traversal_id, row.stamp_ns, row.score)
            found[owners[row.instance_number]].append(seen)
    return {
        number: tuple(sorted(observations, key=lambda seen: (seen.stamp_ns, seen.id)))
        for number, observations in found.items()
    }
