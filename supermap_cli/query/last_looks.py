"""When somebody last looked at the places of things: what stands there by the map may have gone since."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, func, select

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.query.time_points import TimePoint
from supermap_cli.query.views import DEFAULT_LIMIT, Vector, vector
from supermap_schema.models import Instance, Visit


@dataclass(frozen=True)
class LastLook:
    """A thing's place: when the thing was last seen there, and the last traversal in which its place was in view, with
    that traversal's end (a traversal stores no time of a look that did not find the thing). `None`: in no traversal.
    """

    id: str
    label: str
    presence: str
    position: Vector
    last_seen_ns: int
    looked_at_in: str | None
    looked_at_until_ns: int | None


@dataclass(frozen=True)
class UnseenPlaces:
    """Places of things that stand by the map, and that nobody has looked at since a time; `more` are not listed."""

    since: str
    since_ns: int
    places: tuple[LastLook, ...]
    more: int


def last_looks(reader: MapReader, ids: Collection[str]) -> tuple[LastLook, ...]:
    """The last looks at some instances, by their ids."""
    found = [instance for text_id in dict.fromkeys(ids) if (instance := reader.instance(text_id)) is not None]
    return tuple(_last_look(instance, reader.traversals) for instance in found)


def places_not_seen_since(reader: MapReader, since: TimePoint, limit: int = DEFAULT_LIMIT) -> UnseenPlaces:
    """The present instances whose place was in view in no traversal that ended after `since`, those seen last first.

    A traversal that was under way then counts for what it still saw of a thing afterwards.
    """
    later = [traversal for traversal in reader.traversals if traversal.start_ns > since.at_ns]
    under_way = [traversal for traversal in reader.traversals if traversal.start_ns <= since.at_ns < traversal.end_ns]
    seen = select(Visit.instance_number).where(
        Visit.traversal_id.in_([traversal.id for traversal in later]) & (Visit.in_view > 0)
        | Visit.traversal_id.in_([traversal.id for traversal in under_way]) & (Visit.last_support_ns > since.at_ns)
    )
    seen_by_survivors = {reader.survivors[number] for number in _merged_among(reader, seen)}
    wanted = (Instance.presence == "present") & Instance.merged_into.is_(None) & (Instance.last_seen_ns <= since.at_ns)
    unseen = select(Instance.number).where(wanted & Instance.number.not_in(seen))
    if seen_by_survivors:
        unseen = unseen.where(Instance.number.not_in(seen_by_survivors))
    total = reader.connection.execute(select(func.count()).select_from(unseen.subquery())).scalar_one()
    newest = unseen.order_by(Instance.last_seen_ns.desc(), Instance.number).limit(limit)
    instances = reader.instances_of(reader.connection.execute(newest).scalars().all())
    ordered = sorted(instances, key=lambda instance: (-instance.last_seen_ns, instance.number))
    places = tuple(_last_look(instance, reader.traversals) for instance in ordered)
    return UnseenPlaces(since.text, since.at_ns, places, total - len(places))


def _merged_among(reader: MapReader, seen: Select[Any]) -> list[int]:
    """Of the instances that were seen, those that are merged into another today."""
    statement = select(Instance.number).where(Instance.merged_into.is_not(None) & Instance.number.in_(seen))
    return list(reader.connection.execute(statement).scalars())


def _last_look(instance: StoredInstance, traversals: tuple[StoredTraversal, ...]) -> LastLook:
    viewed = {visit.traversal_id for visit in instance.visits if visit.in_view > 0 or visit.supported > 0}
    last = next((traversal for traversal in reversed(traversals) if traversal.id in viewed), None)
    return LastLook(
        id=instance.id,
        label=instance.label,
        presence=instance.presence,
        position=vector(instance.centroid_map),
        last_seen_ns=instance.last_seen_ns,
        looked_at_in=None if last is None else last.name,
        looked_at_until_ns=None if last is None else last.mapped_ns or last.end_ns,
    )
