"""Verifies the memory's invariants and says what is wrong where (`supermap db check`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy import Connection, select, text

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import blobs
from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import Problem
from supermap_schema import models


@dataclass(frozen=True)
class Invariant:
    """A rule; `violations` is SQL that gives one column, the name of every row that breaks it."""

    table: str
    rule: str
    violations: str


INVARIANTS = (
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
        "has no observation between its first and its last support",
        """WITH RECURSIVE part(number, survivor) AS (SELECT number, number FROM instance UNION
           SELECT part.number, instance.merged_into FROM part JOIN instance ON instance.number = part.survivor
           WHERE instance.merged_into IS NOT NULL)
           SELECT i.id || ' state ' || s.state_index FROM state s JOIN instance i ON i.number = s.instance_number
           WHERE NOT EXISTS (SELECT 1 FROM part JOIN observation o ON o.instance_number = part.number
           JOIN keyframe k ON k.id = o.keyframe_id WHERE part.survivor = s.instance_number
           AND k.stamp_ns BETWEEN s.first_seen_ns AND s.last_seen_ns)""",
    ),
    Invariant(
        "instance",
        "has no state",
        """SELECT id FROM instance WHERE merged_into IS NULL
           AND NOT EXISTS (SELECT 1 FROM state WHERE state.instance_number = instance.number)""",
    ),
    Invariant(
        "instance",
        "counts as present although its newest state is gone",
        """SELECT i.id FROM instance i JOIN state s ON s.instance_number = i.number
           WHERE i.merged_into IS NULL AND i.presence = 'present' AND s.gone_ns IS NOT NULL AND s.state_index =
           (SELECT max(state_index) FROM state WHERE state.instance_number = i.number)""",
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
        "keyframe",
        "lies outside its traversal's span",
        """SELECT t.name || ' ' || k.stamp_ns FROM keyframe k JOIN traversal t ON t.id = k.traversal_id
           WHERE k.stamp_ns < t.start_ns OR k.stamp_ns > t.end_ns""",
    ),
    Invariant(
        "traversal",
        "counts other keyframes or observations than it has",
        """SELECT name FROM traversal
           WHERE keyframes <> (SELECT count(*) FROM keyframe WHERE keyframe.traversal_id = traversal.id)
           OR observations <> (SELECT count(*) FROM observation JOIN keyframe ON keyframe.id = observation.keyframe_id
                               WHERE keyframe.traversal_id = traversal.id)""",
    ),
    Invariant(
        "visit",
        "has support outside its traversal's span",
        """SELECT i.id || ' in ' || t.name FROM visit v JOIN traversal t ON t.id = v.traversal_id
           JOIN instance i ON i.number = v.instance_number
           WHERE v.first_support_ns < t.start_ns OR v.last_support_ns > t.end_ns""",
    ),
    Invariant(
        "before_image",
        "belongs to a traversal that is not being built",
        """SELECT t.name || ' ' || b.table_name || ' ' || b.row_key FROM before_image b
           JOIN traversal t ON t.id = b.traversal_id WHERE t.status <> 'building'""",
    ),
    Invariant(
        "state_box",
        "does not stand for every state once",
        """SELECT id FROM state WHERE id NOT IN (SELECT state_id FROM state_box)
           UNION ALL SELECT state_id FROM state_box WHERE state_id NOT IN (SELECT id FROM state)""",
    ),
    Invariant(
        "instance_label",
        "does not name every instance once",
        """SELECT id FROM instance WHERE number NOT IN (SELECT rowid FROM instance_label)
           UNION ALL SELECT id FROM instance_label WHERE rowid NOT IN (SELECT number FROM instance)""",
    ),
    Invariant("traversal", "holds broken JSON", "SELECT name FROM traversal WHERE NOT json_valid(config)"),
    Invariant("observation", "holds broken JSON", "SELECT id FROM observation WHERE NOT json_valid(hypotheses)"),
    Invariant(
        "instance",
        "holds broken JSON",
        "SELECT id FROM instance WHERE NOT json_valid(label_belief) OR NOT json_valid(engine_state)",
    ),
)


def check(reader: MapReader) -> list[Problem]:
    """Every broken invariant of the map, in the order of tables; an intact map gives none."""
    connection = reader.connection
    return [*dialect_of(connection).damage(connection), *_rule_problems(connection), *_blob_problems(connection)]


def _rule_problems(connection: Connection) -> Iterator[Problem]:
    for invariant in INVARIANTS:
        for (row,) in connection.execute(text(invariant.violations)):
            yield Problem(invariant.table, str(row), invariant.rule)


def _blob_problems(connection: Connection) -> Iterator[Problem]:
    instance = models.Instance
    for row in connection.execute(select(instance.id, instance.voxels, instance.embedding).order_by(instance.number)):
        try:
            blobs.decode_voxels(row.voxels)
            if row.embedding is not None:
                blobs.decode_embedding(row.embedding)
        except MemoryStoreError as error:
            yield Problem("instance", row.id, error.what)
