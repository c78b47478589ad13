"""`db check` finds what is broken, and nothing in a sound map."""

from __future__ import annotations

from pathlib import Path

import pytest

import memories as m
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import INVARIANTS, check
from supermap_cli.memory.values import Problem
from supermap_cli.types.memory import MapDelta

SOUND = MapDelta(
    keyframes=m.keyframes([1, 2, 5]),
    observations=(m.observation(1, 1), m.observation(1, 5)),
    instances=(m.instance(1, "chair"),),
    states=(m.state(1, 0, (1, 2), gone=3), m.state(1, 1, (5, 5), (2, 0, 0.5))),
    visits=(m.visit(1, 2, 3, 0, (1, 5)),),
)


def problems(path: Path) -> list[Problem]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return check(reader)


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), SOUND))


def test_a_sound_map_has_no_problems(sound: Path) -> None:
    assert problems(sound) == []


@pytest.mark.parametrize(
    ("damage", "table", "what"),
    [
        ("DROP TRIGGER state_is_disjoint_on_update; UPDATE state SET first_seen_ns = 0", "state", "overlaps another"),
        ("UPDATE state SET gone_ns = gone_ns + 9000000000 WHERE state_index = 0", "state", "gone only after"),
        ("UPDATE state SET state_index = 7 WHERE state_index = 1", "state", "not all the numbers before"),
        ("UPDATE keyframe SET stamp_ns = stamp_ns - 500000000", "state", "no observation between"),
        ("DELETE FROM state", "instance", "has no state"),
        ("UPDATE state SET gone_ns = last_seen_ns + 1", "instance", "counts as present"),
        ("PRAGMA ignore_check_constraints = 1; UPDATE instance SET merged_into = 1", "instance", "in a circle"),
        ("UPDATE traversal SET end_ns = start_ns", "keyframe", "outside its traversal"),
        ("UPDATE traversal SET observations = 3", "traversal", "counts other keyframes or observations"),
        ("UPDATE visit SET last_support_ns = last_support_ns * 2", "visit", "outside its traversal"),
        ("INSERT INTO before_image VALUES (1, 'state', 1, '{}')", "before_image", "not being built"),
        ("DELETE FROM state_box", "state_box", "every state once"),
        ("DELETE FROM instance_label", "instance_label", "every instance once"),
        ("UPDATE traversal SET config = '{'", "traversal", "broken JSON"),
        ("DROP TRIGGER observation_is_immutable; UPDATE observation SET hypotheses = ''", "observation", "broken JSON"),
        ("UPDATE instance SET engine_state = '{'", "instance", "broken JSON"),
        ("UPDATE instance SET voxels = x'00'", "instance", "SMV1"),
        ("UPDATE visit SET instance_number = 99", "visit", "does not exist"),
    ],
)
def test_damage_is_found_and_named(sound: Path, damage: str, table: str, what: str) -> None:
    m.run_sql(sound, damage)
    assert any(each.table == table and what in each.what for each in problems(sound))


def test_every_rule_has_its_damage() -> None:
    marks = test_damage_is_found_and_named.pytestmark  # type: ignore[attr-defined]
    shown = [(table, what) for _, table, what in marks[0].args[1]]
    assert all(any(table == rule.table and what in rule.rule for table, what in shown) for rule in INVARIANTS)
