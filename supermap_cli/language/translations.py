"""Lexicons of other languages than English: their nouns, and the English names that these stand for.

What names mean (synonyms, kinds, uses) is said once, in English. A language has a file `lexicons/LANGUAGE.toml` with
its nouns, what things are for, materials and colours.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from importlib.resources import files
from typing import Any, Protocol

from supermap_cli.language.inflection import normalise, plain_spellings
from supermap_cli.language.lexicon import LONGEST_NAME, Category, Lexicon, NounMatch, load_lexicon
from supermap_cli.language.spelling import MOST_SUGGESTIONS, close_words
from supermap_cli.language.words import join

SHORTEST_HEAD = 4
"""Letters of the shortest word that a compound's end is taken for: shorter ones end words by chance. Chosen."""


class Nouns(Protocol):
    """What the parser of a language asks its lexicon for."""

    def longest_noun(self, words: Sequence[str], start: int, extra: Collection[str] = ()) -> NounMatch | None:
        """The longest known noun that begins at `words[start]`; `extra` are names that count as known."""
        ...

    def category(self, name: str) -> Category | None:
        """What an English name names."""
        ...

    @property
    def use_phrases(self) -> Mapping[str, str]:
        """What people say for a use -> the use, in English."""
        ...

    @property
    def material_words(self) -> Mapping[str, str]:
        """Word for a material -> its English name."""
        ...

    @property
    def colour_words(self) -> Mapping[str, str]:
        """Word for a colour -> the basic English colour term."""
        ...

    def suggest(self, word: str, among: Collection[str] | None = None) -> tuple[str, ...]:
        """Known words that a word may be a misspelling of."""
        ...


class TranslatedLexicon:
    """The nouns of a language, over the English lexicon."""

    def __init__(self, table: Mapping[str, Any], english: Lexicon) -> None:
        self._table = table
        self._english = english
        self._endings: Sequence[str] = table.get("endings", ())
        self._adjective_endings: Sequence[str] = table.get("adjective_endings", ("",))
        self._joined: bool = table.get("joined", False)

    def longest_noun(self, words: Sequence[str], start: int, extra: Collection[str] = ()) -> NounMatch | None:
        """The longest noun of the language, or name of the map, that begins at `words[start]`."""
        labels = _normalised(frozenset(extra))
        longest = self._longest_form if self._joined else LONGEST_NAME
        for length in range(min(longest, len(words) - start), 0, -1):
            written = join(words[start : start + length], joined=self._joined)
            name = self._name_of(normalise(written), labels) if "," not in written else None
            if name is not None:
                return NounMatch(name, written, length, self._english.has_kinds(name))
        return None

    def category(self, name: str) -> Category | None:
        """What an English name names."""
        return self._english.category(name)

    @cached_property
    def use_phrases(self) -> Mapping[str, str]:
        """What people say for a use -> the use, in English."""
        phrases = {phrase: use for use, said in self._table["uses"].items() for phrase in said}
        return {spelling: use for phrase, use in phrases.items() for spelling in plain_spellings(phrase)}

    @cached_property
    def material_words(self) -> Mapping[str, str]:
        """Word for a material, in all its endings -> its English name."""
        return self._inflected(self._table["materials"])

    @cached_property
    def colour_words(self) -> Mapping[str, str]:
        """Word for a colour, in all its endings -> the basic English colour term."""
        return self._inflected(self._table["colours"])

    def suggest(self, word: str, among: Collection[str] | None = None) -> tuple[str, ...]:
        """Known words that a word may be a misspelling of, or a compound with ("Gartenstuhl": "Stuhl"); those for
        things of the map, `among`, come first.
        """
        written = normalise(word)
        heads = (written[start:] for start in range(1, len(written) - SHORTEST_HEAD + 1))
        found = [form for form, _ in close_words(written, self._forms)]
        found += [head for head in heads if head in self._forms and head not in found]
        names = {self._english.normalise(label) for label in among or ()}
        here = {form for form in found if self._forms[form] in names}
        ranked = sorted(found, key=lambda form: form not in here)
        return tuple(dict.fromkeys(self._written[form] for form in ranked))[:MOST_SUGGESTIONS]

    def _name_of(self, phrase: str, labels: Collection[str]) -> str | None:
        if phrase in self._forms:
            return self._forms[phrase]
        for ending in self._endings:
            stem = phrase.removesuffix(ending)
            if stem != phrase and stem in self._forms:
                return self._forms[stem]
        label = self._english.name_of(phrase, labels)
        return label if label is not None and label in labels else None

    def _inflected(self, words: Mapping[str, str]) -> Mapping[str, str]:
        """The words with every ending that an adjective can have."""
        return {
            spelling: value
            for word, value in words.items()
            for ending in self._adjective_endings
            for spelling in plain_spellings(word + ending)
        }

    @property
    def nouns(self) -> Mapping[str, str]:
        """Every written form of the nouns -> the English name."""
        return self._forms

    @cached_property
    def _written(self) -> Mapping[str, str]:
        """Normalised form, in each spelling -> as the file writes it."""
        return {
            spelling: form
            for forms in self._table["nouns"].values()
            for form in forms
            for spelling in plain_spellings(normalise(form))
        }

    @cached_property
    def _forms(self) -> Mapping[str, str]:
        """Normalised form, in each spelling -> English name; the spelling of the file wins over plain ones."""
        exact = {normalise(form): name for name, forms in self._table["nouns"].items() for form in forms}
        plain = {spelling: name for form, name in exact.items() for spelling in plain_spellings(form)}
        return {**plain, **exact}

    @cached_property
    def _longest_form(self) -> int:
        return max(map(len, self._forms))


@cache
def load_nouns(language: str) -> Nouns:
    """The lexicon of a language (ISO 639-1), as its parser needs it."""
    english = load_lexicon()
    if language == "en":
        return english
    text = (files("supermap_cli.language.lexicons") / f"{language}.toml").read_text(encoding="utf-8")
    return TranslatedLexicon(tomllib.loads(text), english)


@lru_cache(maxsize=16)
def _normalised(labels: frozenset[str]) -> frozenset[str]:
    return frozenset(map(normalise, labels))
