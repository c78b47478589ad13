"""Words -> tokens for a grammar: each may be of several kinds, and words can be cut into tokens in several ways."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from heapq import heappop, heappush
from itertools import count, islice

from lark import Token

from supermap_cli.language.earley import ANY_WORD
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import LanguageData
from supermap_cli.language.questions import Identified, Named
from supermap_cli.language.translations import Nouns
from supermap_cli.language.words import LONGEST_PHRASE, is_instance, join

MOST_CUTS = 32
"""Ways to cut a question into tokens that are tried; more than three were needed by none of the tests' questions."""

PUNCTUATION = {",": "_COMMA", "(": "_LPAR", ")": "_RPAR"}

UNKNOWN_COST = 4
"""What an unknown word costs a way to cut, in tokens."""

_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}(\.\d+)?)?z?|\d{4}-\d{2}-\d{2}t[\d:.]+z?")
_TWELVE_HOURS = re.compile(r"(\d{1,2})(?::(\d{2}))?\s?(am|pm)")
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
_NUMBER = re.compile(r"\d{1,9}(?:[.,]\d{1,6})?")
_TRAVERSAL_TIME = re.compile(r"[@+]\S+")


class Kinds(str):
    """The kinds of a token, as a text that equals each of their names: a grammar's terminal matches any of them."""

    __slots__ = ("names",)

    names: frozenset[str]

    def __new__(cls, names: frozenset[str]) -> Kinds:
        """The kinds of these names."""
        made = super().__new__(cls, "|".join(sorted(names)))
        made.names = names
        return made

    def __eq__(self, other: object) -> bool:
        return other == ANY_WORD or other in self.names

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = str.__hash__


@dataclass(frozen=True)
class Lexeme:
    """Some words that are one token: its kinds with the value of each, at words [start, end)."""

    start: int
    end: int
    written: str
    values: Mapping[str, object]

    @property
    def token(self) -> Token:
        """The token for the parser; its kinds are those of the values, its value is the piece."""
        token = Token(Kinds(frozenset(self.values)), self.written)
        token.value = self
        return token


