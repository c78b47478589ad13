"""The sentence of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from supermap_cli.query.grammar import NounPhrase, Question
from supermap_cli.query.views import InstanceView
from supermap_cli.query.vocabulary import load_vocabulary


class NearMissLike(Protocol):
    """The part of a near miss that is printed."""

    @property
    def id(self) -> str:
        """The text id."""
        ...

    @property
    def reason(self) -> str:
        """Why it does not match."""
        ...


class MatchCountLike(Protocol):
    """Numbers of matches."""

    @property
    def more(self) -> int | None:
        """Matches that are not listed; `None` where they were not counted."""
        ...

    @property
    def certain(self) -> int:
        """Matches that are known to have been present."""
        ...


def match_sentence(
    question: Question, instances: Sequence[InstanceView], counted: MatchCountLike, when: str | None = None
) -> str:
    """The sentence for a question with matches; `when` is the time, if the question does not name it."""
    certain = ", ".join(instance.id for instance in instances if instance.presence != "unknown")
    uncertain = ", ".join(instance.id for instance in instances if instance.presence == "unknown")
    ids = (
        "; perhaps ".join(ids_text for ids_text in (certain, uncertain) if ids_text)
        if certain
        else f"perhaps {uncertain}"
    )
    if counted.more != 0:
        ids += " and more" if counted.more is None else f" and {counted.more} more"
    basis = _basis_text(instances)
    match question.intent:
        case "count":
            return f"{counted.certain} ({ids}){basis}"
        case "exists":
            return f"{'yes: ' if certain else ''}{ids}{basis}"
        case "find":
            return f"{describe_phrase(question.phrase)}{_time_text(question, when)}: {ids}{basis}"


def no_match_sentence(
    question: Question, nearest: Sequence[NearMissLike], missing: str | None, when: str | None = None
) -> str:
    """The sentence for a question without matches. `missing` is a noun that no label in the map matches; `when` is the
    time, if the question does not name it.
    """
    lead = "0: " if question.intent == "count" else "no: " if question.intent == "exists" else ""
    if missing is not None:
        sentence = f"there {'are' if _is_plural(missing) else 'is'} no {missing} in the map"
    else:
        nothing_or_no = "nothing" if question.phrase.noun is None else "no"
        sentence = f"{nothing_or_no} {describe_phrase(question.phrase, '')}".rstrip() + _time_text(question, when)
    reasons = "; ".join(f"{near_miss.id}: {near_miss.reason}" for near_miss in nearest)
    return f"{lead}{sentence} ({reasons})" if reasons else f"{lead}{sentence}"


def describe_phrase(phrase: NounPhrase, anything: str = "everything") -> str:
    """A noun phrase in plain words; `anything` replaces a missing noun."""
    noun = phrase.noun or anything
    if phrase.relation is None:
        return noun
    return f"{noun} {phrase.relation.name} {describe_phrase(phrase.relation.reference)}".lstrip()


def _is_plural(noun: str) -> bool:
    head = noun.split(" of ", maxsplit=1)[0].rsplit(maxsplit=1)[-1]
    return load_vocabulary().singular(head) != head


def _time_text(question: Question, when: str | None) -> str:
    if when is not None:
        return f" {when}"
    match question.time.kind:
        case "now":
            return " now"
        case "traversal":
            return f" in {question.time.argument}"
        case "at":
            return f" at {question.time.argument}"
        case kind:
            return f" {kind}"


def _basis_text(instances: Sequence[InstanceView]) -> str:
    bases = {relation.basis for instance in instances for relation in instance.relations}
    return " (judged by their boxes; no such relation is stored)" if bases == {"boxes"} else ""
