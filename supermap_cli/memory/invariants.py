"""Invariants of every map, as SQL that finds violations, portable between databases.

The lifetime of an instance consists of its states: half-open intervals from `first_seen_ns` to `gone_ns`, if set.
Invariants in a database's own SQL are part of its dialect; those of transforms and blobs are in `checking`.
"""

from __future__ import annotations

from collections.abc import Iterator

from sqlalchemy import Double

from supermap_cli.memory.values import Invariant
from supermap_schema import models

_PARTS = """WITH RECURSIVE part(number, survivor) AS (SELECT number, number FROM instance UNION
    SELECT part.number, instance.merged_into FROM part JOIN instance ON instance.number = part.survivor
    WHERE instance.merged_into IS NOT NULL)"""
"""Every instance paired with itself and with every instance that it was merged into."""

_NOW = "(SELECT max(coalesce(mapped_ns, end_ns)) FROM traversal)"
_NEWEST = "(SELECT max(newest.state_index) FROM state newest WHERE newest.instance_number = i.number)"
_NEWEST_STATE = f"state s ON s.instance_number = i.number AND s.state_index = {_NEWEST}"
_FIT_M = """(SELECT CASE WHEN count(*) > 0 THEN 0.1 ELSE 1e-6 END AS m FROM traversal
    WHERE config LIKE '%"merged_from"%')"""
"""Tolerance in metres between an instance's place and its newest state's.

Both are equal, but in merged maps: there a state's box is rotated as a whole, an instance's voxels into another grid.
"""

KEYFRAMES_LOST = "keyframes were lost in damage to the map"
"""A warning of a recovered traversal: its things then have times at which no keyframe is left."""

_PLACE = ("x", "y", "z", "center_x", "center_y", "center_z", "size_z")

_COUNTED = f"""{_PARTS}, counted(number, n) AS (SELECT part.survivor, sum(own.n) FROM part JOIN
    (SELECT instance_number, count(*) AS n FROM observation GROUP BY instance_number) own
    ON own.instance_number = part.number GROUP BY part.survivor)"""
"""The number of observations of every instance with those merged into it."""

_EDGE = """SELECT subject.id || ' ' || e.relation || ' ' || object.id || ' since ' || e.since_ns FROM spatial_edge e
    JOIN instance subject ON subject.number = e.subject_number
    JOIN instance object ON object.number = e.object_number"""
_CHANGE = """SELECT e.kind || ' ' || source.id || ' ' || target.id || ' at ' || e.not_after_ns FROM temporal_edge e
    JOIN instance source ON source.number = e.from_number JOIN instance target ON target.number = e.to_number"""


def _ends(number: str) -> str:
    """Whether an edge spans a gap between two states of `number`."""
    return f"""EXISTS (SELECT 1 FROM state s LEFT JOIN state n ON n.instance_number = s.instance_number
        AND n.state_index = s.state_index + 1 WHERE s.instance_number = {number} AND s.gone_ns > e.since_ns
        AND s.gone_ns < coalesce(e.until_ns, {_NOW}) AND (n.first_seen_ns IS NULL OR n.first_seen_ns > s.gone_ns))"""


def _begins(number: str) -> str:
    """Whether an edge begins in one of the states of `number`."""
    return f"""EXISTS (SELECT 1 FROM state s WHERE s.instance_number = {number} AND s.first_seen_ns <= e.since_ns
        AND (s.gone_ns IS NULL OR e.since_ns < s.gone_ns))"""


