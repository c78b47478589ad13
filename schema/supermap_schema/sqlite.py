"""Everything that is specific to SQLite: application id, pragmas, triggers, views, R*Tree and full-text index.

A migration creates the objects of its version (`OBJECTS_0001`, ...); those of a released version are never edited.
"""

from __future__ import annotations

import re

from supermap_schema.views import SqlFunctions, trajectory_0003, views_0002

APPLICATION_ID = 0x534D4150
"""`PRAGMA application_id` of a SuperMap database, "SMAP": distinguishes it from other SQLite files."""

BUSY_TIMEOUT = "PRAGMA busy_timeout = 5000"
"""How long a statement waits for another connection's lock, in milliseconds."""

CONNECTION_PRAGMAS = ("PRAGMA foreign_keys = ON", BUSY_TIMEOUT)
"""For all connections."""

WRITER_PRAGMAS = ("PRAGMA auto_vacuum = INCREMENTAL", "PRAGMA journal_mode = WAL", "PRAGMA synchronous = NORMAL")
"""For the connection of a build: readers are never blocked, and a killed process loses no committed keyframe.

With `auto_vacuum`, which must be set before the first write, a build can release the space that it freed.
"""

READER_PRAGMAS = ("PRAGMA query_only = ON",)
"""For all other connections."""

TRIGGERS = (
    *("observation_is_immutable", "observation_is_kept", "state_is_disjoint_on_insert", "state_is_disjoint_on_update"),
    *("state_box_insert", "state_box_update", "state_box_delete"),
    *("instance_label_insert", "instance_label_update", "instance_label_delete"),
)
"""Those of the newest version."""

_IMMUTABLE_OBSERVATIONS = (
    """
    CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation
    BEGIN SELECT RAISE(ABORT, 'observations are never changed'); END
    """,
    """
    CREATE TRIGGER observation_is_kept BEFORE DELETE ON observation
    WHEN (SELECT traversal.status FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id) = 'complete'
    BEGIN SELECT RAISE(ABORT, 'observations of a complete traversal are never deleted'); END
    """,
)

_DISJOINT_STATES = (
    """
    CREATE TRIGGER state_is_disjoint_on_insert BEFORE INSERT ON state
    WHEN EXISTS (SELECT 1 FROM state AS other
                 WHERE other.instance_number = NEW.instance_number AND other.state_index <> NEW.state_index
                 AND other.first_seen_ns <= NEW.last_seen_ns AND NEW.first_seen_ns <= other.last_seen_ns)
    BEGIN SELECT RAISE(ABORT, 'states of one instance overlap'); END
    """,
    """
    CREATE TRIGGER state_is_disjoint_on_update BEFORE UPDATE OF first_seen_ns, last_seen_ns ON state
    WHEN EXISTS (SELECT 1 FROM state AS other
                 WHERE other.instance_number = NEW.instance_number AND other.state_index <> NEW.state_index
                 AND other.first_seen_ns <= NEW.last_seen_ns AND NEW.first_seen_ns <= other.last_seen_ns)
    BEGIN SELECT RAISE(ABORT, 'states of one instance overlap'); END
    """,
)

# A rectangle of sides a, b turned by any yaw reaches at most (a + b) / 2 from its centre.
_STATE_BOXES = (
    "CREATE VIRTUAL TABLE state_box USING rtree(state_id, min_x, max_x, min_y, max_y, min_z, max_z)",
    """
    CREATE TRIGGER state_box_insert AFTER INSERT ON state
    BEGIN
      INSERT INTO state_box VALUES (
        NEW.id, NEW.center_x - (NEW.size_x + NEW.size_y) / 2, NEW.center_x + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_y - (NEW.size_x + NEW.size_y) / 2, NEW.center_y + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_z - NEW.size_z / 2, NEW.center_z + NEW.size_z / 2);
    END
    """,
    """
    CREATE TRIGGER state_box_update AFTER UPDATE ON state
    BEGIN
      DELETE FROM state_box WHERE state_id = OLD.id;
      INSERT INTO state_box VALUES (
        NEW.id, NEW.center_x - (NEW.size_x + NEW.size_y) / 2, NEW.center_x + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_y - (NEW.size_x + NEW.size_y) / 2, NEW.center_y + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_z - NEW.size_z / 2, NEW.center_z + NEW.size_z / 2);
    END
    """,
    """
    CREATE TRIGGER state_box_delete AFTER DELETE ON state
    BEGIN
      DELETE FROM state_box WHERE state_id = OLD.id;
    END
    """,
)

_LABEL_SEARCH = (
    "CREATE VIRTUAL TABLE instance_label USING fts5(id, label, labels, tokenize = 'porter unicode61')",
    """
    CREATE TRIGGER instance_label_insert AFTER INSERT ON instance
    BEGIN
      INSERT INTO instance_label (rowid, id, label, labels) VALUES (
        NEW.number, NEW.id, NEW.label, (SELECT group_concat(key, ', ') FROM json_each(NEW.label_belief)));
    END
    """,
    """
    CREATE TRIGGER instance_label_update AFTER UPDATE OF label, label_belief ON instance
    WHEN OLD.label <> NEW.label OR OLD.label_belief <> NEW.label_belief
    BEGIN
      DELETE FROM instance_label WHERE rowid = OLD.number;
      INSERT INTO instance_label (rowid, id, label, labels) VALUES (
        NEW.number, NEW.id, NEW.label, (SELECT group_concat(key, ', ') FROM json_each(NEW.label_belief)));
    END
    """,
    """
    CREATE TRIGGER instance_label_delete AFTER DELETE ON instance
    BEGIN
      DELETE FROM instance_label WHERE rowid = OLD.number;
    END
    """,
)

