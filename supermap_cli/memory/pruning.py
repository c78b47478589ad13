"""Prunes old crops, observations and thumbnails. States, edges, visits, poses and voxels are never pruned.

Answers stay traceable: of every state the first and the last observation are kept, and the best one of each traversal
that saw it; and the best crop of every state, unless the policy keeps no crops at all.

The limits are declared first (`traversal.*_kept_from_ns`), in one transaction; the database's triggers allow nothing
else to be deleted. Then rows are deleted in many short transactions: if the process is killed in between, the map is
consistent, and the same command continues.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, Row, delete, func, select, update

from supermap_cli.memory.checksums import take_off
from supermap_cli.memory.databases import Database
from supermap_cli.memory.numbers import BATCH, batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.types.memory import StateRecord
from supermap_schema.models import Instance, Keyframe, Observation, Traversal

ROW_BYTES = 160
"""Approximate size of an observation without its crop and texts: 15 numbers and its entries in three indices."""


@dataclass(frozen=True)
class PrunePolicy:
    """Sensor times before which crops, observations and thumbnails of keyframes are pruned; `None`: never.

    `best_crops`: the best crop of every state is kept, however old.
    """

    crops_ns: int | None = None
    observations_ns: int | None = None
    thumbnails_ns: int | None = None
    best_crops: bool = True


@dataclass
class PruneCounts:
    """How many rows or images were pruned, or would be; `size_bytes` is their approximate size."""

    observations: int = 0
    crops: int = 0
    thumbnails: int = 0
    size_bytes: int = 0

    def add(self, other: PruneCounts) -> None:
        """Add another count to this one."""
        self.observations += other.observations
        self.crops += other.crops
        self.thumbnails += other.thumbnails
        self.size_bytes += other.size_bytes


@dataclass
class _PrunePlan:
    """Ids of observations to delete, by traversal, and of those that lose their crop only."""

    observations: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    crops: list[int] = field(default_factory=list)
    counts: PruneCounts = field(default_factory=PruneCounts)


def declare_limits(connection: Connection, policy: PrunePolicy) -> None:
    """Write the policy's limits into every complete traversal that begins before them."""
    limits = {
        Traversal.crops_kept_from_ns: policy.crops_ns,
        Traversal.observations_kept_from_ns: policy.observations_ns,
        Traversal.thumbnails_kept_from_ns: policy.thumbnails_ns,
    }
    for column, limit_ns in limits.items():
        if limit_ns is not None:
            earlier = Traversal.start_ns < limit_ns
            is_raised = func.coalesce(column, limit_ns) <= limit_ns
            connection.execute(
                update(Traversal)
                .where(Traversal.status == "complete", earlier, is_raised)
                .values({column.key: limit_ns})
            )


def prune_observations(
    connection: Connection, database: Database, policy: PrunePolicy, after: int | None, *, dry_run: bool
) -> tuple[int | None, PruneCounts]:
    """Prune the observations and crops of the next `BATCH` instances after a number.

    Returns the number to continue from, `None` at the end, and the counts; with `dry_run` nothing is deleted.
    """
    numbers = _next_numbers(connection, after)
    if not numbers:
        return None, PruneCounts()
    reader = MapReader(connection, database)
    plan = _plan(reader, reader.instances_of(numbers, visits=False), policy)
    if not dry_run:
        _delete(connection, plan)
    return numbers[-1], plan.counts


def prune_thumbnails(
    connection: Connection, traversal: StoredTraversal, before_ns: int, *, dry_run: bool
) -> PruneCounts:
    """Delete the thumbnails of a traversal's keyframes before a time; with `dry_run` only count them."""
    old = (
        Keyframe.traversal_id == traversal.id,
        Keyframe.stamp_ns < before_ns,
        Keyframe.thumbnail_jpeg.is_not(None),
    )
    count, size = connection.execute(
        select(func.count(), func.coalesce(func.sum(func.length(Keyframe.thumbnail_jpeg)), 0)).where(*old)
    ).one()
    if not dry_run:
        for batch in batches(connection.execute(select(Keyframe.id).where(*old)).scalars().all()):
            take_off(connection, "keyframe", batch, only_image=True)
        connection.execute(update(Keyframe).where(*old).values(thumbnail_jpeg=None))
    return PruneCounts(thumbnails=count, size_bytes=int(size))


def _next_numbers(connection: Connection, after: int | None) -> list[int]:
    statement = select(Instance.number).where(Instance.merged_into.is_(None)).order_by(Instance.number).limit(BATCH)
    if after is not None:
        statement = statement.where(Instance.number > after)
    return list(connection.execute(statement).scalars())


