"""The data of a language besides its grammar: short forms, numbers, places, from `grammars/LANGUAGE.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

from supermap_cli.language.inflection import plain_spellings
from supermap_cli.language.refusals import RefusalKind, RefusedQuestionError

GRAMMARS = files("supermap_cli.language") / "grammars"


@dataclass(frozen=True)
class LanguageData:
    """What the tokeniser knows of a language. `code` is its ISO 639-1 code.

    `elisions` are what an apostrophe separates from the next word ("l" of French "l'armoire"). A language is `joined`
    if it writes no spaces between words: then every character is looked at as a word. `values` are what words stand
    for that are no English ("montag": "monday"). `past` are the words of which one tells that a question is in the past
    tense, `fillers` those that say nothing wherever they stand; the first of `plural_verbs` and `singular_verbs` tells
    whether a question is about several things.
    """

    code: str
    contractions: Mapping[str, str]
    numbers: Mapping[str, float]
    ordinals: Mapping[str, int]
    places: frozenset[str]
    use_verbs: Mapping[str, str]
    relations: Mapping[str, str]
    values: Mapping[str, str]
    elisions: frozenset[str]
    joined: bool
    past: frozenset[str]
    fillers: frozenset[str]
    plural_verbs: frozenset[str]
    singular_verbs: frozenset[str]
    refusals: Mapping[str, str]

    def refusal(
        self,
        kind: RefusalKind | Literal["place"],
        part: str | None = None,
        where: str | None = None,
        near: Sequence[str] = (),
    ) -> RefusedQuestionError:
        """A refusal in the language. `part` is what it is about, `near` are words that may have been meant."""
        texts = self.refusals
        told = texts[kind if part is not None or f"{kind}, no part" not in texts else f"{kind}, no part"]
        either = texts["or"].join(f"'{word}'" for word in near)
        cure = texts["did you mean"].format(words=either) if near else texts["hint"]
        what = told.format(part=part)
        shown: RefusalKind = "unknowable" if kind == "place" else kind
        return RefusedQuestionError(shown, what, part=part, where=where, cure=cure, near=near, language=self.code)


@cache
def language_data(code: str) -> LanguageData:
    """The data of a language, read once."""
    table = tomllib.loads((GRAMMARS / f"{code}.toml").read_text(encoding="utf-8"))
    return LanguageData(
        code,
        table.get("contractions", {}),
        table.get("numbers", {}),
        table.get("ordinals", {}),
        frozenset(spelt(dict.fromkeys(table.get("places", {}).get("words", ()), ""))),
        spelt(table.get("use_verbs", {})),
        spelt({phrase: name for name, phrases in table.get("relations", {}).items() for phrase in phrases}),
        spelt(table.get("values", {})),
        frozenset(table.get("elisions", ())),
        table.get("joined", False),
        frozenset(spelt(dict.fromkeys(table["past"], ""))),
        frozenset(spelt(dict.fromkeys(table.get("fillers", ()), ""))),
        frozenset(spelt(dict.fromkeys(table["plural_verbs"], ""))),
        frozenset(spelt(dict.fromkeys(table["singular_verbs"], ""))),
        table["refusals"],
    )


def spelt(phrases: Mapping[str, str]) -> dict[str, str]:
    """Phrases in all the spellings that they are typed in, with their values; an exact spelling wins over others."""
    plain = {spelling: value for phrase, value in phrases.items() for spelling in plain_spellings(phrase)}
    return {**plain, **{phrase.casefold(): value for phrase, value in phrases.items()}}
