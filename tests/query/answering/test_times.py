"""Times of questions by the recordings' own clock."""

from __future__ import annotations

import pytest

from supermap_cli.errors import QueryError
from support import kitchen
from support import memories as m
from support.asking import Ask, asker, ids


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    return asker(kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db"))


@pytest.mark.parametrize(
    ("question", "found"),
    [
        ("cup on 2026-01-05", ["cup-1"]),
        ("vases before tuesday", []),
        ("chairs seen since monday", ["chair-1"]),
        ("tvs seen in the last minute", ["tv-1"]),
        ("cups in the last minute", []),
        ("cups in the first minute", ["cup-1"]),
        ("what was on the table on monday", ["cup-1"]),
        ("what was near the chair on monday", ["dining-table-1", "cup-1", "tv-1", "potted-plant-1"]),
    ],
)  # fmt: skip
def test_found(ask: Ask, question: str, found: list[str]) -> None:
    assert ids(ask(question)) == found


def test_a_day_without_a_recording_is_refused(ask: Ask) -> None:
    with pytest.raises(QueryError, match="nothing was recorded on Sunday, 2026-01-04"):
        ask("where was the cup yesterday")


def test_an_interval_says_from_where_it_is_counted(ask: Ask) -> None:
    assert "counted back from the map's end, 2026-01-05T09:18:20.0Z" in ask("cups in the last minute").notes


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("when did you last see the cup", "cup-1 was last seen 2026-01-05T09:01:30.0Z."),
        ("when did you first see the cup", "cup-1 was first seen 2026-01-05T09:00:01.0Z."),
        ("when did the chair move", "chair-1 moved 3.61 m between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:41.0Z."),
        ("when did the cup disappear", "cup-1 left between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z."),
        ("since when is the vase there", "vase-1 stands there since some time between 2026-01-05T09:01:30.0Z and"),
        ("since when is the lamp there", "lamp-1 stands there since 2026-01-05T09:16:41.0Z at the latest"),
        ("how often did the chair move", "chair-1 moved once, as far as anybody saw."),
        ("how long has the vase been there", "vase-1 has stood there for at least 89 s and at most 16.8 minutes"),
    ],
)
def test_dates_are_bounds(ask: Ask, question: str, told: str) -> None:
    assert told in ask(question).message


def test_an_event_is_a_moment(ask: Ask) -> None:
    found = ask("what changed since the cup disappeared")
    assert f"cup-1 disappeared between {'2026-01-05T09:01:30.0Z'} and 2026-01-05T09:16:45.0Z" in found.notes
    with pytest.raises(QueryError, match="it is not known that tv disappeared"):
        ask("what changed since the tv disappeared")


def test_measured_times_are_in_the_document(ask: Ask) -> None:
    (measure,) = ask("when did you last see the cup").measures or ()
    assert (measure.what, measure.value, measure.unit) == ("last seen", float(m.ns(90)), "ns")
