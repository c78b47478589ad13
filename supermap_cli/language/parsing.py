"""Parsing a question: text -> typed question, or a refusal that says why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from lark import UnexpectedInput
from lark.grammar import Rule, Terminal
from lark.parse_tree_builder import ParseTreeBuilder

from supermap_cli.errors import QueryError
from supermap_cli.language.accounting import lost_words
from supermap_cli.language.build_happenings import Asked
from supermap_cli.language.build_questions import BuildQuestions, Refused
from supermap_cli.language.detection import LANGUAGES, detected_language
from supermap_cli.language.earley import RuleSet
from supermap_cli.language.forest import Builder, Forest, Interpretation
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import LanguageData, language_data
from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.mending import is_english, mended_words
from supermap_cli.language.prepared import Phrases, load_grammar
from supermap_cli.language.questions import Body, Holds, Named, Question
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.language.tokens import Lexeme, Tokeniser
from supermap_cli.language.translations import Nouns, load_nouns
from supermap_cli.language.words import MOST_CHARACTERS, MOST_WORDS, join, read_words


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
        untyped: Any = ParseTreeBuilder
        made = untyped([rule], _Inlined, ambiguous=False, maybe_placeholders=False)
        function: Callable[[list[Any]], Any] = made.create_callback(_BUILDER)[rule]
        self[rule] = function
        return function


_BUILDER = BuildQuestions()


def function_of(rule: Rule) -> str | None:
    """The name of the function that makes the value of a rule; "" for a rule that is inlined, or that passes its only
    part on; `None` where a function is missing.
    """
    name = str(rule.alias or rule.origin.name)
    if hasattr(_BUILDER, name):
        return name
    kept = [symbol for symbol in rule.expansion if not (isinstance(symbol, Terminal) and symbol.filter_out)]
    passes = rule.options.expand1 and not rule.alias and len(kept) == 1 and not kept[0].name.startswith("_")
    return "" if name.startswith("_") or passes else None


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

    `known` are the names of the map; `language` is an ISO 639-1 code, found by the words if it is not given. Raises
    `RefusedQuestionError`, whose kind says why a text is no question that can be answered.
    """
    if language is not None and language not in LANGUAGES:
        raise QueryError(f"there is no grammar of the language {language!r}", cure=f"known: {', '.join(LANGUAGES)}")
    code = language or _language_of(text, known)
    rules = grammar(code)
    lexicon = load_nouns(code)
    if len(text) > MOST_CHARACTERS:
        raise rules.data.refusal("too long")
    words = read_words(text, rules.data, _kept(known))
    if not words:
        raise rules.data.refusal("empty")
    if len(words) > MOST_WORDS:
        raise rules.data.refusal("too long")
    tokeniser = Tokeniser(rules.data, rules.phrases, lexicon, known)
    readings = _readings(words, rules, tokeniser)
    mended: tuple[tuple[str, str], ...] = ()
    if not _asks(readings) and (fewer := _without_fillers(words, rules.data)) != words:
        words, readings = fewer, _readings(fewer, rules, tokeniser) or readings
    if not _asks(readings):
        unknown = set(tokeniser.unknown(words))
        names = _names_of_map(known, code)
        held = {word for name in (*names, *rules.phrases) for word in name.casefold().split()}
        if code != "en" or not any(map(is_english, unknown - held)):
            mended = mended_words(words, unknown, rules.phrases, names)
        if mended:
            meant = dict(mended)
            words = tuple(meant.get(word, word) for word in words)
            readings = _readings(words, rules, tokeniser) or readings
    if not readings:
        raise _refusal(text, words, rules, tokeniser, lexicon)
    best = readings[0].value
    if isinstance(best, Refused):
        raise rules.data.refusal(best.kind, best.part, text)
    others = tuple(
        reading.value.body
        for reading in readings[1:]
        if isinstance(reading.value, Asked) and reading.rank == readings[0].rank and reading.value.time == best.time
    )
    past = not rules.data.past.isdisjoint((*words, *(piece.written for piece in next(tokeniser.cuts(words)))))
    several = _is_plural(words, rules.data)
    bodies = tuple(_of_all(body) if several else body for body in (best.body, *others))
    return Question(text, bodies[0], best.time, past, code, bodies[1:], mended)


def _is_plural(words: Sequence[str], data: LanguageData) -> bool:
    """Whether the first verb is in the plural; never in a language whose verbs do not tell."""
    verbs = (word for word in words if word in data.plural_verbs or word in data.singular_verbs)
    return next(verbs, None) in data.plural_verbs