@dataclass
class Tokeniser:
    """Finds what the words of a question can be."""

    language: LanguageData
    phrases: Mapping[str, frozenset[str]]
    lexicon: Nouns
    known: KnownNames
    _longest: int = field(default=LONGEST_PHRASE, init=False)

    @cached_property
    def _relations(self) -> Mapping[str, str]:
        return {**self.language.relations, **self.known.relations.get(self.language.code, {})}

    @cached_property
    def _traversals(self) -> Mapping[str, str]:
        return {" ".join(name.casefold().split()): name for name in self.known.traversals}

    @cached_property
    def _labels(self) -> frozenset[str]:
        return frozenset(self.known.labels)

    def cuts(self, words: Sequence[str]) -> Iterator[tuple[Lexeme, ...]]:
        """The ways to cut words into pieces, those with long pieces first."""
        pieces = [self._pieces_at(words, start) for start in range(len(words))]
        yield from islice(_shortest_cuts(pieces), MOST_CUTS)

    def unknown(self, words: Sequence[str]) -> tuple[str, ...]:
        """The words that no piece explains."""
        explained: set[int] = set()
        for start in range(len(words)):
            for piece in self._pieces_at(words, start):
                if piece.values:
                    explained.update(range(piece.start, piece.end))
        return tuple(word for at, word in enumerate(words) if at not in explained)

    def _pieces_at(self, words: Sequence[str], start: int) -> list[Lexeme]:
        """What begins at `start`, the longest first; at least the word itself."""
        found: dict[int, dict[str, object]] = {1: {}}
        for length in range(1, min(self._longest, len(words) - start) + 1):
            text = join(words[start : start + length], joined=self.language.joined)
            values = self._values(text)
            if "USE" in values and self._use_goes_on(words, start, start + length):
                del values["USE"]
            if values:
                found.setdefault(length, {}).update(values)
        within = words[: next((at for at in range(start, len(words)) if words[at] in PUNCTUATION), len(words))]
        noun = self.lexicon.longest_noun(within, start, self._labels) if start < len(within) else None
        if noun is not None:
            category = self.lexicon.category(noun.name)
            kind = "PLACE" if category == "place" and noun.name not in self._labels else "NOUN"
            found.setdefault(noun.length, {})[kind] = Named(noun.name, noun.written, noun.hypernym)
            if noun.length > 1:
                shorter = self.lexicon.longest_noun(words[: start + 1], start, self._labels)
                if shorter is not None:
                    found[1]["NOUN"] = Named(shorter.name, shorter.written, shorter.hypernym)
        return [
            Lexeme(start, start + length, join(words[start : start + length], joined=self.language.joined), values)
            for length, values in sorted(found.items(), reverse=True)
        ]

    def _use_goes_on(self, words: Sequence[str], start: int, end: int) -> bool:
        """Whether the words of a use are the beginning of another one's: "eat" of "eat at", unless what follows closes
        the question ("sit in the room").
        """
        longer = (join(words[start : end + more], joined=self.language.joined) for more in (1, 2))
        if not any(text in self.lexicon.use_phrases for text in longer if end < len(words)):
            return False
        return "_CLOSING" not in self.phrases.get(join(words[end:], joined=self.language.joined), ())

    def _values(self, text: str) -> dict[str, object]:
        values: dict[str, object] = dict.fromkeys(self.phrases.get(text, ()), self.language.values.get(text, text))
        if (relation := self._relations.get(text)) is not None:
            values["RELATION"] = relation
        if (traversal := self._traversals.get(self.language.values.get(text, text))) is not None:
            values["TRAVERSAL"] = traversal
            values.pop("WEEKDAY", None)
        if (use := self.lexicon.use_phrases.get(text)) is not None:
            values["USE"] = use
        if (use := self.language.use_verbs.get(text)) is not None:
            values["USE_VERB"] = use
        if (material := self.lexicon.material_words.get(text)) is not None:
            values["MATERIAL"] = material
        if (colour := self.lexicon.colour_words.get(text)) is not None:
            values[colour.upper()] = text
        if text in self.language.places:
            values["PLACE"] = Named(text, text)
        if text in PUNCTUATION:
            values[PUNCTUATION[text]] = text
        if is_instance(text) and "TRAVERSAL" not in values:
            values["ID"] = Identified(text)
        values.update(self._numbers(text))
        return values

    def _numbers(self, text: str) -> dict[str, object]:
        if text in self.language.numbers:
            return {"NUMBER": float(self.language.numbers[text])}
        if text in self.language.ordinals:
            return {"ORDINAL": self.language.ordinals[text]}
        if _NUMBER.fullmatch(text):
            return {"NUMBER": float(text.replace(",", "."))}
        return {"DATE": text} if _DATE.fullmatch(text) else self._clock_times(text)

    def _clock_times(self, text: str) -> dict[str, object]:
        """Times of day and of a traversal: "10:21", "3 pm", "monday@10:21", "monday+12s", "first+2.5s"."""
        if _CLOCK.fullmatch(text):
            return {"CLOCK": text.upper()}
        if (hours := _TWELVE_HOURS.fullmatch(text)) is not None and 1 <= int(hours[1]) <= 12:
            return {"CLOCK": f"{int(hours[1]) % 12 + 12 * (hours[3] == 'pm'):02d}:{hours[2] or '00'}"}
        for name, written in (*self._traversals.items(), ("first", "first"), ("last", "last")):
            rest = text.removeprefix(name)
            if rest != text and _TRAVERSAL_TIME.fullmatch(rest):
                return {"CLOCK": f"{written}{rest}"}
        return {}


def _shortest_cuts(pieces: Sequence[Sequence[Lexeme]]) -> Iterator[tuple[Lexeme, ...]]:
    """All ways from the first to the last word, those of fewest pieces first (A*, with the exact rest as estimate)."""
    rest = [0] * (len(pieces) + 1)
    for start in range(len(pieces) - 1, -1, -1):
        rest[start] = min(_cost(piece) + rest[piece.end] for piece in pieces[start])
    order = count()
    open_: list[tuple[int, int, int, int, tuple[Lexeme, ...]]] = [(rest[0], next(order), 0, 0, ())]
    while open_:
        _, _, cost, at, path = heappop(open_)
        if at == len(pieces):
            yield path
            continue
        for piece in pieces[at]:
            spent = cost + _cost(piece)
            heappush(open_, (spent + rest[piece.end], next(order), spent, piece.end, (*path, piece)))


def _cost(piece: Lexeme) -> int:
    """One for a piece; more for one that nothing is known of, which only a refusal can use."""
    return 1 if piece.values else UNKNOWN_COST
