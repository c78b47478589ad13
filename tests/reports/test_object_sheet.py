"""`supermap show ID --picture`: the sheet about one thing, and its life as a bar."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.drawing.life_bar import life
from supermap_cli.memory import open_store
from supermap_cli.query.clock import clock_of
from supermap_cli.reports.object_sheet import views_of
from supermap_cli.types.memory import StateRecord
from support import kitchen
from support import memories as m
from support.cli import supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


def parts(*states: StateRecord) -> list[tuple[str, float, float]]:
    found = life(states, m.ns(0), m.ns(1100))
    return [(part.kind, (part.start_ns - m.ns(0)) / 1e9, (part.end_ns - m.ns(0)) / 1e9) for part in found]


def test_a_life_says_when_nobody_can_say() -> None:
    assert parts(m.state(1, 0, (1, 90), gone=1005)) == [
        ("nobody can say", 0, 1),
        ("seen", 1, 90),
        ("nobody can say", 90, 1005),
        ("seen empty", 1005, 1100),
    ]
    assert parts(m.state(1, 0, (1001, 1090), empty_before=90)) == [
        ("seen empty", 0, 90),
        ("nobody can say", 90, 1001),
        ("seen", 1001, 1090),
        ("not contradicted", 1090, 1100),
    ]


@given(st.lists(st.integers(0, 1100), min_size=3, max_size=14, unique=True), st.booleans(), st.booleans())
def test_the_parts_of_a_life_follow_each_other_without_gaps(times: list[int], gone: bool, empty: bool) -> None:
    times.sort()
    states = [
        m.state(
            1,
            n,
            (times[i], times[i + 1]),
            gone=times[i + 2] if gone else None,
            empty_before=times[i] if empty else None,
        )
        for n, i in enumerate(range(0, len(times) - 2, 3))
    ]
    found = parts(*states)
    assert found[0][1] == 0
    assert found[-1][2] == 1100
    for (_, _, end), (_, start, _) in pairwise(found):
        assert end == start
    seen = [(start, end) for kind, start, end in found if kind == "seen"]
    assert len(seen) == len(states)


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_sheet_is_drawn(db: Path, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"chair.{suffix}"
    result = supermap("show", "chair-1", "--db", db, "--picture", path)
    assert result.exit_code == 0, result.output
    assert "presence" in result.stdout
    if suffix == "png":
        assert cv2.imread(str(path)).shape == (1140, 1800, 3)
    else:
        text = path.read_text()
        for words in ("chair-1", "first view", "best view", "last view", "seen in 3 of 3 views", "nobody can say"):
            assert words in text, words


def test_views_are_the_first_the_best_and_the_last(db: Path) -> None:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        instance = reader.instance("chair-1")
        assert instance is not None
        views = views_of(reader, instance, clock_of(reader))
    assert [view.title for view in views] == ["first view", "best view", "last view"]
    assert "monday" in views[0].words
    assert "tuesday" in views[2].words
    assert all(view.rgb is None or view.rgb.dtype == np.uint8 for view in views)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("show", "--picture", "x.png"), "say which"),
        (("show", "chair-1", "--picture", "x.jpg"), "unknown kind"),
        (("show", "chair-1", "--at", "monday", "--picture", "x.png"), "whole life"),
        (("show", "unicorn-1", "--picture", "x.png"), "unicorn-1"),
    ],
)
def test_what_cannot_be_drawn_is_said_and_nothing_is_written(
    db: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = supermap(*arguments, "--db", db)
    assert result.exit_code != 0
    assert said in result.output + str(result.exception)
    assert not list(tmp_path.iterdir())


def test_a_map_is_never_drawn_over(db: Path) -> None:
    before = db.read_bytes()
    assert supermap("show", "chair-1", "--db", db, "--picture", db).exit_code != 0
    assert db.read_bytes() == before
