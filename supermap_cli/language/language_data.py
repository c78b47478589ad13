"""The data of a language besides its grammar: short forms, numbers, places, from `grammars/LANGUAGE.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

GRAMMARS = files("supermap_cli.language") / "grammars"


@dataclass(frozen=True)
class LanguageData:
    """What the tokeniser knows of a language. `code` is its ISO 639-1 code."""

    code: str
    contractions: Mapping[str, str]
    numbers: Mapping[str, float]
    ordinals: Mapping[str, int]
    places: frozenset[str]


@cache
def language_data(code: str) -> LanguageData:
    """The data of a language, read once."""
    table = tomllib.loads((GRAMMARS / f"{code}.toml").read_text(encoding="utf-8"))
    return LanguageData(
        code,
        table.get("contractions", {}),
        table.get("numbers", {}),
        table.get("ordinals", {}),
        frozenset(table.get("places", {}).get("words", ())),
    )
