"""Items made one ahead, in another thread."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.lookahead import LookAhead


def test_nothing_stays_nothing() -> None:
    with LookAhead(iter(())) as ahead:
        assert list(ahead) == []


@given(st.lists(st.integers(), max_size=20))
def test_the_items_and_their_order_stay(items: list[int]) -> None:
    with LookAhead(iter(items)) as ahead:
        assert list(ahead) == items


def test_an_error_comes_where_its_item_would_have_come() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("broken")

    with LookAhead(items()) as ahead:
        wanted = iter(ahead)
        assert next(wanted) == 1
        with pytest.raises(ValueError, match="broken"):
            next(wanted)


def test_it_is_at_most_one_item_and_the_one_in_the_making_ahead() -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for number in range(100):
            made.append(number)
            yield number

    with LookAhead(items()) as ahead:
        next(iter(ahead))
        threading.Event().wait(0.3)
        assert len(made) <= 3


def test_leaving_early_ends_the_thread() -> None:
    before = threading.active_count()
    with LookAhead(iter(range(100))) as ahead:
        next(iter(ahead))
    assert threading.active_count() == before


def test_an_error_of_the_user_of_the_items_passes() -> None:
    with pytest.raises(KeyboardInterrupt), LookAhead(iter(range(100))):
        raise KeyboardInterrupt
