"""Misspelt words of a question: replaced where one word of the language or the map is clearly meant."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from functools import cache
from importlib.resources import files
from itertools import pairwise

from supermap_cli.language.inflection import singulars
from supermap_cli.language.spelling import close_words

LEAST_SIMILARITY = (0.75, 0.8)
"""Normalised Damerau-Levenshtein similarity from which a word is replaced by one of the map, and of the language:
one edit in four letters, or in five. More than is needed for a suggestion, since nobody confirms it; "charging" is 0.75
from "hanging". Two letters that are swapped ("waht") are always put right.
"""

LEAST_LETTERS = 4
"""Letters of the shortest word that is replaced, one less for a word of the map; shorter ones are one edit away from
too many."""

MOST_MENDED = 3
"""Words of one question that are replaced; with more of them it is no English, or no question."""


@cache
def _english_words() -> frozenset[str]:
    words = files("supermap_cli.language.lexicons") / "en_words.txt"
    return frozenset(words.read_text(encoding="utf-8").split())


def is_english(word: str) -> bool:
    """Whether a word, or the singular or the verb that it may be a form of, is English, so that it is not misspelt."""
    forms = {word, *singulars(word), word.removesuffix("ed"), word.removesuffix("ing"), word.removesuffix("d")}
    return not forms.isdisjoint(_english_words())


def mended_words(
    words: Sequence[str], unknown: Collection[str], of_language: Iterable[str], of_map: Collection[str]
) -> tuple[tuple[str, str], ...]:
    """(typed, meant) for each unknown word; empty unless all of them have a word that is clearly meant.

    Words of the map win over those of the language; of two that are equally close neither is taken.
    """
    distinct = tuple(dict.fromkeys(word for word in words if word in unknown))
    if not distinct or len(distinct) > MOST_MENDED:
        return ()
    known = [sorted(_words_of(of_map)), sorted(_words_of(of_language))]
    found = [(word, _meant(word, known)) for word in distinct]
    return (
        tuple((word, meant) for word, meant in found if meant and meant != word)
        if all(meant for _, meant in found)
        else ()
    )


def _meant(word: str, known: Sequence[Collection[str]]) -> str | None:
    if len(word) < LEAST_LETTERS - 1 or not word.isalpha():
        return None
    groups = known if len(word) >= LEAST_LETTERS else known[:1]
    ranked = [
        (name, score)
        for group, least in zip(groups, LEAST_SIMILARITY, strict=False)
        for name, score in close_words(word, group)
        if score >= least or _is_transposition(word, name)
    ]
    if not ranked:
        return None
    transposed = [name for name, _ in ranked if _is_transposition(word, name)]
    if transposed:
        return transposed[0]
    best = max(score for _, score in ranked)
    closest = list(dict.fromkeys(name for name, score in ranked if score == best))
    of_map = [name for name in closest if name in known[0]]
    if len(of_map) == 1:
        return of_map[0]
    return closest[0] if len(closest) == 1 else None


def _is_transposition(word: str, other: str) -> bool:
    """Whether two words differ by two neighbouring letters that are swapped."""
    if len(word) != len(other):
        return False
    differing = [at for at, (one, two) in enumerate(zip(word, other, strict=True)) if one != two]
    return any(
        differing == [first, second] and word[first] == other[second] and word[second] == other[first]
        for first, second in pairwise(differing)
        if second == first + 1
    )


def _words_of(phrases: Iterable[str]) -> set[str]:
    """The words of phrases that are long enough to be mistyped, with the plurals of labels."""
    found = {word for phrase in phrases for word in phrase.casefold().split()}
    return {form for word in found if len(word) >= LEAST_LETTERS - 1 for form in (word, f"{word}s")}