_VIEWS = (
    """
    CREATE VIEW current_objects AS
    SELECT id, label, x, y, z, size_x, size_y, size_z, yaw, first_seen_ns, last_seen_ns, observations
    FROM instance WHERE presence = 'present' AND merged_into IS NULL
    """,
    """
    CREATE VIEW object_history AS
    SELECT instance.id, state.state_index, state.label, state.confidence, state.x, state.y, state.z,
           state.empty_before_ns, state.first_seen_ns, state.last_seen_ns, state.gone_ns,
           traversal.name AS first_traversal
    FROM state JOIN instance ON instance.number = state.instance_number
    JOIN traversal ON traversal.id = state.traversal_id
    ORDER BY instance.number, state.state_index
    """,
    """
    CREATE VIEW changes AS
    SELECT temporal_edge.kind, source.id AS from_id, temporal_edge.from_state, target.id AS to_id,
           temporal_edge.to_state, temporal_edge.not_before_ns, temporal_edge.not_after_ns,
           temporal_edge.distance_m, temporal_edge.probability, traversal.name AS traversal
    FROM temporal_edge JOIN instance AS source ON source.number = temporal_edge.from_number
    JOIN instance AS target ON target.number = temporal_edge.to_number
    JOIN traversal ON traversal.id = temporal_edge.traversal_id
    WHERE temporal_edge.kind <> 'persisted'
    ORDER BY temporal_edge.not_after_ns, temporal_edge.id
    """,
    """
    CREATE VIEW trajectory AS
    SELECT traversal.name AS traversal, keyframe.stamp_ns,
           json_extract(keyframe.T_map_base, '$[0][3]') AS x,
           json_extract(keyframe.T_map_base, '$[1][3]') AS y,
           json_extract(keyframe.T_map_base, '$[2][3]') AS z
    FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
    ORDER BY keyframe.stamp_ns
    """,
)

OBJECTS_0001 = _IMMUTABLE_OBSERVATIONS + _DISJOINT_STATES + _STATE_BOXES + _LABEL_SEARCH + _VIEWS

_PRUNABLE_OBSERVATIONS = (
    "DROP TRIGGER observation_is_immutable",
    "DROP TRIGGER observation_is_kept",
    """
    CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation
    WHEN NEW.crop_jpeg IS NOT NULL OR (NEW.id, NEW.keyframe_id, NEW.instance_number, NEW.track_id, NEW.label, NEW.score,
          NEW.u_min, NEW.v_min, NEW.u_max, NEW.v_max, NEW.x, NEW.y, NEW.z, NEW.evidence_for, NEW.evidence_against,
          NEW.hypotheses)
      IS NOT (OLD.id, OLD.keyframe_id, OLD.instance_number, OLD.track_id, OLD.label, OLD.score,
          OLD.u_min, OLD.v_min, OLD.u_max, OLD.v_max, OLD.x, OLD.y, OLD.z, OLD.evidence_for, OLD.evidence_against,
          OLD.hypotheses)
      OR NOT EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id AND keyframe.stamp_ns < traversal.crops_kept_from_ns)
    BEGIN SELECT RAISE(ABORT, 'observations are never changed'); END
    """,
    """
    CREATE TRIGGER observation_is_kept BEFORE DELETE ON observation
    WHEN EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id AND traversal.status = 'complete'
          AND (traversal.observations_kept_from_ns IS NULL
               OR keyframe.stamp_ns >= traversal.observations_kept_from_ns))
    BEGIN SELECT RAISE(ABORT, 'observations of a complete traversal are never deleted'); END
    """,
)

_SQL = SqlFunctions(
    utc=lambda column: (
        f"strftime('%Y-%m-%dT%H:%M:%S', {column} / 1000000000, 'unixepoch') "
        f"|| '.' || ({column} / 100000000 % 10) || 'Z'"
    ),
    seconds=lambda span: f"CASE WHEN {span} IS NOT NULL THEN printf('%.1f s', ({span}) / 1e9) END",
    rounded=lambda value: f"round({value}, 3)",
    element=lambda transform, row, column: f"json_extract({transform}, '$[{row}][{column}]')",
    joined=lambda text, _: f"group_concat({text}, ', ')",
)

_READABLE_VIEWS = (
    *(f"DROP VIEW {name}" for name in ("current_objects", "object_history", "changes", "trajectory")),
    *views_0002(_SQL),
)

OBJECTS_0002 = _PRUNABLE_OBSERVATIONS + _READABLE_VIEWS

OBJECTS_0003 = trajectory_0003(_SQL)

_STATEMENT = re.compile(r"\s*(CREATE|DROP) (?:VIRTUAL TABLE|TRIGGER|VIEW) (\w+)")


def definitions() -> dict[str, str]:
    """The statements that create the objects of the newest version, by name."""
    made: dict[str, str] = {}
    for statement in OBJECTS_0001 + OBJECTS_0002 + OBJECTS_0003:
        if (found := _STATEMENT.match(statement)) is not None:
            made.pop(found[2], None)
            if found[1] == "CREATE":
                made[found[2]] = statement
    return made
