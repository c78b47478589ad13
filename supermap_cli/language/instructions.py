"""An instruction for a robot ("go to the chair, then to the desk") as its goals, each the noun phrase of a question."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

from supermap_cli.errors import QueryError
from supermap_cli.language.detection import LANGUAGES
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import language_data, spelt
from supermap_cli.language.parsing import parse
from supermap_cli.language.questions import Find, Named, Question, Robot, Things, Union
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.language.words import join, read_words

MOST_GOALS = 20
"""Goals that one instruction may have: more than anybody says at once."""
EXAMPLE = "supermap navigate 'go to the desk, then to the chair next to the door'"
_ALL_OF = frozenset({"all", "every", "both"})


@dataclass(frozen=True)
class Goal:
    """One goal: a question that finds things. `each`: all that it finds are meant; `any_of`: any one will do;
    `wanted`: so many of them ("two chairs").
    """

    text: str
    question: Question
    each: bool = False
    any_of: bool = False
    wanted: int = 1


@dataclass(frozen=True)
class _Phrases:
    """Phrases of one kind, as words; longer ones are found before shorter ones they begin with."""

    phrases: frozenset[tuple[str, ...]]
    longest: int

    @classmethod
    def of(cls, written: Sequence[str]) -> _Phrases:
        phrases = frozenset(tuple(phrase.split()) for phrase in spelt(dict.fromkeys(written, "")))
        return cls(phrases, max(map(len, phrases), default=0))

    def at(self, words: Sequence[str], start: int) -> int:
        """How many words the longest phrase takes that begins at a word; 0 where none does."""
        lengths = range(min(self.longest, len(words) - start), 0, -1)
        return next((length for length in lengths if tuple(words[start : start + length]) in self.phrases), 0)


@cache
def _phrases(language: str) -> Mapping[str, _Phrases]:
    text = (files("supermap_cli.language") / "instructions.toml").read_text(encoding="utf-8")
    return {kind: _Phrases.of(written) for kind, written in tomllib.loads(text)[language].items()}


def parse_instruction(text: str, known: KnownNames, language: str | None = None) -> tuple[Goal, ...]:
    """The goals of an instruction in their order.

    `known` are the names of the map, `language` an ISO 639-1 code (default: the one whose motions it begins with, else
    as of the goals). Raises `RefusedQuestionError` (a `QueryError`) for a goal that is not understood, or is none.
    """
    if language is not None and language not in LANGUAGES:
        raise QueryError(f"there is no grammar of the language {language!r}", cure=f"known: {', '.join(LANGUAGES)}")
    code = language or _language_of(text)
    words = read_words(text, language_data(code), frozenset(word for name in known.labels for word in name.split()))
    if not words:
        raise QueryError("no instruction", cure=EXAMPLE)
    parts = list(_parts(words, _phrases(code)))
    goals = [goal for part in parts for goal in _goals(part, known, code, language)]
    if len(goals) > MOST_GOALS:
        raise QueryError(f"{len(goals)} goals, more than {MOST_GOALS}", cure="give them in several instructions")
    return tuple(goals)


def _language_of(text: str) -> str:
    """The language whose words of motion an instruction begins with; English where none has them."""
    for code in LANGUAGES:
        words, phrases = read_words(text, language_data(code)), _phrases(code)
        if phrases["motions"].at(words, _opening(words, phrases)):
            return code
    return "en"


def _opening(words: Sequence[str], phrases: Mapping[str, _Phrases]) -> int:
    """The index of the first word after what is said before an instruction."""
    at = 0
    while at < len(words) and (words[at] == "," or phrases["openings"].at(words, at)):
        at += phrases["openings"].at(words, at) or 1
    return at


def _parts(words: Sequence[str], phrases: Mapping[str, _Phrases]) -> Iterator[tuple[str, ...]]:
    """The words of each goal, without those of motion and between goals."""
    goal: list[str] = []
    at = _skip_motion(words, _opening(words, phrases), phrases, onward=False)
    while at < len(words):
        after = _after_separator(words, at, phrases)
        if after is None:
            goal.append(words[at])
            at += 1
        else:
            yield tuple(goal)
            goal, at = [], after
    while goal and (length := _closing(goal, phrases)):
        del goal[-length:]
    yield tuple(goal)


def _after_separator(words: Sequence[str], start: int, phrases: Mapping[str, _Phrases]) -> int | None:
    """The index of the first word of the next goal, where what separates goals begins at a word; else `None`."""
    at, comma = start, words[start] == ","
    at += comma
    length = phrases["separators"].at(words, at)
    if length:
        at += length
        at += at < len(words) and words[at] == ","
        return _skip_motion(words, at, phrases, onward=True)
    if not comma and words[at] == ".":
        return _skip_motion(words, at + 1, phrases, onward=True)
    both = phrases["both"].at(words, at)
    moved = _skip_motion(words, at + both, phrases, onward=True)
    if moved > at + both and (comma or both):
        return moved
    return at + both if comma else None


def _skip_motion(words: Sequence[str], at: int, phrases: Mapping[str, _Phrases], *, onward: bool) -> int:
    length = phrases["motions"].at(words, at)
    if onward:
        length = max(length, phrases["onward"].at(words, at))
    return at + length


def _closing(goal: Sequence[str], phrases: Mapping[str, _Phrases]) -> int:
    starts = range(max(0, len(goal) - phrases["closings"].longest), len(goal))
    return next((len(goal) - start for start in starts if phrases["closings"].at(goal, start) == len(goal) - start), 0)


def _goals(words: tuple[str, ...], known: KnownNames, code: str, language: str | None) -> Iterator[Goal]:
    """The goal that a part names; several where it names several things ("the desk and the chair")."""
    text = join([word for word in words if word != "." or len(words) == 1], joined=language_data(code).joined)
    text = text.replace(" ,", ",")
    if not text:
        raise QueryError("the instruction names no goal, or none between two of its words", cure=EXAMPLE)
    article = _phrases(code)["one_of_many"].at(words, 0)
    asked = join([word for word in words[article:] if word != "."], joined=language_data(code).joined)
    question = parse(asked.replace(" ,", ","), known, language or (code if code != "en" else None))
    things = question.body.things if isinstance(question.body, Find) else None
    if things is None or question.body.place or question.time is not None:  # type: ignore[union-attr]
        raise RefusedQuestionError(
            "not understood",
            f"'{text}' names no thing to go to as it stands now",
            part=text,
            where=text,
            cure="name things: 'go to the chair next to the desk, then to the door'",
            language=code,
        )
    any_of = bool(article)
    members = things.noun.members if isinstance(things.noun, Union) else ()
    if members and any(_phrases(code)["both"].at(words, at) for at in range(len(words))) and things == _only(things):
        for member in members:
            named = isinstance(member.noun, Named) and member == _only(member)
            written = member.noun.written if isinstance(member.noun, Named) and named else text
            yield _goal(written, replace(question, body=Find(member)), member, any_of=any_of)
    else:
        yield _goal(text, question, things, any_of=any_of or bool(members))


def _only(things: Things) -> Things:
    """A phrase of nothing but its noun."""
    return Things(things.noun, quantity=things.quantity)


def _goal(text: str, question: Question, things: Things, *, any_of: bool) -> Goal:
    if isinstance(things.noun, Robot):
        raise QueryError("the robot is no goal of its own", where=text, cure=EXAMPLE)
    number = things.number or 1
    each = things.quantity in _ALL_OF
    return Goal(text, question, each, any_of or number > 1 or things.quantity == "any", number)
