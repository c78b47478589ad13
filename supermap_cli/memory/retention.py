"""Gives up what is old: crops, observations, thumbnails. States, edges, visits, poses and voxels stay for good.

Whatever is given up, an answer can still be traced: of every state its first and its last observation stay, and the
best one of each traversal that saw it; and the best crop of every state, unless no crop is to be kept at all.

What is to go is declared first (`traversal.*_kept_from_ns`), in one transaction; the database's triggers let nothing
else go. Then it goes in many short ones: killed in between, the map is sound, and the same command goes on.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, Row, delete, func, select, update

from supermap_cli.memory.databases import Database
from supermap_cli.memory.numbers import BATCH, batches
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.types.memory import StateRecord
from supermap_schema.models import Instance, Keyframe, Observation, Traversal

ROW_BYTES = 160
"""About what an observation takes besides its crop and texts: its numbers, and its entries in the indices."""


@dataclass(frozen=True)
class KeptFrom:
    """Sensor times before which crops, observations and thumbnails of keyframes go; `None`: none goes.

    `best_crops`: of every state the best crop stays, however old.
    """

    crops_ns: int | None = None
    observations_ns: int | None = None
    thumbnails_ns: int | None = None
    best_crops: bool = True


@dataclass
class GivenUp:
    """How much of what went, or would go; `size_bytes` is about what that takes."""

    observations: int = 0
    crops: int = 0
    thumbnails: int = 0
    size_bytes: int = 0

    def add(self, other: GivenUp) -> None:
        """Count more."""
        self.observations += other.observations
        self.crops += other.crops
        self.thumbnails += other.thumbnails
        self.size_bytes += other.size_bytes


@dataclass
class _Condemned:
    """Ids of observations to delete, by traversal, and of those that lose their crop only."""

    observations: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    crops: list[int] = field(default_factory=list)
    given_up: GivenUp = field(default_factory=GivenUp)


def declare(connection: Connection, kept: KeptFrom) -> None:
    """Say in every complete traversal that begins before a limit what it will not have any more."""
    limits = {
        Traversal.crops_kept_from_ns: kept.crops_ns,
        Traversal.observations_kept_from_ns: kept.observations_ns,
        Traversal.thumbnails_kept_from_ns: kept.thumbnails_ns,
    }
    for column, limit_ns in limits.items():
        if limit_ns is not None:
            earlier = Traversal.start_ns < limit_ns
            unsaid = func.coalesce(column, limit_ns) <= limit_ns
            connection.execute(
                update(Traversal).where(Traversal.status == "complete", earlier, unsaid).values({column.key: limit_ns})
            )


def give_up_sightings(
    connection: Connection, database: Database, kept: KeptFrom, after: int | None, *, really: bool
) -> tuple[int | None, GivenUp]:
    """Give up the old observations and crops of the next few instances after a number.

    Returns the number to go on from, `None` at the end, and how much it was; or would be, if not `really`.
    """
    numbers = _next_numbers(connection, after)
    if not numbers:
        return None, GivenUp()
    reader = MapReader(connection, database)
    condemned = _condemned(reader, reader.instances_of(numbers, visits=False), kept)
    if really:
        _take(connection, condemned)
    return numbers[-1], condemned.given_up


def give_up_thumbnails(connection: Connection, traversal: StoredTraversal, before_ns: int, *, really: bool) -> GivenUp:
    """Give up the thumbnails of a traversal's keyframes before a time."""
    old = (
        Keyframe.traversal_id == traversal.id,
        Keyframe.stamp_ns < before_ns,
        Keyframe.thumbnail_jpeg.is_not(None),
    )
    count, size = connection.execute(
        select(func.count(), func.coalesce(func.sum(func.length(Keyframe.thumbnail_jpeg)), 0)).where(*old)
    ).one()
    if really:
        connection.execute(update(Keyframe).where(*old).values(thumbnail_jpeg=None))
    return GivenUp(thumbnails=count, size_bytes=int(size))