TRAVERSALS = (
    Invariant(
        "traversal",
        "begins before the end of the one built before it",
        """SELECT b.name FROM traversal a JOIN traversal b ON b.number > a.number WHERE b.start_ns < a.mapped_ns""",
    ),
    Invariant(
        "traversal",
        "is being built although a later one was",
        """SELECT a.name FROM traversal a WHERE a.status = 'building'
           AND EXISTS (SELECT 1 FROM traversal b WHERE b.number > a.number)""",
    ),
    Invariant(
        "traversal",
        "does not say what its newest keyframe is",
        """SELECT t.name FROM traversal t LEFT JOIN (SELECT traversal_id, max(stamp_ns) AS newest FROM keyframe
           GROUP BY traversal_id) k ON k.traversal_id = t.id WHERE coalesce(k.newest, 0) <> coalesce(t.mapped_ns, 0)""",
    ),
    Invariant(
        "traversal",
        "counts other keyframes or observations than it has",
        """SELECT name FROM traversal t WHERE keyframes <> (SELECT count(*) FROM keyframe k WHERE k.traversal_id = t.id)
           OR observations <> (SELECT count(*) FROM keyframe k JOIN observation o ON o.keyframe_id = k.id
                               WHERE k.traversal_id = t.id)""",
    ),
    Invariant(
        "keyframe",
        "lies outside its traversal's span",
        """SELECT t.name || ' ' || k.stamp_ns FROM keyframe k JOIN traversal t ON t.id = k.traversal_id
           WHERE k.stamp_ns < t.start_ns OR k.stamp_ns > t.end_ns""",
    ),
    *(
        Invariant(
            table,
            "belongs to a traversal that is not being built",
            f"""SELECT t.name || ' ' || {row} FROM {table} b JOIN traversal t ON t.id = b.traversal_id
                WHERE t.status <> 'building'""",
        )
        for table, row in (("before_image", "b.table_name || ' ' || b.row_key"), ("checkpoint", "b.part"))
    ),
)

INSTANCES = (
    Invariant(
        "instance",
        "has no state",
        """SELECT id FROM instance WHERE merged_into IS NULL
           AND NOT EXISTS (SELECT 1 FROM state WHERE state.instance_number = instance.number)""",
    ),
    Invariant(
        "instance",
        "was first or last seen at other times than its states say",
        """SELECT i.id FROM instance i JOIN (SELECT instance_number, min(first_seen_ns) AS first_ns,
           max(last_seen_ns) AS last_ns FROM state GROUP BY instance_number) s ON s.instance_number = i.number
           WHERE i.merged_into IS NULL AND (i.first_seen_ns <> s.first_ns OR i.last_seen_ns <> s.last_ns)""",
    ),
    Invariant(
        "instance",
        "was seen before the traversal that found it",
        """SELECT i.id FROM instance i JOIN traversal t ON t.id = i.traversal_id WHERE i.first_seen_ns < t.start_ns""",
    ),
    Invariant(
        "instance",
        "counts as present although its newest state is gone",
        f"""SELECT i.id FROM instance i JOIN state s ON s.instance_number = i.number WHERE i.merged_into IS NULL
            AND i.presence = 'present' AND s.gone_ns IS NOT NULL AND s.state_index = {_NEWEST}""",
    ),
    Invariant(
        "instance",
        "counts as absent although its newest state goes on",
        f"""SELECT i.id FROM instance i JOIN state s ON s.instance_number = i.number WHERE i.merged_into IS NULL
            AND i.presence = 'absent' AND s.gone_ns IS NULL AND s.state_index = {_NEWEST}""",
    ),
    Invariant(
        "instance",
        "counts fewer observations than it has",
        f"""{_COUNTED} SELECT i.id FROM instance i JOIN counted c ON c.number = i.number WHERE i.observations < c.n""",
    ),
    Invariant(
        "instance",
        "counts more observations than it has, and none was given up",
        f"""{_COUNTED} SELECT i.id FROM instance i LEFT JOIN counted c ON c.number = i.number
            WHERE i.observations > coalesce(c.n, 0) AND NOT EXISTS (SELECT 1 FROM traversal t
                WHERE t.start_ns <= i.last_seen_ns AND t.observations_kept_from_ns > i.first_seen_ns)""",
    ),
    Invariant(
        "instance",
        "lies elsewhere or is larger or smaller than its newest state",
        f"""SELECT i.id FROM instance i JOIN {_NEWEST_STATE} CROSS JOIN {_FIT_M} fit WHERE i.merged_into IS NULL AND (
            {" OR ".join(f"abs(i.{axis} - s.{axis}) > fit.m" for axis in _PLACE)}
            OR abs(i.size_x + i.size_y - s.size_x - s.size_y) > fit.m)""",
    ),
    Invariant(
        "instance",
        "has another label than its newest state",
        f"""SELECT i.id FROM instance i JOIN {_NEWEST_STATE} WHERE i.merged_into IS NULL AND i.label <> s.label""",
    ),
    Invariant(
        "instance",
        "is merged into itself in a circle",
        """WITH RECURSIVE part(number, survivor) AS (SELECT number, merged_into FROM instance
           WHERE merged_into IS NOT NULL UNION SELECT part.number, instance.merged_into FROM part
           JOIN instance ON instance.number = part.survivor WHERE instance.merged_into IS NOT NULL)
           SELECT i.id FROM part JOIN instance i ON i.number = part.number WHERE part.number = part.survivor""",
    ),
    Invariant(
        "visit",
        "has support outside its traversal's span",
        """SELECT i.id || ' in ' || t.name FROM visit v JOIN traversal t ON t.id = v.traversal_id
           JOIN instance i ON i.number = v.instance_number
           WHERE v.first_support_ns < t.start_ns OR v.last_support_ns > t.end_ns""",
    ),
    Invariant(
        "visit",
        "is missing although the thing was observed",
        """SELECT i.id || ' in ' || t.name FROM (SELECT DISTINCT o.instance_number, k.traversal_id FROM observation o
               JOIN keyframe k ON k.id = o.keyframe_id) seen
           JOIN instance i ON i.number = seen.instance_number JOIN traversal t ON t.id = seen.traversal_id
           LEFT JOIN visit v ON v.traversal_id = seen.traversal_id AND v.instance_number = seen.instance_number
           WHERE i.merged_into IS NULL AND v.instance_number IS NULL""",
    ),
    Invariant(
        "visit",
        "has more support than views, or none and yet a time of it",
        """SELECT i.id || ' in ' || t.name FROM visit v JOIN traversal t ON t.id = v.traversal_id
           JOIN instance i ON i.number = v.instance_number WHERE v.supported > v.in_view
           OR (v.supported > 0) <> (v.first_support_ns IS NOT NULL)
           OR (v.supported > 0) <> (v.last_support_ns IS NOT NULL)""",
    ),
    Invariant(
        "visit",
        "is of a traversal before the one that found the thing",
        """SELECT i.id || ' in ' || t.name FROM visit v JOIN traversal t ON t.id = v.traversal_id
           JOIN instance i ON i.number = v.instance_number JOIN traversal found ON found.id = i.traversal_id
           WHERE t.number < found.number""",
    ),
)

