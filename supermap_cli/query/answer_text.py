"""The sentence of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from supermap_cli.query.grammar import Question, Things
from supermap_cli.query.views import InstanceView
from supermap_cli.query.vocabulary import load_vocabulary


class Miss(Protocol):
    """What a near miss tells."""

    @property
    def id(self) -> str:
        """Its text id."""
        ...

    @property
    def reason(self) -> str:
        """Why it does not fit."""
        ...


class All(Protocol):
    """How many fit."""

    @property
    def more(self) -> int | None:
        """Besides those listed; `None` where they were not counted."""
        ...

    @property
    def sure(self) -> int:
        """Of those that surely stood there."""
        ...


def found(question: Question, instances: Sequence[InstanceView], counted: All, when: str | None = None) -> str:
    """The sentence where something fits; `when` is its time, where the question does not say it."""
    sure = ", ".join(instance.id for instance in instances if instance.presence != "unknown")
    unsure = ", ".join(instance.id for instance in instances if instance.presence == "unknown")
    ids = "; perhaps ".join(ids_text for ids_text in (sure, unsure) if ids_text) if sure else f"perhaps {unsure}"
    if counted.more != 0:
        ids += " and more" if counted.more is None else f" and {counted.more} more"
    basis = _basis(instances)
    match question.intent:
        case "count":
            return f"{counted.sure} ({ids}){basis}"
        case "exists":
            return f"{'yes: ' if sure else ''}{ids}{basis}"
        case "find":
            return f"{described(question.things)}{_when(question, when)}: {ids}{basis}"


def nothing(question: Question, nearest: Sequence[Miss], missing: str | None, when: str | None = None) -> str:
    """The sentence where nothing fits; `missing` is the noun that nothing in the map is called, `when` the time, where
    the question does not say it.
    """
    lead = "0: " if question.intent == "count" else "no: " if question.intent == "exists" else ""
    if missing is not None:
        sentence = f"there {'are' if _is_plural(missing) else 'is'} no {missing} in the map"
    else:
        nobody = "nothing" if question.things.noun is None else "no"
        sentence = f"{nobody} {described(question.things, '')}".rstrip() + _when(question, when)
    misses = "; ".join(f"{near_miss.id}: {near_miss.reason}" for near_miss in nearest)
    return f"{lead}{sentence} ({misses})" if misses else f"{lead}{sentence}"


def described(things: Things, anything: str = "everything") -> str:
    """A noun phrase in plain words; `anything` stands where it has no noun."""
    noun = things.noun or anything
    if things.relation is None:
        return noun
    return f"{noun} {things.relation.name} {described(things.relation.reference)}".lstrip()


def _is_plural(noun: str) -> bool:
    head = noun.split(" of ", maxsplit=1)[0].rsplit(maxsplit=1)[-1]
    return load_vocabulary().singular(head) != head


def _when(question: Question, when: str | None) -> str:
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


def _basis(instances: Sequence[InstanceView]) -> str:
    bases = {relation.basis for instance in instances for relation in instance.relations}
    return " (judged by their boxes; no such relation is stored)" if bases == {"boxes"} else ""
