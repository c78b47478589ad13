"""Printing and parsing of times."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import QueryError
from supermap_cli.query.clock import Clock
from supermap_cli.query.traversal_spans import TraversalSpan
from support import memories as m

S = 10**9
DAY_S = 86_400
ONE_DAY = Clock((TraversalSpan(1, "monday", m.ns(0), m.ns(100)),))
SENSOR = Clock((TraversalSpan(1, "run", 5 * S, 90 * S),))
TWO_DAYS = Clock(
    (TraversalSpan(1, "monday", m.ns(0), m.ns(100)), TraversalSpan(2, "tuesday", m.ns(DAY_S), m.ns(DAY_S + 100)))
)
FROM_ZERO = Clock((TraversalSpan(1, "monday", 0, 60 * S), TraversalSpan(2, "tuesday", 120 * S, 150 * S, 120 * S)))
"""Two recordings that both begin at 0."""
BEHIND = Clock(
    (TraversalSpan(1, "tuesday", m.ns(50), m.ns(100)), TraversalSpan(2, "monday", m.ns(180), m.ns(280), 180 * S))
)
"""The second was recorded from 50 s before the first on."""
MIXED = Clock((TraversalSpan(1, "sim", 5 * S, 90 * S), TraversalSpan(2, "monday", m.ns(0), m.ns(100))))


def test_wall_time_is_printed_as_utc() -> None:
    assert ONE_DAY.text(m.ns(61.27)) == "2026-01-05T09:01:01.2Z"
    assert ONE_DAY.brief(m.ns(61.27)) == "09:01:01.2Z"
    assert TWO_DAYS.brief(m.ns(61.27)) == "2026-01-05 09:01:01Z"


def test_times_without_a_date_are_seconds_from_the_start_of_their_traversal() -> None:
    assert SENSOR.text(int(7.5e9)) == "2.5 s"
    assert SENSOR.between(6 * S, int(7.5e9)) == "between 1.0 s and 2.5 s"
    assert FROM_ZERO.text(int(7.5e9)) == "monday+7.5s"
    assert FROM_ZERO.brief(int(127.5e9)) == "tuesday+7.5s"


def test_times_of_a_shifted_traversal_are_named_after_it_and_as_in_its_recording() -> None:
    assert BEHIND.text(m.ns(60)) == "tuesday@2026-01-05T09:01:00.0Z"  # monday's clock shows that, too

    assert BEHIND.text(m.ns(190.5)) == "monday@2026-01-05T09:00:10.5Z"
    assert BEHIND.brief(m.ns(190.5)) == "monday@09:00:10.5Z"


def test_a_map_may_mix_recordings_with_and_without_wall_time() -> None:
    assert MIXED.span(7 * S, m.ns(10)) == "sim+2.0s .. 09:00:10.0Z"


def test_a_missing_time_is_a_dash() -> None:
    assert ONE_DAY.text(None) == "-"


@pytest.mark.parametrize("text", ["09:01:30", "2026-01-05T09:01:30Z", "2026-01-05t09:01:30", "90", "90.0", "90 s"])
def test_times_are_parsed(text: str) -> None:
    assert ONE_DAY.parse(text).stamp_ns == m.ns(90)
    assert ONE_DAY.parse(text).note is None


def test_the_minute_in_which_a_traversal_begins_is_one_that_it_has() -> None:
    clock = Clock((TraversalSpan(1, "monday", m.ns(30), m.ns(100)),))
    assert clock.parse_ns("9:00") == m.ns(30)
    assert clock.parse_ns("9:01") == m.ns(60)


def test_an_ambiguous_time_means_the_newest_traversal_with_a_note() -> None:
    parsed = TWO_DAYS.parse("09:01")
    assert parsed.stamp_ns == m.ns(DAY_S + 60)
    assert parsed.note == "09:01 was taken as that of tuesday; say 'monday@09:01' for another"
    assert TWO_DAYS.parse_ns("monday@09:01") == m.ns(60)
    assert BEHIND.parse("2026-01-05T09:01:00Z").stamp_ns == m.ns(60 + 180)
    assert "'tuesday@2026-01-05T09:01:00Z'" in (BEHIND.parse("2026-01-05T09:01:00Z").note or "")


def test_seconds_count_from_the_maps_start() -> None:
    assert FROM_ZERO.parse("12").stamp_ns == 12 * S
    assert "'tuesday+12s'" in (FROM_ZERO.parse("12").note or "")
    assert FROM_ZERO.parse("40").note is None  # tuesday does not last so long
    assert FROM_ZERO.parse("130 s").stamp_ns == 130 * S


def test_a_time_between_traversals_is_after_the_one_before_and_not_in_the_next() -> None:
    assert TWO_DAYS.parse_ns("2026-01-05T12:00:00Z") == m.ns(3 * 3600)
    assert BEHIND.parse_ns("tuesday@09:04") == m.ns(180) - 1
    assert TWO_DAYS.parse_ns("10:00") == m.ns(DAY_S + 3600)


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("monday@9:01", m.ns(60)),
        ("Monday@09:01:00", m.ns(60)),
        ("1@09:01", m.ns(60)),
        ("last@2026-01-06T09:01:00Z", m.ns(DAY_S + 60)),
        ("tuesday+12.5s", m.ns(DAY_S + 12.5)),
        ("first+12", m.ns(12)),
        ("monday-1s", m.ns(-1)),
        ("monday@12s", m.ns(12)),
    ],
)
def test_a_time_may_name_its_traversal(text: str, stamp_ns: int) -> None:
    assert TWO_DAYS.parse(text).stamp_ns == stamp_ns


def test_the_longest_name_counts() -> None:
    clock = Clock((TraversalSpan(1, "run", m.ns(0), m.ns(50)), TraversalSpan(2, "run-1", m.ns(60), m.ns(100))))
    assert clock.parse_ns("run-1+3s") == m.ns(63)


@pytest.mark.parametrize("text", ["noon", "25:99:99:99", "10:xx", "friday@10:21", "monday@", "nan", "inf", "1e30", ""])
def test_what_is_no_time_is_a_query_error(text: str) -> None:
    with pytest.raises(QueryError, match="is no time"):
        TWO_DAYS.parse_ns(text)


def test_a_time_of_day_of_recordings_without_wall_time_is_a_query_error() -> None:
    with pytest.raises(QueryError, match="no wall time"):
        FROM_ZERO.parse_ns("10:21")
    with pytest.raises(QueryError, match="sim has no wall time"):
        MIXED.parse_ns("sim@10:21")


@given(st.sampled_from([ONE_DAY, SENSOR, TWO_DAYS, FROM_ZERO, BEHIND, MIXED]), st.floats(0, 1), st.integers(0, 1))
def test_printed_times_parse_back(clock: Clock, share: float, which: int) -> None:
    span = clock.spans[min(which, len(clock.spans) - 1)]
    stamp_ns = span.start_ns + round(share * (span.end_ns - span.start_ns) / (S / 10)) * (S // 10)
    assert abs(clock.parse_ns(clock.text(stamp_ns)) - stamp_ns) <= S // 10