def _plan(reader: MapReader, instances: Sequence[StoredInstance], policy: PrunePolicy) -> _PrunePlan:
    """The old observations and crops of some instances that no answer needs."""
    plan = _PrunePlan()
    old_rows = _old_observations(reader, instances, policy)
    for instance in instances:
        old = old_rows[instance.number]
        needed, best_crops = _needed(instance.states, old, best_crops=policy.best_crops)
        for row in old:
            deleted = row.stamp_ns < _limit(policy.observations_ns) and row.id not in needed
            if deleted:
                plan.observations[row.traversal_id].append(row.id)
                plan.counts.observations += 1
                plan.counts.size_bytes += ROW_BYTES + row.texts
            crop_is_old = row.stamp_ns < _limit(policy.crops_ns) and row.id not in best_crops
            if row.crop is not None and (deleted or crop_is_old):
                plan.counts.crops += 1
                plan.counts.size_bytes += row.crop
                if not deleted:
                    plan.crops.append(row.id)
    return plan


def _limit(limit_ns: int | None) -> float:
    return float("-inf") if limit_ns is None else limit_ns


def _old_observations(
    reader: MapReader, instances: Sequence[StoredInstance], policy: PrunePolicy
) -> Mapping[int, list[Row[Any]]]:
    """The observations of complete traversals before the later limit, by surviving instance, in the order of time.

    `crop` is the size of the crop in bytes (`None`: there is none), `texts` that of the texts.
    """
    limits = [limit_ns for limit_ns in (policy.crops_ns, policy.observations_ns) if limit_ns is not None]
    found: dict[int, list[Row[Any]]] = defaultdict(list)
    survivor = {number: instance.number for instance in instances for number in instance.numbers}
    for numbers in batches(sorted(survivor)) if limits else ():
        statement = (
            select(
                Observation.id,
                Observation.instance_number,
                Observation.score,
                func.length(Observation.crop_jpeg).label("crop"),
                (func.length(Observation.hypotheses) + func.length(Observation.label)).label("texts"),
                Keyframe.stamp_ns,
                Keyframe.traversal_id,
            )
            .join(Keyframe, Keyframe.id == Observation.keyframe_id)
            .join(Traversal, Traversal.id == Keyframe.traversal_id)
            .where(
                Observation.instance_number.in_(numbers),
                Keyframe.stamp_ns < max(limits),
                Traversal.status == "complete",
            )
        )
        for row in reader.connection.execute(statement):
            found[survivor[row.instance_number]].append(row)
    for rows in found.values():
        rows.sort(key=lambda row: (row.stamp_ns, row.id))
    return found


def _needed(states: Iterable[StateRecord], old: list[Row[Any]], *, best_crops: bool) -> tuple[set[int], set[int]]:
    """The ids of the observations that are the states' evidence, and of those whose crop is kept."""
    needed: set[int] = set()
    crops: set[int] = set()
    for state in states:
        of_state = [row for row in old if state.first_seen_ns <= row.stamp_ns <= state.last_seen_ns]
        if not of_state:
            continue
        needed |= {of_state[0].id, of_state[-1].id, *_best_of_each_traversal(of_state)}
        with_crop = [row for row in of_state if row.crop is not None]
        if best_crops and with_crop:
            best = max(with_crop, key=_rank).id
            needed.add(best)
            crops.add(best)
    return needed, crops


def _best_of_each_traversal(rows: list[Row[Any]]) -> Iterator[int]:
    best: dict[int, Row[Any]] = {}
    for row in rows:
        known = best.get(row.traversal_id)
        if known is None or _rank(row) > _rank(known):
            best[row.traversal_id] = row
    return (row.id for row in best.values())


def _rank(row: Row[Any]) -> tuple[float, int]:
    """Orders by score, of equal ones the first is greatest, as in answers."""
    return row.score, -row.id


def _delete(connection: Connection, plan: _PrunePlan) -> None:
    deleted: Counter[int] = Counter()
    for traversal_id, ids in plan.observations.items():
        for batch in batches(ids):
            take_off(connection, "observation", batch)
            deleted[traversal_id] += connection.execute(delete(Observation).where(Observation.id.in_(batch))).rowcount
    for traversal_id, count in deleted.items():
        connection.execute(
            update(Traversal).where(Traversal.id == traversal_id).values(observations=Traversal.observations - count)
        )
    for batch in batches(plan.crops):
        take_off(connection, "observation", batch, only_image=True)
        connection.execute(update(Observation).where(Observation.id.in_(batch)).values(crop_jpeg=None))


Progress = Callable[[int, int], None]
"""Called with the number of instances that are done, and of all instances."""
