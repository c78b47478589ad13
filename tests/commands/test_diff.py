"""`supermap diff`."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m
from support.cli import document, supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


def test_a_diff_follows_the_published_schema(db: Path) -> None:
    found = document("diff", "diff", "monday", "tuesday", "--db", db)
    assert found["counts"]["disappeared"] == 1
    assert {change["id"] for change in found["changes"] if change["kind"] == "moved"} == {"chair-1"}


def test_the_table_keeps_not_seen_apart_from_gone(db: Path) -> None:
    printed = supermap("diff", "--db", db).stdout.splitlines()
    assert printed[0].startswith("from monday to tuesday: 1 appeared, 1 disappeared, 1 moved")
    (book,) = (line for line in printed if "book-1" in line)
    assert book.startswith("not observed again")
    assert "never in view" in book


@pytest.mark.parametrize(("names", "turned"), [(("tuesday", "monday"), True), (("1", "2"), False), ((), False)])
def test_a_reversed_order_is_noted(db: Path, names: tuple[str, ...], turned: bool) -> None:
    printed = supermap("diff", *names, "--db", db).stdout
    assert printed.startswith("from monday to tuesday: ")
    assert ("put in the order of time" in printed) is turned


def test_one_traversal_is_an_error(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    assert isinstance(supermap("diff", "--db", path).exception, QueryError)


def test_of_a_large_place_all_changes_are_printed_and_the_rest_is_counted(tmp_path: Path) -> None:
    things = range(1, 301)
    monday = MapDelta(
        keyframes=m.keyframes([1, 90]),
        instances=tuple(m.instance(number, "chair", (number, 0, 0.5), seen=(1, 90)) for number in things),
        states=tuple(m.state(number, 0, (1, 90), (number, 0, 0.5)) for number in things),
        visits=tuple(m.visit(number, 2, 2, 0, (1, 90)) for number in things),
    )
    tuesday = MapDelta(
        keyframes=m.keyframes([1001]),
        states=tuple(m.state(number, 0, (1, 90), (number, 0, 0.5), gone=1001) for number in range(1, 81)),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 100), monday), ("tuesday", (1000, 1100), tuesday))
    printed = supermap("diff", "--db", path).stdout.splitlines()
    assert sum(line.startswith("disappeared") for line in printed) == 80
    assert not any(line.startswith("not observed again") for line in printed)
    assert printed[-1] == "220 more of which nobody can tell; --json and --html have all"
    assert len(document("diff", "diff", "--db", path)["changes"]) == 300
