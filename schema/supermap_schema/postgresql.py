"""Everything that is specific to PostgreSQL (14 and newer): the map's mark, triggers, views, box and label indices.

The counterpart of `sqlite`: a GiST index over boxes and a GIN index over words replace R*Tree and FTS5, under the same
names. All objects are in the first schema of the search path; functions keep the search path of their creation, so that
the triggers work for every connection.
"""

from __future__ import annotations

import re

from supermap_schema.views import SqlFunctions, trajectory_0003, views_0002

MARK = "SuperMap 4D memory"
"""The comment on table `traversal`, which distinguishes a SuperMap schema from others."""

OLDEST_SERVER = 140000
"""`server_version_num`; SQL-standard function bodies (`RETURN`) need PostgreSQL 14."""

LABEL_SEARCH = "supermap_label"
"""The text search configuration: Porter stems without stop words, like FTS5's porter tokenizer."""

FUNCTIONS = ("refuse_changed_observation", "refuse_deleted_observation", "refuse_overlapping_state", "label_words")

TRIGGERS = (
    ("observation", "observation_is_immutable"),
    ("observation", "observation_is_kept"),
    ("state", "state_is_disjoint_on_insert"),
    ("state", "state_is_disjoint_on_update"),
)
INDICES = ("ix_state_ground", "ix_instance_label_words")

_MARK = (f"COMMENT ON TABLE traversal IS '{MARK}'",)

_NO_NUMBER_SEQUENCE = ("ALTER TABLE instance ALTER COLUMN number DROP DEFAULT", "DROP SEQUENCE instance_number_seq")
"""Alembic creates an integer key as a sequence in PostgreSQL; instance numbers are assigned by the program."""

_JSON_COLUMNS_0002 = (
    ("traversal", "T_map_odom"),
    ("traversal", "config"),
    ("traversal", "versions"),
    ("traversal", "timings"),
    ("keyframe", "T_map_base"),
    ("keyframe", "T_map_camera"),
    ("keyframe", "camera"),
    ("instance", "label_belief"),
    ("instance", "engine_state"),
    ("observation", "hypotheses"),
    ("before_image", "content"),
)
_JSON_COLUMNS_0003 = (("traversal", "warnings"),)
JSON_COLUMNS = _JSON_COLUMNS_0002 + _JSON_COLUMNS_0003


def json_constraint(table: str, column: str) -> str:
    """The name of the constraint that a column is valid JSON."""
    return f"ck_{table}_{column.lower()}_json"


def _valid_json(columns: tuple[tuple[str, str], ...]) -> tuple[str, ...]:
    return tuple(
        f'ALTER TABLE {table} ADD CONSTRAINT {json_constraint(table, column)} CHECK (("{column}"::json) IS NOT NULL'
        f' OR "{column}" IS NULL)'
        for table, column in columns
    )


_OBSERVATION_BUT_CROP = (
    *("id", "keyframe_id", "instance_number", "track_id", "label", "score", "u_min", "v_min", "u_max", "v_max"),
    *("x", "y", "z", "evidence_for", "evidence_against", "hypotheses"),
)


def _row(name: str) -> str:
    return f"({', '.join(f'{name}.{column}' for column in _OBSERVATION_BUT_CROP)})"


_IMMUTABLE_OBSERVATIONS = (
    f"""
    CREATE FUNCTION refuse_changed_observation() RETURNS trigger LANGUAGE plpgsql SET search_path FROM CURRENT AS $$
    BEGIN
      IF NEW.crop_jpeg IS NOT NULL
        OR {_row("NEW")} IS DISTINCT FROM {_row("OLD")}
        OR NOT EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
            WHERE keyframe.id = OLD.keyframe_id AND keyframe.stamp_ns < traversal.crops_kept_from_ns)
      THEN
        RAISE EXCEPTION 'observations are never changed' USING ERRCODE = 'integrity_constraint_violation';
      END IF;
      RETURN NEW;
    END $$
    """,
    """
    CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation
    FOR EACH ROW EXECUTE FUNCTION refuse_changed_observation()
    """,
    """
    CREATE FUNCTION refuse_deleted_observation() RETURNS trigger LANGUAGE plpgsql SET search_path FROM CURRENT AS $$
    BEGIN
      IF EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id AND traversal.status = 'complete'
          AND (traversal.observations_kept_from_ns IS NULL
               OR keyframe.stamp_ns >= traversal.observations_kept_from_ns))
      THEN
        RAISE EXCEPTION 'observations of a complete traversal are never deleted'
          USING ERRCODE = 'integrity_constraint_violation';
      END IF;
      RETURN OLD;
    END $$
    """,
    """
    CREATE TRIGGER observation_is_kept BEFORE DELETE ON observation
    FOR EACH ROW EXECUTE FUNCTION refuse_deleted_observation()
    """,
)

