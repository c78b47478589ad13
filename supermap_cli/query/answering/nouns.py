"""What a noun of a question stands for in this map: the labels that it names, or one instance."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Protocol

from supermap_cli.language.questions import Anything, Identified, Named, Noun, Robot, Union, Usable
from supermap_cli.types.labels import DYNAMIC_CLASSES

PRONOUNS = frozenset({"anybody", "anyone", "somebody", "someone", "nobody", "everybody", "everyone", "no one"})
"""Words for people that are no names of them."""


class Words(Protocol):
    """The part of the lexicon that answers are found with."""

    def synonyms(self, name: str) -> frozenset[str]:
        """Other names of the same thing."""
        ...

    def kinds(self, name: str) -> frozenset[str]:
        """All names below a hypernym."""
        ...

    def near_kinds(self, name: str) -> frozenset[str]:
        """What a coarse detector may call it."""
        ...

    def wider_names(self, name: str) -> frozenset[str]:
        """The words for the classes that it belongs to."""
        ...

    @property
    def uses(self) -> Mapping[str, frozenset[str]]:
        """The names of things by what they serve for."""
        ...

    def category(self, name: str) -> object | None:
        """What a name names; `None` if it is no known noun."""
        ...

    def knows(self, name: str) -> bool:
        """Whether a name is a noun of something that a map can hold."""
        ...

    def normalise(self, label: str) -> str:
        """A label as a name: in lower case and the singular."""
        ...


@dataclass(frozen=True)
class LabelMatch:
    """The labels that a noun names in a map; `loosely` if nothing is called so, and these are what a detector may have
    called it. `dynamic` is set for people and animals, which move by themselves.
    """

    labels: frozenset[str]
    loosely: bool = False
    dynamic: bool = False


def match_labels(noun: Named | Usable, labels: Collection[str], words: Words) -> LabelMatch:
    """The labels of a map that a noun names; none if there are none.

    Tried in order: its names and their kinds; then what a coarse detector may call it. A label
    that is no known name counts as what its last word names ("laboratory table": a table).
    """
    names = _names(noun, words)
    wanted = names | {kind for name in names for kind in words.kinds(name)}
    plain = {label: _name_of_label(label, words) for label in labels}
    found = frozenset(
        label for label, name in plain.items() if words.normalise(label) in names or _is_one_of(name, wanted, words)
    )
    if found:
        return LabelMatch(found, dynamic=found <= DYNAMIC_CLASSES)
    if isinstance(noun, Usable):
        return LabelMatch(frozenset())
    near = {other for name in names for other in words.near_kinds(name)}
    loosely = frozenset(label for label, name in plain.items() if _is_one_of(name, near, words))
    if not loosely:
        return LabelMatch(frozenset(), dynamic=bool(wanted & DYNAMIC_CLASSES))
    return LabelMatch(loosely, loosely=True)


def wider_note(noun: Noun, labels: Collection[str], words: Words) -> str | None:
    """What is said where a map has none of a noun, but labels that are wider words for it: what is called so may be it,
    since a detector gives the words that it has.
    """
    if not isinstance(noun, Named):
        return None
    wider = words.wider_names(noun.name)
    found = sorted(label for label in labels if _name_of_label(label, words) in wider)
    if not found:
        return None
    told = " or ".join(f"'{label}'" for label in found)
    return f"'{noun.written}' would be a kind of {told}: what is called so in the map may be one"


def noun_text(noun: Noun, anything: str = "thing") -> str:
    """A noun in words, in the singular where it has one."""
    match noun:
        case Anything():
            return anything
        case Named():
            return "person" if noun.name in PRONOUNS else noun.name
        case Identified():
            return noun.id
        case Usable():
            return f"thing to {noun.use}"
        case Robot():
            return "the robot"
        case Union():
            return " or ".join(noun_text(member.noun) for member in noun.members)


def _names(noun: Named | Usable, words: Words) -> frozenset[str]:
    if isinstance(noun, Usable):
        return frozenset(words.uses.get(noun.use, ()))
    return frozenset({noun.name, words.normalise(noun.written)}) | words.synonyms(noun.name)


def _is_one_of(name: str, wanted: Collection[str], words: Words) -> bool:
    return name in wanted or not words.synonyms(name).isdisjoint(wanted)


def _name_of_label(label: str, words: Words) -> str:
    """The name that a label has: its own, or the longest known one that it ends in."""
    whole = words.normalise(label)
    parts = whole.split(" ")
    ends = (" ".join(parts[start:]) for start in range(len(parts)))
    return next((name for name in ends if words.category(name) is not None), whole)
