"""A question as words: normalised, short forms written out, numbers and units apart."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Mapping

MOST_CHARACTERS = 400
"""Longest question that is read (characters): eight times the longest one among the 200 written for the tests."""

MOST_WORDS = 60
"""Most words of a question that is read: three times the longest one among those."""

_QUOTES = str.maketrans({"’": "'", "‘": "'", "`": "'", "´": "'", "“": " ", "”": " ", '"': " ", "„": " ", "…": " "})
_NUMBER_WITH_UNIT = re.compile(r"(\d+(?:[.,]\d+)?)([a-zäöüéèñ]+)")
_INSTANCE = re.compile(r"[^\W\d_][\w]*(?:-[\w]+)*-\d+")
_KEPT_WHOLE = re.compile(r"[\d.:,+@tz-]+|.*[@:].*|.*\+\d.*")
_COMMA = ","
_PARENTHESIS = re.compile(r"[()]")


def read_words(text: str, contractions: Mapping[str, str], kept: Collection[str] = ()) -> tuple[str, ...]:
    """The words of a question in lower case; a comma between two words is a word of its own.

    `kept` are words that are left as they are, such as names of traversals and labels.
    """
    words: list[str] = []
    spaced = _PARENTHESIS.sub(r" \g<0> ", unicodedata.normalize("NFKC", text).translate(_QUOTES)).casefold()
    for raw in spaced.split():
        if raw in "()":
            words.append(raw)
            continue
        bare = raw.strip("?!.;:,[]{}<>*_~|¿¡、。")
        if raw.startswith(_COMMA) and words and bare:
            words.append(_COMMA)
        words += _parts(bare, contractions, kept) if bare else []
        if raw.rstrip("?!.").endswith((_COMMA, ";", ":")) and words and words[-1] != _COMMA:
            words.append(_COMMA)
    while words and words[-1] == _COMMA:
        words.pop()
    return tuple(words)


def is_instance(word: str) -> bool:
    """Whether a word has the form of an id: a label and a number ("dining-table-1")."""
    return _INSTANCE.fullmatch(word) is not None


def _parts(word: str, contractions: Mapping[str, str], kept: Collection[str]) -> list[str]:
    if word in kept:
        return [word]
    if (written_out := contractions.get(word)) is not None:
        return written_out.split()
    if is_instance(word):
        return [word]
    if (measure := _NUMBER_WITH_UNIT.fullmatch(word)) is not None:
        return [word] if measure[2] in {"st", "nd", "rd", "th", "am", "pm"} else [measure[1], measure[2]]
    if _KEPT_WHOLE.fullmatch(word):
        return [word]
    if "-" in word or "/" in word or "," in word:
        return [part for part in re.split(r"[-/,]+", word) if part]
    if "'" in word and word.rstrip("'") in kept:
        return [word.rstrip("'")]
    return [word]