def _next_numbers(connection: Connection, after: int | None) -> list[int]:
    statement = select(Instance.number).where(Instance.merged_into.is_(None)).order_by(Instance.number).limit(BATCH)
    if after is not None:
        statement = statement.where(Instance.number > after)
    return list(connection.execute(statement).scalars())


def _condemned(reader: MapReader, instances: Iterable[StoredInstance], kept: KeptFrom) -> _Condemned:
    """What is old, of these instances, and not needed to trace an answer."""
    found = _Condemned()
    shown = list(instances)
    seen = _old_sightings(reader, shown, kept)
    for instance in shown:
        old = seen[instance.number]
        needed, best_crops = _needed(instance.states, old, best_crops=kept.best_crops)
        for row in old:
            goes = row.stamp_ns < _limit(kept.observations_ns) and row.id not in needed
            if goes:
                found.observations[row.traversal_id].append(row.id)
                found.given_up.observations += 1
                found.given_up.size_bytes += ROW_BYTES + row.texts
            if row.crop is not None and (goes or (row.stamp_ns < _limit(kept.crops_ns) and row.id not in best_crops)):
                found.given_up.crops += 1
                found.given_up.size_bytes += row.crop
                if not goes:
                    found.crops.append(row.id)
    return found


def _limit(limit_ns: int | None) -> float:
    return float("-inf") if limit_ns is None else limit_ns


def _old_sightings(reader: MapReader, instances: list[StoredInstance], kept: KeptFrom) -> Mapping[int, list[Row[Any]]]:
    """The observations before the later limit, in complete traversals, by the instance they count for; by time.

    `crop` is how many bytes the crop has (`None`: it has none), `texts` how many the texts have.
    """
    limits = [each for each in (kept.crops_ns, kept.observations_ns) if each is not None]
    seen: dict[int, list[Row[Any]]] = defaultdict(list)
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
            seen[survivor[row.instance_number]].append(row)
    for rows in seen.values():
        rows.sort(key=lambda row: (row.stamp_ns, row.id))
    return seen


def _needed(states: Iterable[StateRecord], old: list[Row[Any]], *, best_crops: bool) -> tuple[set[int], set[int]]:
    """The ids of the observations that every state's evidence needs, and of those whose crop stays."""
    needed: set[int] = set()
    crops: set[int] = set()
    for state in states:
        of_state = [row for row in old if state.first_seen_ns <= row.stamp_ns <= state.last_seen_ns]
        if not of_state:
            continue
        needed |= {of_state[0].id, of_state[-1].id, *_best_of_each_traversal(of_state)}
        pictured = [row for row in of_state if row.crop is not None]
        if best_crops and pictured:
            best = max(pictured, key=_worth).id
            needed.add(best)
            crops.add(best)
    return needed, crops


def _best_of_each_traversal(rows: list[Row[Any]]) -> Iterator[int]:
    best: dict[int, Row[Any]] = {}
    for row in rows:
        known = best.get(row.traversal_id)
        if known is None or _worth(row) > _worth(known):
            best[row.traversal_id] = row
    return (row.id for row in best.values())


def _worth(row: Row[Any]) -> tuple[float, int]:
    """The best score, and of equal ones the first, as in answers."""
    return row.score, -row.id


def _take(connection: Connection, condemned: _Condemned) -> None:
    taken: Counter[int] = Counter()
    for traversal_id, ids in condemned.observations.items():
        for some in batches(ids):
            taken[traversal_id] += connection.execute(delete(Observation).where(Observation.id.in_(some))).rowcount
    for traversal_id, count in taken.items():
        connection.execute(
            update(Traversal).where(Traversal.id == traversal_id).values(observations=Traversal.observations - count)
        )
    for some in batches(condemned.crops):
        connection.execute(update(Observation).where(Observation.id.in_(some)).values(crop_jpeg=None))


Progress = Callable[[int, int], None]
"""Called with how many instances are done, and how many there are."""