STATES = (
    Invariant(
        "state",
        "was first or last seen at a time that is no keyframe's",
        f"""SELECT i.id || ' state ' || s.state_index FROM state s JOIN instance i ON i.number = s.instance_number
           WHERE (s.first_seen_ns NOT IN (SELECT stamp_ns FROM keyframe)
           OR s.last_seen_ns NOT IN (SELECT stamp_ns FROM keyframe))
           AND NOT EXISTS (SELECT 1 FROM traversal t WHERE t.warnings LIKE '%{KEYFRAMES_LOST}%' AND
           (s.first_seen_ns BETWEEN t.start_ns AND t.end_ns OR s.last_seen_ns BETWEEN t.start_ns AND t.end_ns))""",
    ),
    Invariant(
        "state",
        "has another one before it, and no change leads to it",
        """SELECT i.id || ' state ' || s.state_index FROM state s JOIN instance i ON i.number = s.instance_number
           WHERE s.state_index > 0 AND NOT EXISTS (SELECT 1 FROM temporal_edge e
               WHERE e.to_number = s.instance_number AND e.to_state = s.state_index)""",
    ),
    Invariant(
        "state",
        "overlaps another state of its instance",
        """SELECT i.id || ' state ' || a.state_index FROM state a JOIN state b ON b.instance_number = a.instance_number
           AND b.state_index > a.state_index JOIN instance i ON i.number = a.instance_number
           WHERE b.first_seen_ns <= a.last_seen_ns AND a.first_seen_ns <= b.last_seen_ns""",
    ),
    Invariant(
        "state",
        "comes later than the state after it, or is gone only after that was seen",
        """SELECT i.id || ' state ' || a.state_index FROM state a JOIN state b ON b.instance_number = a.instance_number
           AND b.state_index = a.state_index + 1 JOIN instance i ON i.number = a.instance_number
           WHERE b.first_seen_ns < a.last_seen_ns OR b.first_seen_ns < a.gone_ns""",
    ),
    Invariant(
        "state",
        "has a number but not all the numbers before it",
        """SELECT i.id || ' state ' || a.state_index FROM state a JOIN instance i ON i.number = a.instance_number
           WHERE a.state_index > 0 AND NOT EXISTS (SELECT 1 FROM state b WHERE b.instance_number = a.instance_number
           AND b.state_index = a.state_index - 1)""",
    ),
    Invariant(
        "state",
        "is not gone although another one follows it",
        """SELECT i.id || ' state ' || a.state_index FROM state a JOIN state b ON b.instance_number = a.instance_number
           AND b.state_index = a.state_index + 1 JOIN instance i ON i.number = a.instance_number
           WHERE a.gone_ns IS NULL""",
    ),
    Invariant(
        "state",
        "has no observation between its first and its last support, and none was given up",
        f"""{_PARTS} SELECT i.id || ' state ' || s.state_index FROM state s
            JOIN instance i ON i.number = s.instance_number
            WHERE NOT EXISTS (SELECT 1 FROM part JOIN observation o ON o.instance_number = part.number
                JOIN keyframe k ON k.id = o.keyframe_id WHERE part.survivor = s.instance_number
                AND k.stamp_ns BETWEEN s.first_seen_ns AND s.last_seen_ns)
            AND NOT EXISTS (SELECT 1 FROM traversal t WHERE t.start_ns <= s.last_seen_ns
                AND t.end_ns >= s.first_seen_ns AND t.observations_kept_from_ns > s.first_seen_ns)""",
    ),
)

