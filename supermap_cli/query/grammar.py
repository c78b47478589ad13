"""The grammar of questions: words -> a typed question.

    question  := [opener] things [time]   |   time things
    things    := noun phrase [relation things]
    opener    := "how many" | "count" | "where is" | "which" | "is there" | "find" | ...
    relation  := "near" | "next to" | "on" | "on top of" | "under" | "inside" | "above" | "attached to" | ...
    time      := "now" | "earlier" | "before" | "first" | "last" | "in" TRAVERSAL | "at" TIME | "at" TIME "in" TRAVERSAL

Phrases are resolved against the map later, in `answers`.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal

from supermap_cli.errors import QueryError
from supermap_cli.query.relations import RELATION_WORDS, RelationName
from supermap_cli.query.time_parsing import TRAVERSAL_TIME_SUFFIX

Intent = Literal["find", "count", "exists"]
TimeKind = Literal["now", "earlier", "first", "last", "traversal", "at"]
Words = tuple[str, ...]

HINT = (
    "ask for things like 'cup', 'chair-1', 'chair near tv', 'how many chairs', 'cup on the table earlier', "
    "'chairs in monday'; relations are near, beside, on, under, inside, above, attached to; "
    "times are now, earlier, first, last, in TRAVERSAL, at 10:21, at 10:21 in TRAVERSAL"
)


@dataclass(frozen=True)
class NounPhrase:
    """A noun without its articles (`None`: any object), and an optional relation to another noun phrase."""

    noun: str | None
    relation: RelationPhrase | None = None


@dataclass(frozen=True)
class RelationPhrase:
    """A relation and its reference."""

    name: RelationName
    reference: NounPhrase


@dataclass(frozen=True)
class TimePhrase:
    """The time of a question. `argument` is the name of a traversal, or a written time (see `time_parsing`); `explicit`
    is false if the question has no words for a time.
    """

    kind: TimeKind = "now"
    argument: str | None = None
    explicit: bool = field(default=True, compare=False)


@dataclass(frozen=True)
class Question:
    """A parsed question."""

    text: str
    intent: Intent
    phrase: NounPhrase
    time: TimePhrase


_OPENERS: tuple[tuple[str, Intent], ...] = (
    ("how many", "count"),
    ("count", "count"),
    ("number of", "count"),
    ("is there", "exists"),
    ("are there", "exists"),
    ("was there", "exists"),
    ("were there", "exists"),
    ("do you see", "exists"),
    ("do we have", "exists"),
    ("is", "exists"),
    ("are", "exists"),
    ("was", "exists"),
    ("were", "exists"),
    ("where", "find"),
    ("what", "find"),
    ("which", "find"),
    ("find", "find"),
    ("locate", "find"),
    ("show", "find"),
    ("list", "find"),
    ("give", "find"),
)


def _word_set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_FILLER_WORDS = _word_set(
    """the a an any some all every each me my our your this that those these there of please is are was were be been do
    does did can could you we i have has see seen which who's it its currently located placed sitting standing lying
    resting hanging mounted found kept"""
)
_PAST_TENSE_WORDS = _word_set("was were did been had")
_GENERIC_NOUNS = _word_set("thing things object objects everything anything something stuff item items")
_UNSUPPORTED_WORDS = _word_set(
    """who whom whose why when how and or not no without except than between delete remove move go bring"""
)
_SUPERLATIVES = _word_set(
    """closest nearest farthest furthest biggest largest smallest tallest highest lowest shortest longest widest
    narrowest thickest thinnest heaviest lightest newest oldest latest earliest most least best worst"""
)
_TIME_WORDS: tuple[tuple[str, TimeKind], ...] = (
    ("right now", "now"),
    ("at the moment", "now"),
    ("at present", "now"),
    ("now", "now"),
    ("today", "now"),
    ("in the past", "earlier"),
    ("earlier", "earlier"),
    ("before", "earlier"),
    ("previously", "earlier"),
    ("formerly", "earlier"),
    ("at first", "first"),
    ("the first time", "first"),
    ("first", "first"),
    ("originally", "first"),
    ("initially", "first"),
    ("the last time", "last"),
    ("last time", "last"),
    ("last seen", "last"),
    ("last", "last"),
    ("lastly", "last"),
)
_TRAVERSAL_NOUNS = frozenset(("traversal", "run", "recording", "visit"))
_TIME_OF_DAY = re.compile(r"\d{1,2}:\d{2}(:\d{2}(\.\d+)?)?|\d{4}-\d{2}-\d{2}t[\d:.]+z?|\d+(\.\d+)?s?")


def parse(text: str, traversals: Collection[str] = ()) -> Question:
    """Parse a question. `traversals` are the names that "in NAME" may use.

    Raises `QueryError` with a hint on the supported forms.
    """
    words = _words(text)
    if not words:
        raise QueryError("an empty question", cure=HINT)
    past = bool(_PAST_TENSE_WORDS & set(words))
    intent, words = _split_opener(words)
    time, words = _split_time(words, traversals)
    phrase = _parse_noun_phrase(words, text)
    if time is None:
        time = TimePhrase("last" if past else "now", explicit=False)
    return Question(text, intent, phrase, time)


def _words(text: str) -> Words:
    return tuple(word for word in (token.strip("?!.,;:\"'()") for token in text.casefold().split()) if word)


def _split_opener(words: Words) -> tuple[Intent, Words]:
    for opener, intent in _OPENERS:
        parts = tuple(opener.split())
        if words[: len(parts)] == parts:
            return intent, words[len(parts) :]
    return "find", words


def _split_time(words: Words, traversals: Collection[str]) -> tuple[TimePhrase | None, Words]:
    """Split off the time at the end or the beginning of a question."""
    found = _split_traversal(words, traversals)
    if found is not None:
        return _split_clock_time_before(*found) or found
    found = _split_clock_time(words) or _split_named_clock_time(words, traversals)
    if found is not None:
        return found
    for phrase, kind in _TIME_WORDS:
        parts = tuple(phrase.split())
        if words[-len(parts) :] == parts:
            return TimePhrase(kind), words[: -len(parts)]
        if words[: len(parts)] == parts and len(words) > len(parts):
            return TimePhrase(kind), words[len(parts) :]
    return None, words


def _split_traversal(words: Words, traversals: Collection[str]) -> tuple[TimePhrase, Words] | None:
    """Split off "in monday", "during the monday run", "in the first traversal", "in first", "in traversal 2"."""
    named = {_words(name): name for name in traversals}
    for at in range(len(words) - 1, -1, -1):
        if words[at] not in {"in", "on", "during", "of", "from"}:
            continue
        rest = tuple(word for word in words[at + 1 :] if word != "the")
        bare = tuple(word for word in rest if word not in _TRAVERSAL_NOUNS)
        for name in (rest, bare):
            if name in named:
                return TimePhrase("traversal", named[name]), words[:at]
        ordinal = len(bare) == 1 and (bare[0] in {"first", "last"} or bare[0].isdecimal())
        if ordinal and (len(rest) > len(bare) or words[at] in {"in", "during"}):
            return TimePhrase("traversal", bare[0]), words[:at]
    return None


def _split_clock_time(words: Words) -> tuple[TimePhrase, Words] | None:
    """Split off "at 10:21", "at 2026-01-05T10:21:00Z", "at 12.5 s"."""
    if words[-1:] in {("s",), ("seconds",), ("utc",)}:
        words = words[:-1]
    if len(words) >= 2 and words[-2] == "at" and _TIME_OF_DAY.fullmatch(words[-1]):
        return TimePhrase("at", words[-1].upper().rstrip("S")), words[:-2]
    return None


def _split_clock_time_before(traversal: TimePhrase, words: Words) -> tuple[TimePhrase, Words] | None:
    """Split off "at 10:21" before "in monday": gives "monday@10:21"."""
    found = _split_clock_time(words)
    return found and (TimePhrase("at", f"{traversal.argument}@{found[0].argument}"), found[1])


def _split_named_clock_time(words: Words, traversals: Collection[str]) -> tuple[TimePhrase, Words] | None:
    """Split off "at monday@10:21", "at monday+12s"."""
    at = max((index for index, word in enumerate(words[:-1]) if word == "at"), default=None)
    if at is None:
        return None
    written = " ".join(words[at + 1 :])
    known = {name.casefold(): name for name in traversals}
    for name in sorted([*known, "first", "last"], key=len, reverse=True):
        rest = written[len(name) :]
        if written.startswith(name) and TRAVERSAL_TIME_SUFFIX.fullmatch(rest):
            return TimePhrase("at", f"{known.get(name, name)}{rest}"), words[:at]
    return None


def _parse_noun_phrase(words: Words, text: str) -> NounPhrase:
    for at in range(len(words)):
        for phrase, name in RELATION_WORDS:
            parts = tuple(phrase.split())
            if words[at : at + len(parts)] == parts:
                reference = _parse_noun_phrase(words[at + len(parts) :], text)
                if reference.noun is None:
                    raise QueryError(f"'{phrase}' what? The question names nothing", where=text, cure=HINT)
                return NounPhrase(_parse_noun(words[:at], text, may_be_empty=True), RelationPhrase(name, reference))
    return NounPhrase(_parse_noun(words, text, may_be_empty=False))


def _parse_noun(words: Words, text: str, *, may_be_empty: bool) -> str | None:
    """The noun of a phrase; `None` for any object."""
    if superlatives := [word for word in words if word in _SUPERLATIVES]:
        problem = f"'{superlatives[0]}' is a superlative; these are not understood yet"
        raise QueryError(problem, where=text, cure=HINT)
    if unsupported := [word for word in words if word in _UNSUPPORTED_WORDS]:
        raise QueryError(f"'{unsupported[0]}' is not understood here", where=text, cure=HINT)
    start, end = 0, len(words)
    while start < end and words[start] in _FILLER_WORDS:
        start += 1
    while end > start and words[end - 1] in _FILLER_WORDS and not _can_is_noun(words, end - 1):
        end -= 1
    noun = words[start:end]
    if any(
        word in _FILLER_WORDS and word != "of" and not _can_is_noun(words, start + at) for at, word in enumerate(noun)
    ):
        raise QueryError(f"'{' '.join(noun)}' is not understood as one thing's name", where=text, cure=HINT)
    if not noun:
        if may_be_empty or "all" in words:
            return None
        raise QueryError("the question names nothing", where=text, cure=HINT)
    return None if set(noun) <= _GENERIC_NOUNS else " ".join(noun)


def _can_is_noun(words: Words, at: int) -> bool:
    """Whether "can" is a noun ("trash can") and not an auxiliary verb ("chairs can you see")."""
    return words[at] == "can" and at > 0 and words[at + 1 : at + 2] not in {("you",), ("we",), ("i",)}
