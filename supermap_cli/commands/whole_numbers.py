"""Whole numbers on a command line: none that databases and counters cannot hold."""

from __future__ import annotations

import typer

from supermap_cli.errors import ConfigError

MOST_WHOLE = 2**53
"""The largest whole number on a command line: up to here every one is exact in JSON, too, and fits a database's."""

_DIGITS = len(str(MOST_WHOLE))


def whole(parameter: typer.CallbackParam, value: int | None) -> int | None:
    """The callback of every option that takes a whole number."""
    if value is not None and abs(value) > MOST_WHOLE:
        raise ConfigError(f"{parameter.opts[0]} takes no such large number", cure=f"give at most {MOST_WHOLE}")
    return value


def is_whole(text: str) -> bool:
    """Whether a part of a list of numbers is a whole number from 0 that can be worked with."""
    return text.isascii() and text.isdigit() and len(text) <= _DIGITS and int(text) <= MOST_WHOLE