EDGES = (
    Invariant(
        "spatial_edge",
        "begins when one of its ends did not stand anywhere",
        f"""{_EDGE} WHERE e.since_ns < subject.first_seen_ns OR e.since_ns < object.first_seen_ns
            OR (subject.merged_into IS NULL AND NOT {_begins("e.subject_number")})
            OR (object.merged_into IS NULL AND NOT {_begins("e.object_number")})""",
    ),
    Invariant(
        "spatial_edge",
        "goes on when one of its ends was gone",
        f"{_EDGE} WHERE {_ends('e.subject_number')} OR {_ends('e.object_number')}",
    ),
    Invariant(
        "spatial_edge",
        "goes on although one of its ends is part of another thing",
        f"""{_EDGE} WHERE e.until_ns IS NULL
            AND (subject.merged_into IS NOT NULL OR object.merged_into IS NOT NULL)""",
    ),
    Invariant(
        "spatial_edge",
        "overlaps another one of the same ends and relation",
        f"""{_EDGE} JOIN spatial_edge later ON later.subject_number = e.subject_number AND later.relation = e.relation
            AND later.object_number = e.object_number AND later.since_ns > e.since_ns
            WHERE e.until_ns IS NULL OR e.until_ns > later.since_ns""",
    ),
    Invariant(
        "temporal_edge",
        "lacks the state that it comes from or leads to",
        f"""{_CHANGE} WHERE (e.from_state IS NULL AND e.kind <> 'appeared')
            OR (e.to_state IS NULL AND e.kind <> 'disappeared')
            OR (e.from_number <> e.to_number AND e.kind NOT IN ('merged', 'split', 'candidate'))""",
    ),
    Invariant(
        "temporal_edge",
        "lies before its first end was seen",
        f"""{_CHANGE} LEFT JOIN state f ON f.instance_number = e.from_number AND f.state_index = e.from_state
            WHERE e.not_after_ns < f.first_seen_ns
            OR (e.kind <> 'appeared' AND e.not_before_ns < source.first_seen_ns)""",
    ),
    Invariant(
        "temporal_edge",
        "lies outside the time in which its second end stood there",
        f"""{_CHANGE} JOIN state t ON t.instance_number = e.to_number AND t.state_index = e.to_state
            WHERE e.not_after_ns < t.first_seen_ns OR e.not_after_ns > {_NOW}
            OR (e.kind <> 'disappeared' AND e.not_after_ns > coalesce(t.gone_ns, {_NOW}))""",
    ),
    Invariant(
        "temporal_edge",
        "says that a thing disappeared whose state goes on",
        f"""{_CHANGE} JOIN state f ON f.instance_number = e.from_number AND f.state_index = e.from_state
            WHERE e.kind = 'disappeared' AND f.gone_ns IS NULL""",
    ),
)


def _finite() -> Iterator[Invariant]:
    """JSON has no infinity, and no result computed with it would be meaningful."""
    for table in models.Base.metadata.sorted_tables:
        reals = [column.name for column in table.columns if isinstance(column.type, Double)]
        if reals:
            infinite = " OR ".join(f"NOT {name} BETWEEN -1e15 AND 1e15" for name in reals)
            row = "id" if "id" in table.columns else "number"
            yield Invariant(
                table.name, "holds a number that is not finite", f"SELECT {row} FROM {table.name} WHERE {infinite}"
            )


NUMBERS = tuple(_finite())

INVARIANTS = (*TRAVERSALS, *INSTANCES, *STATES, *EDGES, *NUMBERS)
