"""Times for people."""

from __future__ import annotations

import pytest

import memories as m
from supermap_cli.errors import QueryError
from supermap_cli.query.clock import Clock

WALL = Clock(m.ns(0), m.ns(100))
SENSOR = Clock(5 * 10**9, 90 * 10**9)


def test_wall_time_is_printed_as_utc() -> None:
    assert WALL.text(m.ns(61.27)) == "2026-01-05T09:01:01.2Z"
    assert WALL.brief(m.ns(61.27)) == "09:01:01.2Z"
    assert Clock(m.ns(0), m.ns(86_400)).brief(m.ns(61.27)) == "2026-01-05 09:01:01Z"


def test_sensor_time_near_zero_is_printed_as_seconds_since_the_start() -> None:
    assert SENSOR.text(int(7.5e9)) == "2.5 s"
    assert SENSOR.between(int(6e9), int(7.5e9)) == "between 1.0 s and 2.5 s"


def test_no_time_is_a_dash() -> None:
    assert WALL.text(None) == "-"


@pytest.mark.parametrize("text", ["09:01:30", "2026-01-05T09:01:30Z", "2026-01-05T09:01:30", "90", "90.0"])
def test_times_are_read(text: str) -> None:
    assert WALL.parse(text) == m.ns(90)


@pytest.mark.parametrize("text", ["noon", "25:99:99:99", "10:xx"])
def test_what_is_no_time_is_a_query_error(text: str) -> None:
    with pytest.raises(QueryError, match="is no time"):
        WALL.parse(text)
