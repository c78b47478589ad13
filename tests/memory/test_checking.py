"""`db check` finds what is broken, and nothing in a sound map."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.databases import dialect_of
from supermap_cli.memory.invariants import INVARIANTS
from supermap_cli.memory.values import Problem
from supermap_cli.types.memory import MapDelta
from support import databases
from support import memories as m

CHAIR, TABLE, DESK, CUP = 1, 2, 3, 4

MONDAY = MapDelta(
    keyframes=m.keyframes([1, 2, 3, 5]),
    observations=(
        *(m.observation(CHAIR, at) for at in (1, 5)),
        *(m.observation(TABLE, at, "table") for at in (1, 5)),
        m.observation(DESK, 1, "desk"),
        m.observation(CUP, 2, "cup"),
    ),
    instances=(
        m.instance(CHAIR, "chair", (2, 0, 0.5), seen=(1, 5), observations=2),
        m.instance(TABLE, "table", seen=(1, 5), observations=3),
        m.instance(DESK, "desk", seen=(1, 1), merged_into=TABLE, observations=1),
        m.instance(CUP, "cup", seen=(1, 2), presence="absent", observations=1),
    ),
    states=(
        m.state(CHAIR, 0, (1, 2), gone=3),
        m.state(CHAIR, 1, (5, 5), (2, 0, 0.5)),
        m.state(TABLE, 0, (1, 5), label="table"),
        m.state(DESK, 0, (1, 1), label="desk"),
        m.state(CUP, 0, (1, 2), gone=5, label="cup"),
    ),
    visits=(
        m.visit(CHAIR, 2, 3, 0, (1, 5)),
        m.visit(TABLE, 2, 3, 0, (1, 5)),
        m.visit(CUP, 1, 3, 2, (2, 2)),
    ),
    spatial_edges=(
        m.spatial(CHAIR, "near", TABLE, 1, 3),
        m.spatial(CHAIR, "near", TABLE, 5),
        m.spatial(DESK, "near", CHAIR, 1, 2),
    ),
    temporal_edges=(
        m.temporal("moved", (CHAIR, 0), (CHAIR, 1), 2, 5, distance_m=2.0),
        m.temporal("merged", (DESK, 0), (TABLE, 0), 1, 5),
        m.temporal("disappeared", (CUP, 0), (CUP, None), 2, 5),
    ),
)
TUESDAY = MapDelta(keyframes=m.keyframes([21]))


def problems(path: Path) -> list[Problem]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return check(reader)


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MONDAY), ("tuesday", (20, 30), TUESDAY))


def test_a_sound_map_has_no_problems(sound: Path) -> None:
    assert problems(sound) == []


UNCHANGED = ("observation", "observation_is_immutable")


def off(table: str, trigger: str, then: str) -> tuple[str, str]:
    """What a trigger would refuse, on SQLite and on PostgreSQL."""
    return f"DROP TRIGGER {trigger}; {then}", f"ALTER TABLE {table} DISABLE TRIGGER {trigger}; {then}"


def sqlite_only(damage: str) -> tuple[str, None]:
    """PostgreSQL takes no such thing, or has nothing of the kind."""
    return damage, None


def infinite(table: str, column: str) -> tuple[str, str]:
    """A number without an end, past the triggers and constraints that would refuse it."""
    damage = f"UPDATE {table} SET {column} ="
    if table == "observation":
        return off(*UNCHANGED, damage + " 9e999")[0], off(*UNCHANGED, damage + " 'Infinity'")[1]
    dropped = f"ALTER TABLE {table} DROP CONSTRAINT IF EXISTS ck_{table}_{column}"
    return f"PRAGMA ignore_check_constraints = ON; {damage} 9e999", f"{dropped}; {damage} 'Infinity'"


SECOND = 10**9
NO_BLOB = "(SELECT voxels FROM instance WHERE number = 1)"
DAMAGES: tuple[tuple[str | tuple[str, str | None], str, str], ...] = (
    (f"UPDATE traversal SET start_ns = start_ns - {19 * SECOND} WHERE number = 2", "traversal", "before the end of"),
    ("UPDATE traversal SET status = 'building' WHERE number = 1", "traversal", "although a later one"),
    ("UPDATE traversal SET mapped_ns = mapped_ns - 1 WHERE number = 2", "traversal", "newest keyframe"),
    ("UPDATE traversal SET mapped_ns = NULL WHERE number = 2", "traversal", "newest keyframe"),
    ("UPDATE traversal SET keyframes = 7 WHERE number = 1", "traversal", "counts other keyframes"),
    ("UPDATE traversal SET observations = 7 WHERE number = 2", "traversal", "counts other keyframes or observations"),
    ("UPDATE traversal SET end_ns = start_ns WHERE number = 2", "keyframe", "outside its traversal"),
    ("INSERT INTO before_image VALUES (1, 'state', 1, '{}')", "before_image", "not being built"),
    (f"INSERT INTO checkpoint VALUES (1, 'engine', 0, {NO_BLOB})", "checkpoint", "not being built"),
    ("DELETE FROM temporal_edge; DELETE FROM state WHERE instance_number = 2", "instance", "has no state"),
    ("UPDATE instance SET last_seen_ns = last_seen_ns + 1 WHERE number = 1", "instance", "first or last seen at other"),
    ("UPDATE instance SET first_seen_ns = 0 WHERE number = 1", "instance", "first or last seen at other times"),
    ("UPDATE instance SET traversal_id = 2 WHERE number = 1", "instance", "before the traversal that found it"),
    ("UPDATE instance SET traversal_id = 2 WHERE number = 1", "visit", "before the one that found"),
    ("UPDATE state SET gone_ns = last_seen_ns + 1 WHERE instance_number = 2", "instance", "counts as present"),
    ("UPDATE instance SET presence = 'absent' WHERE number = 2", "instance", "counts as absent"),
    ("UPDATE instance SET observations = 1 WHERE number = 1", "instance", "fewer observations"),
    ("UPDATE instance SET observations = observations + 1", "instance", "more observations than it has"),
    ("UPDATE instance SET observations = 3 WHERE number = 3", "instance", "more observations than it has"),
    *(
        (f"UPDATE instance SET {axis} = {axis} + 50 WHERE number = 1", "instance", "lies elsewhere or is larger")
        for axis in ("x", "y", "z", "center_x", "center_y", "center_z", "size_x", "size_y", "size_z")
    ),
    ("UPDATE instance SET x = x + 0.001 WHERE number = 4", "instance", "lies elsewhere or is larger"),
    ("UPDATE state SET label = 'song' WHERE instance_number = 2", "instance", "another label than its newest state"),
    ("UPDATE instance SET label = 'song' WHERE number = 1", "instance", "a label that its label belief does not know"),
    ("UPDATE instance SET merged_into = 3 WHERE number = 2", "instance", "in a circle"),
    ("UPDATE visit SET last_support_ns = last_support_ns * 2", "visit", "outside its traversal"),
    ("DELETE FROM visit", "visit", "is missing although the thing was observed"),
    ("UPDATE visit SET in_view = 0", "visit", "more support than views"),
    ("UPDATE visit SET first_support_ns = NULL", "visit", "more support than views, or none and yet a time"),
    (off("state", "state_is_disjoint_on_update", "UPDATE state SET first_seen_ns = 0"), "state", "overlaps another"),
    (f"UPDATE state SET gone_ns = gone_ns + {9 * SECOND} WHERE instance_number = 1", "state", "gone only after"),
    (
        "DELETE FROM temporal_edge; UPDATE state SET state_index = 7 WHERE state_index = 1",
        "state",
        "not all the numbers before",
    ),
    (
        f"""UPDATE state SET last_seen_ns = last_seen_ns + {500 * SECOND} WHERE state_index = 1;
            UPDATE instance SET last_seen_ns = last_seen_ns + {500 * SECOND} WHERE number = 1""",
        "state",
        "a time that is no keyframe's",
    ),
    ("DELETE FROM temporal_edge", "state", "no change leads to it"),
    ("UPDATE state SET gone_ns = NULL WHERE instance_number = 1", "state", "not gone although another one follows"),
    (f"UPDATE keyframe SET stamp_ns = stamp_ns - {SECOND // 2}", "state", "no observation between"),
    ("UPDATE spatial_edge SET since_ns = since_ns - 1", "spatial_edge", "begins when one of its ends"),
    (f"UPDATE spatial_edge SET since_ns = since_ns + {2 * SECOND}, until_ns = NULL", "spatial_edge", "begins when one"),
    ("UPDATE spatial_edge SET until_ns = until_ns + 1", "spatial_edge", "goes on when one of its ends was gone"),
    ("UPDATE spatial_edge SET until_ns = NULL", "spatial_edge", "goes on when one of its ends was gone"),
    ("UPDATE spatial_edge SET until_ns = NULL", "spatial_edge", "part of another thing"),
    (
        """INSERT INTO spatial_edge (subject_number, relation, object_number, since_ns, until_ns, confidence,
                traversal_id)
            SELECT subject_number, relation, object_number, since_ns + 1, until_ns, confidence, traversal_id
            FROM spatial_edge""",
        "spatial_edge",
        "overlaps another one of the same ends",
    ),
    ("UPDATE temporal_edge SET to_state = NULL WHERE kind = 'moved'", "temporal_edge", "lacks the state"),
    ("UPDATE temporal_edge SET kind = 'moved' WHERE kind = 'merged'", "temporal_edge", "lacks the state"),
    ("UPDATE temporal_edge SET not_before_ns = 0", "temporal_edge", "before its first end was seen"),
    (
        f"UPDATE temporal_edge SET not_after_ns = not_after_ns + {90 * SECOND}",
        "temporal_edge",
        "second end stood there",
    ),
    (
        "UPDATE temporal_edge SET not_before_ns = NULL, not_after_ns = not_after_ns - 1 WHERE kind = 'moved'",
        "temporal_edge",
        "second end stood there",
    ),
    ("UPDATE state SET gone_ns = NULL WHERE instance_number = 4", "temporal_edge", "disappeared whose state goes on"),
    (off(*UNCHANGED, "UPDATE observation SET label = 'song'"), "observation", "than its best hypothesis"),
    (off(*UNCHANGED, "UPDATE observation SET hypotheses = '{}'"), "observation", "hypotheses that are no list"),
    *(
        (infinite(table, column), table, "a number that is not finite")
        for table, column in (
            *(("instance", name) for name in ("x", "center_y", "size_z", "yaw", "existence_log_odds")),
            *(("state", name) for name in ("z", "center_x", "size_y", "yaw")),
            *(("observation", name) for name in ("x", "u_min", "v_max")),
            *(("spatial_edge", "confidence"), ("temporal_edge", "distance_m")),
        )
    ),
    (f"UPDATE keyframe SET depth_png = {NO_BLOB}", "keyframe", "depth_png that is no PNG"),
    ("UPDATE keyframe SET depth_png = substr(depth_png, 1, 60) WHERE id = 2", "keyframe", "or ends too early"),
    ("UPDATE keyframe SET depth_png = substr(depth_png, 1, 40) WHERE id = 2", "keyframe", "ends too early"),
    ("UPDATE keyframe SET depth_step = 16 WHERE id = 2", "keyframe", "not (3, 4) pixels"),
    ("UPDATE keyframe SET camera = '{}'", "keyframe", "a camera that is none"),
    ("""UPDATE keyframe SET camera = '{"model": "pinhole"}'""", "keyframe", "a camera that is none"),
    ("UPDATE traversal SET config = '3'", "traversal", "a config that is no JSON object"),
    ("UPDATE traversal SET versions = '[]'", "traversal", "a versions that is no JSON object"),
    ("UPDATE traversal SET timings = '1.5'", "traversal", "a timings that is no JSON object"),
    ("UPDATE traversal SET warnings = '{}'", "traversal", "warnings that are no JSON list of texts"),
    ("UPDATE traversal SET warnings = '[1]'", "traversal", "warnings that are no JSON list of texts"),
    ("UPDATE instance SET engine_state = '{}' WHERE number = 1", "instance", "engine state is damaged"),
    (
        "UPDATE instance SET engine_state = replace(engine_state, '1.25', '9e999')",
        "instance",
        "engine state is damaged",
    ),
    (f"UPDATE keyframe SET thumbnail_jpeg = {NO_BLOB}", "keyframe", "thumbnail_jpeg that is no JPEG"),
    (off(*UNCHANGED, f"UPDATE observation SET crop_jpeg = {NO_BLOB}"), "observation", "crop_jpeg that is no JPEG"),
    ("UPDATE instance SET id = 'chair' WHERE number = 1", "instance", "id that is no label and number"),
    ("UPDATE instance SET id = 'chair-07' WHERE number = 1", "instance", "id that is no label and number"),
    ("UPDATE instance SET label_belief = '{\"chair\": 0.4}' WHERE number = 1", "instance", "shares that sum to 1"),
    (sqlite_only("UPDATE instance SET label_belief = '[1]' WHERE number = 1"), "instance", "shares that sum to 1"),
    ("UPDATE instance SET voxels = (SELECT depth_png FROM keyframe LIMIT 1)", "instance", "SMV1"),
    ("UPDATE instance SET embedding = (SELECT substr(voxels, 1, 5) FROM instance LIMIT 1)", "instance", "5 bytes"),
    ("""UPDATE keyframe SET "T_map_base" = replace("T_map_base", '1.0', '2.0')""", "keyframe", "T_map_base that is no"),
    ("""UPDATE keyframe SET "T_map_camera" = '[]' WHERE id = 2""", "keyframe", "T_map_camera that is no"),
    ("""UPDATE traversal SET "T_map_odom" = '[[1, 0], [0, 1]]'""", "traversal", "T_map_odom that is no rigid"),
    (off(*UNCHANGED, "SELECT 1"), "schema", "is missing or switched off"),
    (
        (
            """DROP TRIGGER observation_is_immutable;
               CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation BEGIN SELECT 1; END""",
            """CREATE OR REPLACE FUNCTION refuse_changed_observation() RETURNS trigger LANGUAGE plpgsql AS
               $$ BEGIN RETURN NEW; END $$""",
        ),
        "schema",
        "not what the schema makes",
    ),
    (
        (
            """DROP TRIGGER state_is_disjoint_on_insert;
               CREATE TRIGGER state_is_disjoint_on_insert AFTER DELETE ON state BEGIN SELECT 1; END""",
            """DROP TRIGGER state_is_disjoint_on_insert ON state;
               CREATE TRIGGER state_is_disjoint_on_insert BEFORE DELETE ON state
               FOR EACH ROW EXECUTE FUNCTION refuse_overlapping_state()""",
        ),
        "schema",
        "not what the schema makes",
    ),
    (
        sqlite_only("DROP VIEW current_objects; CREATE VIEW current_objects AS SELECT 1 AS id"),
        "schema",
        "not what the schema makes",
    ),
    (
        """DROP INDEX ix_state_label_instance_number;
           CREATE INDEX ix_state_label_instance_number ON state (yaw)""",
        "schema",
        "not what the schema makes",
    ),
    ("DROP INDEX ix_state_label_instance_number", "schema", "is missing or switched off"),
    ("DROP VIEW changes", "schema", "is missing or switched off"),
    ("DROP TABLE checkpoint", "schema", "is missing or switched off"),
    (
        (
            "UPDATE visit SET instance_number = 99 WHERE instance_number = 1",
            "SET session_replication_role = replica; UPDATE visit SET instance_number = 99 WHERE instance_number = 1",
        ),
        "visit",
        "does not exist",
    ),
    (sqlite_only("DELETE FROM state_box WHERE state_id = 1"), "state_box", "every state once"),
    (sqlite_only("UPDATE state_box SET min_x = min_x + 0.1"), "state_box", "not lie where its state does"),
    (sqlite_only("DELETE FROM instance_label WHERE rowid = 1"), "instance_label", "every instance once"),
    (sqlite_only("UPDATE instance_label SET label = 'song'"), "instance_label", "another label than its instance"),
    (sqlite_only("UPDATE traversal SET config = '{'"), "traversal", "broken JSON"),
    (sqlite_only("UPDATE keyframe SET camera = '{'"), "keyframe", "broken JSON"),
    (sqlite_only(off(*UNCHANGED, "UPDATE observation SET hypotheses = ''")[0]), "observation", "broken JSON"),
    (sqlite_only("UPDATE instance SET engine_state = '{'"), "instance", "broken JSON"),
    (sqlite_only("INSERT INTO before_image VALUES (1, 'state', 1, '{')"), "before_image", "broken JSON"),
)


@pytest.mark.parametrize(("damage", "table", "what"), DAMAGES)
def test_damage_is_found_and_named(sound: Path, damage: str | tuple[str, str | None], table: str, what: str) -> None:
    script = damage if isinstance(damage, str) else damage[databases.on_postgresql()]
    if script is None:
        pytest.skip("PostgreSQL takes no such thing, or has nothing of the kind")
    m.run_sql(sound, script)
    assert any(problem.table == table and what in problem.what for problem in problems(sound))


def test_every_rule_has_its_damage(sound: Path) -> None:
    with open_store(str(sound), read_only=True) as store, store.reader() as reader:
        rules = (*INVARIANTS, *dialect_of(reader.connection).invariants)
    assert [
        (rule.table, rule.rule)
        for rule in rules
        if not any(table == rule.table and what in rule.rule for _, table, what in DAMAGES)
    ] == []


def test_a_state_whose_observations_were_given_up_is_sound(sound: Path) -> None:
    """Those that are kept must not lack anything."""
    given_up = f"UPDATE traversal SET observations = observations - 1, observations_kept_from_ns = {m.ns(3)}"
    script = f"{given_up} WHERE number = 1; DELETE FROM observation WHERE label = 'cup'"
    m.run_sql(sound, script)
    m.renew_checksums(sound)
    assert problems(sound) == []
    kept = f"UPDATE traversal SET observations_kept_from_ns = {m.ns(1)}"
    m.run_sql(sound, kept)
    found = [(problem.row, problem.what.partition(",")[0]) for problem in problems(sound)]
    assert found == [
        ("cup-1", "counts more observations than it has"),
        ("cup-1 state 0", "has no observation between its first and its last support"),
    ]


@pytest.mark.postgresql_only
@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE traversal SET config = '{'",
        "UPDATE instance SET label_belief = ''",
        "INSERT INTO before_image VALUES (1, 'state', 1, '{')",
        "UPDATE visit SET instance_number = 99",
        "UPDATE observation SET score = 1",
        "DELETE FROM observation",
        "UPDATE state SET first_seen_ns = 0 WHERE state_index = 1",
    ],
)
def test_what_postgresql_itself_refuses(sound: Path, damage: str) -> None:
    import psycopg

    with pytest.raises((psycopg.DataError, psycopg.IntegrityError)):
        m.run_sql(sound, damage)