def _of_all(body: Body) -> Body:
    """The question asked of all of its things: "are the chairs red" is answered with yes only if all of them are."""
    if not isinstance(body, Holds) or body.things.quantity is not None:
        return body
    noun = body.things.noun
    if isinstance(noun, Named) and (noun.written != noun.name or noun.name.endswith("s")):
        return replace(body, things=replace(body.things, quantity="all"))
    return body


def _names_of_map(known: KnownNames, code: str) -> tuple[str, ...]:
    """Labels and traversals, and in English the other names of the labels: "televison" of a map that has a tv."""
    names = (*known.labels, *known.traversals)
    if code != "en":
        return names
    lexicon = load_lexicon(code)
    return (*names, *(name for label in known.labels for name in lexicon.synonyms(label)))


def _asks(readings: Sequence[Interpretation]) -> bool:
    return any(isinstance(reading.value, Asked) for reading in readings)


def _without_fillers(words: Sequence[str], data: LanguageData) -> tuple[str, ...]:
    """The words without those that say nothing; all of them where one stands before a number ("exactly two")."""
    numbers = [at for at, word in enumerate(words) if word in data.numbers or word.isdecimal()]
    if any(words[at - 1] in data.fillers for at in numbers if at):
        return tuple(words)
    said = [word for word in words if word not in data.fillers]
    while said and said[0] == ",":
        del said[0]
    return tuple(said) or tuple(words)


def _language_of(text: str, known: KnownNames) -> str:
    """English where it knows every word; else the language that explains most of them."""
    english = grammar("en")
    words = read_words(text, english.data, _kept(known))[:MOST_WORDS]
    tokeniser = Tokeniser(english.data, english.phrases, load_nouns("en"), known)
    return detected_language(text, known) if tokeniser.unknown(words) else "en"


def _kept(known: KnownNames) -> frozenset[str]:
    names = (*known.labels, *known.traversals)
    return frozenset(word for name in names for word in name.casefold().split())


def _readings(words: Sequence[str], rules: Grammar, tokeniser: Tokeniser) -> tuple[Interpretation, ...]:
    """The readings of the first way to cut the words that has any; a refusal only if no way gives a question."""
    refused: tuple[Interpretation, ...] = ()
    for pieces in tokeniser.cuts(words):
        found = _read(pieces, rules)
        asked = tuple(reading for reading in found if isinstance(reading.value, Asked))
        if asked:
            return asked
        refused = refused or found
    return refused


def _read(pieces: Sequence[Lexeme], rules: Grammar) -> tuple[Interpretation, ...]:
    try:
        forest = _forest(pieces, rules)
    except UnexpectedInput:
        return ()
    return tuple(
        reading
        for reading in Forest(rules.build).readings(forest)
        if isinstance(reading.value, Refused) or not lost_words(reading.words, reading.value)
    )


def _forest(pieces: Sequence[Lexeme], rules: Grammar) -> Any:
    """The parse forest. Raises `UnexpectedInput` where the words do not fit the grammar."""
    kinds = {kind for piece in pieces for kind in piece.values}
    return rules.rules.forest([piece.token for piece in pieces], kinds)


def _refusal(
    text: str, words: Sequence[str], rules: Grammar, tokeniser: Tokeniser, lexicon: Nouns
) -> RefusedQuestionError:
    """Why no reading was found: an unknown word, a room, or the part at which the parser stopped."""
    refusal = rules.data.refusal
    unknown = tokeniser.unknown(words)
    if unknown:
        near = lexicon.suggest(unknown[0], tokeniser.known.labels)
        return refusal("unknown word", unknown[0], text, near)
    furthest = 0
    for pieces in tokeniser.cuts(words):
        places = [piece.written for piece in pieces if "PLACE" in piece.values]
        if places:
            return refusal("place", places[0], text)
        furthest = max(furthest, _stopped_at(pieces, rules))
    part = join(words[furthest:] or words, joined=rules.data.joined)
    return refusal("not understood", part, text)


def _stopped_at(pieces: Sequence[Lexeme], rules: Grammar) -> int:
    """The index of the word at which no rule could go on; of the first one where the sentence only lacks an end."""
    try:
        _forest(pieces, rules)
    except UnexpectedInput as stopped:
        token = getattr(stopped, "token", None)
        piece = getattr(token, "value", None)
        return piece.start if isinstance(piece, Lexeme) else 0
    return 0
