"""A question as words: normalised, short forms written out, numbers and units apart."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Sequence

from supermap_cli.language.language_data import LanguageData

MOST_CHARACTERS = 400
"""Longest question that is read (characters): eight times the longest one among the 200 written for the tests."""

MOST_WORDS = 60
"""Most words of a question that is read: three times the longest one among those."""

LONGEST_PHRASE = 7
"""Words of the longest phrase of a grammar that is looked for."""

_QUOTES = str.maketrans({"’": "'", "‘": "'", "`": "'", "´": "'", "“": " ", "”": " ", '"': " ", "„": " ", "…": " "})  # noqa: RUF001 - these are what is replaced
_NUMBER_WITH_UNIT = re.compile(r"(\d+(?:[.,]\d+)?)([a-zäöüéèñ]+)")
_INSTANCE = re.compile(r"[^\W\d_][\w]*(?:-[\w]+)*-\d+")
_KEPT_WHOLE = re.compile(r"[\d.:,+@tz-]+|.*[@:].*|.*\+\d.*")
_OF_ONE_WORD = frozenset({"st", "nd", "rd", "th", "am", "pm"})
"""What may follow a number in one word, without being a unit: "2nd", "3pm"."""

_COMMA = ","
_PARENTHESIS = re.compile(r"[()]")


def read_words(text: str, language: LanguageData, kept: Collection[str] = ()) -> tuple[str, ...]:
    """The words of a question in lower case; a comma between two words is a word of its own.

    `kept` are words that are left as they are, such as names of traversals and labels.
    """
    if language.joined:
        text = _spaced(text)
    words: list[str] = []
    spaced = _PARENTHESIS.sub(r" \g<0> ", unicodedata.normalize("NFKC", text).translate(_QUOTES)).casefold()
    for raw in spaced.split():
        if raw in "()":
            words.append(raw)
            continue
        bare = raw.strip("?!.;:,[]{}<>*_~|¿¡、。")
        if raw.startswith(_COMMA) and words and bare:
            words.append(_COMMA)
        words += _parts(bare, language, kept) if bare else []
        if raw.rstrip("?!.").endswith((_COMMA, ";", ":")) and words and words[-1] != _COMMA:
            words.append(_COMMA)
    while words and words[-1] == _COMMA:
        words.pop()
    return tuple(words)


def is_instance(word: str) -> bool:
    """Whether a word has the form of an id: a label and a number ("dining-table-1")."""
    return _INSTANCE.fullmatch(word) is not None


def is_spaced(character: str) -> bool:
    """Whether a letter belongs to a script that puts spaces between words; not so Chinese and Japanese."""
    return not unicodedata.name(character, "").startswith(("CJK", "HIRAGANA", "KATAKANA"))


def join(words: Sequence[str], *, joined: bool) -> str:
    """Words as they are written: with spaces; in a language without, only between words of other scripts."""
    if not joined:
        return " ".join(words)
    text = ""
    for word in words:
        text += " " * (bool(text) and is_spaced(text[-1]) and is_spaced(word[0])) + word
    return text


def _spaced(text: str) -> str:
    """A text with spaces around each character of a script that has none."""
    return "".join(character if is_spaced(character) else f" {character} " for character in text)


def _parts(word: str, language: LanguageData, kept: Collection[str]) -> list[str]:
    if word in kept:
        return [word]
    if (written_out := language.contractions.get(word)) is not None:
        return written_out.split()
    if word.endswith("'s") and len(word) > 2:
        return [*_parts(word[:-2], language, kept), "'s"]
    elided, apostrophe, rest = word.partition("'")
    if apostrophe and rest and elided in language.elisions:
        return [*([elided] if elided else []), *_parts(rest, language, kept)]
    return _split(word)


def _split(word: str) -> list[str]:
    """A word at its hyphens and slashes, and a number from its unit; ids, times and dates stay whole."""
    measure = _NUMBER_WITH_UNIT.fullmatch(word)
    if measure is not None and measure[2] not in _OF_ONE_WORD:
        return [measure[1], measure[2]]
    if measure is not None or is_instance(word) or _KEPT_WHOLE.fullmatch(word):
        return [word]
    return [part for part in re.split(r"[-/,]+", word) if part] or [word]
