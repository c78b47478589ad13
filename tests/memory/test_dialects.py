"""What boxes and labels find is the same on every database."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sqlalchemy import Connection

from supermap_cli.memory import open_store
from supermap_cli.memory.databases import dialect_of
from support import kitchen


@pytest.fixture(scope="module")
def connection(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Connection]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader.connection


@pytest.mark.parametrize(
    ("words", "numbers"),
    [
        ("table", {kitchen.TABLE}),
        ("Tables", {kitchen.TABLE}),
        ("dining table", {kitchen.TABLE}),
        ("table dining", set()),
        ("chair", {kitchen.CHAIR, kitchen.OTHER_CHAIR}),
        ("chair-2", {kitchen.OTHER_CHAIR}),
        ("other", set(range(kitchen.TABLE, kitchen.LAMP + 1))),
        ("the", set()),
        ("potted_plants", {kitchen.PLANT}),
        ('"cup OR chair*', set()),
        ("", set()),
        ("  -- ", set()),
    ],
)
def test_a_word_is_found_in_ids_and_labels(connection: Connection, words: str, numbers: set[int]) -> None:
    assert set(connection.execute(dialect_of(connection).matching_labels(words)).scalars()) == numbers


@pytest.mark.parametrize(
    ("lower_m", "upper_m", "states"),
    [
        ((3.9, -0.1, 0.4), (4.1, 0.1, 0.6), {"chair-2"}),
        ((-0.6, -0.1, 0.85), (-0.4, 0.1, 0.95), {"vase-1"}),
        ((20, 20, 0), (21, 21, 1), set()),
        ((8, 8, -10), (10, 10, 10), {"lamp-1"}),
        ((8, 8, 5), (10, 10, 10), set()),
    ],
)
def test_boxes_that_touch_are_found(
    connection: Connection, lower_m: tuple[float, ...], upper_m: tuple[float, ...], states: set[str]
) -> None:
    found = set(connection.execute(dialect_of(connection).states_near(lower_m, upper_m)).scalars())
    named = connection.exec_driver_sql(
        "SELECT state.id, instance.id FROM state JOIN instance ON instance.number = instance_number"
    )
    assert {name for state_id, name in named if state_id in found} == states
