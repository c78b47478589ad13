"""What is wrong with an entry of a configuration or an option, in the words of people who write them."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import ValidationError

_SHOWN = 40
"""Letters of a wrong value that are repeated."""

_WORDS: Mapping[str, str] = {
    "extra_forbidden": "there is no such entry",
    "missing": "it is missing",
    "int_parsing": "{given} is no whole number",
    "int_parsing_size": "{given} is no whole number to work with",
    "int_from_float": "{given} is no whole number",
    "int_type": "{given} is no whole number",
    "float_parsing": "{given} is no number",
    "float_type": "{given} is no number",
    "finite_number": "{given} is no finite number",
    "bool_parsing": "{given} is neither true nor false",
    "bool_type": "{given} is neither true nor false",
    "string_type": "{given} is no text",
    "dict_type": "{given} is no table",
    "model_type": "{given} is no table",
    "greater_than": "it must be greater than {gt:.12g}, not {given}",
    "greater_than_equal": "it must be greater than or equal to {ge:.12g}, not {given}",
    "less_than": "it must be less than {lt:.12g}, not {given}",
    "less_than_equal": "it must be less than or equal to {le:.12g}, not {given}",
    "literal_error": "{given} is none of {expected}",
}
"""The kind of a fault -> its words, with what was given and the bounds."""


def wrong_entry(error: ValidationError) -> tuple[tuple[str, ...], str]:
    """The names that lead to the first wrong entry, and what is wrong with it."""
    first = error.errors(include_url=False)[0]
    entry = tuple(str(part) for part in first["loc"])
    words = _WORDS.get(first["type"])
    if words is None:
        return entry, first["msg"].removeprefix("Value error, ").replace("Input should be", "it must be")
    return entry, words.format(given=_shown(first["input"]), **first.get("ctx", {}))


def _shown(given: object) -> str:
    text = repr(given) if not isinstance(given, int) or isinstance(given, bool) else _digits(given)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN // 2]}..."


def _digits(number: int) -> str:
    """A number in digits, but not more than Python writes."""
    return str(number) if number.bit_length() < 128 else "a number of more than 38 digits"
