"""Known words that a misspelt one may have meant."""

from __future__ import annotations

from collections.abc import Collection

LEAST_SIMILARITY = 0.72
"""Normalised Damerau-Levenshtein similarity (1 - edits / length of the longer word; a transposition of neighbours is
one edit) from which a known word is suggested: it mended 8 of 10 misspellings, with one false hit in 15. docs/words.md
has the figures for other words.
"""

MOST_SUGGESTIONS = 3


def close_words(word: str, known: Collection[str]) -> list[tuple[str, float]]:
    """The known words that `word` may be a misspelling of, with their similarity (0 to 1), the most similar first.

    Of equally similar words those that begin with the same letter come first, then those of the same length: first
    letters are seldom mistyped, and letters are swapped more often than left out (Damerau 1964).
    """
    from rapidfuzz import process  # noqa: PLC0415 - only for words that are not known
    from rapidfuzz.distance import DamerauLevenshtein  # noqa: PLC0415

    found = process.extract(
        word, list(known), scorer=DamerauLevenshtein.normalized_similarity, score_cutoff=LEAST_SIMILARITY, limit=20
    )
    ranked = sorted(found, key=lambda hit: (-hit[1], hit[0][:1] != word[:1], abs(len(hit[0]) - len(word)), hit[0]))
    return [(str(name), float(score)) for name, score, _ in ranked]
