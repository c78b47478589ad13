"""Parsing a question: text -> typed question, or a refusal that says why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from lark import UnexpectedInput
from lark.grammar import Rule
from lark.parse_tree_builder import ParseTreeBuilder

from supermap_cli.language.accounting import lost_words
from supermap_cli.language.build_questions import Asked, BuildQuestions, Refused
from supermap_cli.language.earley import RuleSet
from supermap_cli.language.forest import Builder, Forest, Reading
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import LanguageData, language_data
from supermap_cli.language.lexicon import Lexicon, load_lexicon
from supermap_cli.language.prepared import Phrases, load_grammar
from supermap_cli.language.questions import Question
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.language.tokens import Piece, Tokeniser
from supermap_cli.language.words import MOST_CHARACTERS, MOST_WORDS, read_words

HINT = (
    "ask for things like 'cup', 'chair-1', 'chair near the tv', 'how many chairs', 'what is on the table', "
    "'what changed since monday', 'where was the cup earlier'"
)


@dataclass(frozen=True)
class _Inlined:
    """The parts of a rule that is inlined into others. lark adds to the list that it is given, so each gets its own."""

    name: str
    parts: Sequence[Any]

    @property
    def children(self) -> list[Any]:
        """The parts, in a new list."""
        return list(self.parts)


class _Builders(dict[Rule, Callable[[list[Any]], Any]]):
    """The function that makes the value of a rule, for the rules that were asked for."""

    def __missing__(self, rule: Rule) -> Callable[[list[Any]], Any]:
        made = ParseTreeBuilder([rule], _Inlined, ambiguous=False, maybe_placeholders=False)
        function: Callable[[list[Any]], Any] = made.create_callback(_BUILDER)[rule]
        self[rule] = function
        return function


_BUILDER = BuildQuestions()


@dataclass(frozen=True)
class Grammar:
    """The grammar of a language, ready to parse."""

    rules: RuleSet
    build: Builder
    phrases: Phrases
    data: LanguageData


@cache
def grammar(language: str) -> Grammar:
    """The grammar of a language, loaded once."""
    plain = load_grammar(language)
    return Grammar(RuleSet(plain.rules), _Builders(), plain.phrases, language_data(language))


def parse(text: str, known: KnownNames, language: str | None = None) -> Question:
    """The typed question that a text asks.

    `known` are the names of the map; `language` is an ISO 639-1 code, English if it is not given. Raises
    `RefusedQuestionError`, whose kind says why a text is no question that can be answered.
    """
    code = language or "en"
    rules = grammar(code)
    lexicon = load_lexicon(code)
    if len(text) > MOST_CHARACTERS:
        raise RefusedQuestionError("too long", f"a question of {len(text)} characters", cure="ask in fewer words")
    words = read_words(text, rules.data.contractions, _kept(known))
    if not words:
        raise RefusedQuestionError("empty", "an empty question", cure=HINT)
    if len(words) > MOST_WORDS:
        raise RefusedQuestionError("too long", f"a question of {len(words)} words", cure="ask in fewer words")
    tokeniser = Tokeniser(rules.data, rules.phrases, lexicon, known)
    readings = _readings(words, rules, tokeniser)
    if not readings:
        raise _refusal(text, words, rules, tokeniser, lexicon)
    best = readings[0].value
    if isinstance(best, Refused):
        raise _understood_refusal(best, text)
    others = tuple(
        reading.value.body
        for reading in readings[1:]
        if isinstance(reading.value, Asked) and reading.rank == readings[0].rank and reading.value.time == best.time
    )
    past = any(word in PAST_TENSE for word in words)
    return Question(text, best.body, best.time, past, code, others)


PAST_TENSE = frozenset({"was", "were", "did", "been", "had", "stood", "lay", "sat", "hung", "saw", "ever"})


def _kept(known: KnownNames) -> frozenset[str]:
    names = (*known.labels, *known.traversals)
    return frozenset(word for name in names for word in name.casefold().split())


def _readings(words: Sequence[str], rules: Grammar, tokeniser: Tokeniser) -> tuple[Reading, ...]:
    """The readings of the first way to cut the words that has any; a refusal only if no way gives a question."""
    refused: tuple[Reading, ...] = ()
    for pieces in tokeniser.cuts(words):
        found = _read(pieces, rules)
        asked = tuple(reading for reading in found if isinstance(reading.value, Asked))
        if asked:
            return asked
        refused = refused or found
    return refused


def _read(pieces: Sequence[Piece], rules: Grammar) -> tuple[Reading, ...]:
    try:
        forest = _forest(pieces, rules)
    except UnexpectedInput:
        return ()
    return tuple(
        reading
        for reading in Forest(rules.build).readings(forest)
        if isinstance(reading.value, Refused) or not lost_words(reading.words, reading.value)
    )


def _forest(pieces: Sequence[Piece], rules: Grammar) -> Any:
    """The parse forest. Raises `UnexpectedInput` where the words do not fit the grammar."""
    kinds = {kind for piece in pieces for kind in piece.values}
    return rules.rules.forest([piece.token for piece in pieces], kinds)


def _understood_refusal(refused: Refused, text: str) -> RefusedQuestionError:
    if refused.kind == "unknowable":
        told = f"'{refused.part}': a map does not hold that" if refused.part else "a map does not hold that"
        return RefusedQuestionError("unknowable", told, part=refused.part, where=text, cure=HINT)
    return RefusedQuestionError(refused.kind, "this is no question about the place", where=text, cure=HINT)


def _refusal(
    text: str, words: Sequence[str], rules: Grammar, tokeniser: Tokeniser, lexicon: Lexicon
) -> RefusedQuestionError:
    """Why no reading was found: an unknown word, a room, or the part at which the parser stopped."""
    unknown = tokeniser.unknown(words)
    if unknown:
        near = lexicon.suggest(unknown[0], tokeniser.known.labels)
        cure = f"did you mean {' or '.join(repr(word) for word in near[:3])}?" if near else HINT
        told = f"I do not know the word {unknown[0]!r}"
        return RefusedQuestionError("unknown word", told, part=unknown[0], where=text, cure=cure)
    furthest = 0
    for pieces in tokeniser.cuts(words):
        places = [piece.written for piece in pieces if "PLACE" in piece.values]
        if places:
            told = f"'{places[0]}' is a room or a place; a map holds things, not rooms"
            return RefusedQuestionError("unknowable", told, part=places[0], where=text, cure=HINT)
        furthest = max(furthest, _stopped_at(pieces, rules))
    part = " ".join(words[furthest:]) or " ".join(words)
    return RefusedQuestionError(
        "not understood", f"this part was not understood: '{part}'", part=part, where=text, cure=HINT
    )


def _stopped_at(pieces: Sequence[Piece], rules: Grammar) -> int:
    """The index of the word at which no rule could go on; of the first one where the sentence only lacks an end."""
    try:
        _forest(pieces, rules)
    except UnexpectedInput as stopped:
        token = getattr(stopped, "token", None)
        piece = getattr(token, "value", None)
        return piece.start if isinstance(piece, Piece) else 0
    return 0
