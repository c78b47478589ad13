"""Times and ages that no stamp of 64 bits holds are refused in one line, wherever they are written."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import answer
from supermap_cli.query.clock import clock_of
from supermap_cli.query.overview import overview_at
from supermap_cli.query.retention_policy import parse_retention_policy
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.query.traversal_spans import FIRST_YEAR, LAST_YEAR, datetime_to_stamp
from supermap_cli.types.limits import LARGEST_STAMP_NS
from support import kitchen

OUTSIDE = ("2300-01-01T00:00:00Z", "1677-01-01T00:00:00Z", "0001-01-01T00:00:00Z", "9999-12-31T23:59:59Z")


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


def test_the_years_that_are_named_fit_stamps() -> None:
    first, last = (datetime_to_stamp(datetime(year, 1, 1, tzinfo=UTC)) for year in (FIRST_YEAR, LAST_YEAR + 1))
    assert -LARGEST_STAMP_NS < first < last < LARGEST_STAMP_NS


@pytest.mark.parametrize("written", [*OUTSIDE, "monday@2300-01-01T00:00:00Z"])
def test_a_time_beyond_stamps_is_refused(reader: MapReader, written: str) -> None:
    with pytest.raises(QueryError, match="outside of the years"):
        parse_time_point(written, reader, clock_of(reader))


@pytest.mark.parametrize(
    "question",
    [
        *(f"chairs {word} {time}" for time in OUTSIDE for word in ("at", "since", "before")),
        "chairs between 0001-01-01T00:00:00Z and 9999-12-31T00:00:00Z",
        "chairs on 9999-12-31",
        "what changed between 0001-01-01T00:00:00Z and 9999-12-31T00:00:00Z",
    ],
)
def test_a_question_about_such_a_time_is_refused(reader: MapReader, question: str) -> None:
    with pytest.raises(QueryError, match="outside of the years"):
        answer(question, reader)


@pytest.mark.parametrize("written", ["1824-01-01T00:00:00Z", "2115-12-31T23:59:59.9Z"])
def test_the_first_and_last_times_are_answered(reader: MapReader, written: str) -> None:
    clock = clock_of(reader)
    assert overview_at(reader, parse_time_point(written, reader, clock), clock) is not None
    answer(f"chairs at {written}", reader)


@pytest.mark.parametrize(
    "limit", ["99999999999999999999d", "9" * 400 + "y", "600y", "0001-01-01T00:00:00Z", "9999-12-31T00:00:00Z"]
)
def test_an_age_beyond_stamps_is_refused(reader: MapReader, limit: str) -> None:
    with pytest.raises(QueryError, match="outside of the years"):
        parse_retention_policy([f"crops={limit}"], reader)


def test_more_traversals_than_there_are_keep_all(reader: MapReader) -> None:
    assert parse_retention_policy([f"crops={'9' * 5000} traversals"], reader).crops_ns == 0
