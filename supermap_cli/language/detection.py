"""Which language a question is asked in: the one whose words explain most of it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from supermap_cli.language.inflection import plain_spellings
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import LanguageData, language_data
from supermap_cli.language.prepared import load_grammar
from supermap_cli.language.translations import load_nouns
from supermap_cli.language.words import LONGEST_PHRASE, MOST_WORDS, join, read_words

LANGUAGES = ("en", "de", "es", "fr", "zh")
"""The languages that have a grammar; of several that cover a question alike the first is taken."""


LEAST_EXPLAINED = 0.5
"""Share of a text's words that another language than English has to explain: less is a matter of chance, since
short words belong to many languages. Chosen.
"""


def detected_language(text: str, known: KnownNames) -> str:
    """The language (ISO 639-1) that explains the most words of a text; English if none explains more."""
    best, most = LANGUAGES[0], _explained(text, LANGUAGES[0], known)
    for code in LANGUAGES[1:]:
        if most == 1.0:
            break
        share = _explained(text, code, known)
        if share > max(most, LEAST_EXPLAINED):
            best, most = code, share
    return best


def _explained(text: str, code: str, known: KnownNames) -> float:
    """The share of the words (without spaces between them: characters) that are in a phrase or a noun of a language."""
    data = language_data(code)
    words = read_words(text, data)[:MOST_WORDS]
    explained: set[int] = set()
    for start in range(len(words)):
        explained.update(range(start, start + _explained_from(words, start, data, known)))
    return len(explained) / max(len(words), 1)


def _explained_from(words: tuple[str, ...], start: int, data: LanguageData, known: KnownNames) -> int:
    """The number of words from `start` that the longest phrase or noun there has; 0 if there is none."""
    noun = load_nouns(data.code).longest_noun(words, start, known.labels)
    longest = noun.length if noun is not None else 0
    for length in range(min(LONGEST_PHRASE, len(words) - start), longest, -1):
        if join(words[start : start + length], joined=data.joined) in _phrases(data.code):
            return length
    return longest or _is_of_any_language(words[start])


def _is_of_any_language(word: str) -> bool:
    """Whether a word is a number, a time or an id."""
    return word in {",", "(", ")"} or (word.isascii() and any(character.isdigit() for character in word))


@cache
def _phrases(code: str) -> frozenset[str]:
    """All words and phrases that the grammar of a language lists, without making a parser of it."""
    return frozenset(spelling for phrase in _listed(code) for spelling in plain_spellings(phrase))


def _listed(code: str) -> Iterator[str]:
    yield from load_grammar(code).phrases
    data, nouns = language_data(code), load_nouns(code)
    yield from (*data.numbers, *data.ordinals, *data.places, *data.use_verbs, *data.relations)
    yield from (*nouns.use_phrases, *nouns.material_words, *nouns.colour_words)