_DISJOINT_STATES = (
    """
    CREATE FUNCTION refuse_overlapping_state() RETURNS trigger LANGUAGE plpgsql SET search_path FROM CURRENT AS $$
    BEGIN
      IF EXISTS (SELECT 1 FROM state AS other
          WHERE other.instance_number = NEW.instance_number AND other.state_index <> NEW.state_index
          AND other.first_seen_ns <= NEW.last_seen_ns AND NEW.first_seen_ns <= other.last_seen_ns)
      THEN
        RAISE EXCEPTION 'states of one instance overlap' USING ERRCODE = 'integrity_constraint_violation';
      END IF;
      RETURN NEW;
    END $$
    """,
    """
    CREATE TRIGGER state_is_disjoint_on_insert BEFORE INSERT ON state
    FOR EACH ROW EXECUTE FUNCTION refuse_overlapping_state()
    """,
    """
    CREATE TRIGGER state_is_disjoint_on_update BEFORE UPDATE OF first_seen_ns, last_seen_ns ON state
    FOR EACH ROW EXECUTE FUNCTION refuse_overlapping_state()
    """,
)

# A rectangle of sides a, b turned by any yaw reaches at most (a + b) / 2 from its centre.
_GROUND = """box(point(center_x - (size_x + size_y) / 2, center_y - (size_x + size_y) / 2),
    point(center_x + (size_x + size_y) / 2, center_y + (size_x + size_y) / 2))"""

_STATE_BOXES = (
    f"CREATE INDEX ix_state_ground ON state USING gist (({_GROUND}))",
    f"""
    CREATE VIEW state_box AS
    SELECT id AS state_id,
           center_x - (size_x + size_y) / 2 AS min_x, center_x + (size_x + size_y) / 2 AS max_x,
           center_y - (size_x + size_y) / 2 AS min_y, center_y + (size_x + size_y) / 2 AS max_y,
           center_z - size_z / 2 AS min_z, center_z + size_z / 2 AS max_z,
           {_GROUND} AS ground
    FROM state
    """,
)

_GAP = "nextlabel"
"""A word between two labels, so that no phrase matches across them."""

_LABEL_WORDS = (
    "CREATE TEXT SEARCH DICTIONARY supermap_porter (TEMPLATE = pg_catalog.snowball, LANGUAGE = porter)",
    f"CREATE TEXT SEARCH CONFIGURATION {LABEL_SEARCH} (PARSER = pg_catalog.default)",
    f"""ALTER TEXT SEARCH CONFIGURATION {LABEL_SEARCH}
        ADD MAPPING FOR asciiword, word, numword, int, uint WITH supermap_porter""",
    f"""
    CREATE FUNCTION label_words(id text, label text, label_belief text) RETURNS tsvector LANGUAGE sql IMMUTABLE
    RETURN to_tsvector('{LABEL_SEARCH}'::regconfig, regexp_replace(
        id || ' {_GAP} ' || label || ' {_GAP} '
          || coalesce((SELECT string_agg(key, ' {_GAP} ') FROM json_object_keys(label_belief::json) AS key), ''),
        '[^[:alnum:]]+', ' ', 'g'))
    """,
    "CREATE INDEX ix_instance_label_words ON instance USING gin (label_words(id, label, label_belief))",
    """
    CREATE VIEW instance_label AS
    SELECT number, id, label, (SELECT string_agg(key, ', ') FROM json_object_keys(label_belief::json) AS key) AS labels,
           label_words(id, label, label_belief) AS words
    FROM instance
    """,
)

_SQL = SqlFunctions(
    utc=lambda column: (
        f"to_char(to_timestamp({column} / 1000000000) AT TIME ZONE 'UTC', 'YYYY-MM-DD\"T\"HH24:MI:SS') "
        f"|| '.' || ({column} / 100000000 % 10) || 'Z'"
    ),
    seconds=lambda span: f"round(({span})::numeric / 1000000000, 1) || ' s'",
    rounded=lambda value: f"round(({value})::numeric, 3)::double precision",
    element=lambda transform, row, column: f"({_quoted(transform)}::json -> {row} ->> {column})::double precision",
    joined=lambda text, order: f"string_agg({text}, ', ' ORDER BY {order})",
)


def _quoted(column: str) -> str:
    """A quoted column name: PostgreSQL folds unquoted capitals."""
    table, _, name = column.rpartition(".")
    return f'{table}."{name}"'


OBJECTS_0002 = (
    _MARK
    + _NO_NUMBER_SEQUENCE
    + _valid_json(_JSON_COLUMNS_0002)
    + _IMMUTABLE_OBSERVATIONS
    + _DISJOINT_STATES
    + _STATE_BOXES
    + _LABEL_WORDS
    + views_0002(_SQL)
)
"""Version 2 is the first in PostgreSQL, and creates everything."""

OBJECTS_0003 = _valid_json(_JSON_COLUMNS_0003) + trajectory_0003(_SQL)

_TRIGGER = re.compile(r"\s*CREATE TRIGGER (\w+)")
_FUNCTION = re.compile(r"\s*CREATE FUNCTION (\w+)\(\) RETURNS trigger .* AS \$\$(.*)\$\$\s*", re.DOTALL)


def definitions() -> dict[str, str]:
    """The statements that create the triggers, and the bodies of their functions, by name."""
    made: dict[str, str] = {}
    for statement in OBJECTS_0002 + OBJECTS_0003:
        if (trigger := _TRIGGER.match(statement)) is not None:
            made[trigger[1]] = statement
        elif (function := _FUNCTION.fullmatch(statement)) is not None:
            made[function[1]] = function[2]
    return made
