"""The written forms of a noun: small letters, no hyphens, and the singulars that a plural may come from."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator

_WORD = re.compile(r"[^\W_]+")
_APOSTROPHES = str.maketrans("", "", "'\N{RIGHT SINGLE QUOTATION MARK}`")
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "œ": "oe", "æ": "ae"})

PLURALS = (
    ("sses", "ss"),
    ("ches", "ch"),
    ("shes", "sh"),
    ("zzes", "zz"),
    ("xes", "x"),
    ("oes", "o"),
    ("ves", "f"),
    ("ves", "fe"),
    ("ies", "y"),
    ("ies", "ie"),
    ("es", "e"),
    ("es", ""),
    ("s", ""),
)
"""English plural endings and what the singular has there, the likelier first."""


def normalise(text: str) -> str:
    """Case-folded, without apostrophes, single spaces for all that is no letter or digit ("T-shirt": "t shirt")."""
    return " ".join(_WORD.findall(text.casefold().translate(_APOSTROPHES)))


def plain_spellings(text: str) -> tuple[str, ...]:
    """How a text is typed: case-folded as it is, with "ae" for "ä" and the like, and without any accents."""
    folded = text.casefold()
    if folded.isascii():
        return (folded,)
    written_out = folded.translate(_UMLAUTS)
    bare = "".join(letter for letter in unicodedata.normalize("NFD", folded) if not unicodedata.combining(letter))
    return tuple(dict.fromkeys((folded, written_out, bare)))


def singulars(name: str) -> Iterator[str]:
    """The name itself, then what it may be the plural of, the likelier first. Not all are words.

    `name` is normalised; its last word is what has a number ("coffee tables").
    """
    yield name
    before, space, word = name.rpartition(" ")
    if len(word) > 2 and not word.endswith("ss"):
        for ending, replacement in PLURALS:
            if word.endswith(ending):
                yield before + space + word[: len(word) - len(ending)] + replacement


def regular_singular(name: str) -> str:
    """The likeliest singular of a name that no lexicon has ("gizmos": "gizmo"); a singular stays as it is."""
    word = name.rpartition(" ")[2]
    if word.endswith(("us", "is")):
        return name
    unlikely = {("ves", "f"), ("ves", "fe"), ("es", "e"), ("es", "")}
    before = name[: len(name) - len(word)]
    if len(word) > 3 and not word.endswith("ss"):
        for ending, replacement in PLURALS:
            if word.endswith(ending) and (ending, replacement) not in unlikely:
                return before + word[: len(word) - len(ending)] + replacement
    return name
