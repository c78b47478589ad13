"""The names that a question may use besides the words of its language: labels, traversals, relations of a map."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol


class NounMatch(Protocol):
    """A noun found in a question: its English name in the singular, as it was written, and its length in words."""

    @property
    def name(self) -> str:
        """English, singular."""
        ...

    @property
    def written(self) -> str:
        """As it stands in the question."""
        ...

    @property
    def length(self) -> int:
        """Words."""
        ...

    @property
    def hypernym(self) -> bool:
        """Whether kinds of it have names of their own."""
        ...


class Nouns(Protocol):
    """What the parser asks a lexicon for (see `language.lexicon`)."""

    def longest_noun(self, words: Sequence[str], start: int, extra: Collection[str]) -> NounMatch | None:
        """The longest noun in `words` from `start`; `extra` are labels that count as nouns."""
        ...

    def uses(self) -> Mapping[str, object]:
        """The use classes ("sit on"); the values do not matter here."""
        ...

    @property
    def material_words(self) -> Mapping[str, str]:
        """Words for materials, and the materials ("wooden": "wood")."""
        ...

    def suggest(self, word: str, among: Collection[str] | None = None) -> tuple[str, ...]:
        """Known words that a misspelt one may stand for, best first."""
        ...


@dataclass(frozen=True)
class KnownNames:
    """Names of a map. `labels` and `traversals` are written as the map has them; `relations` maps a language to the
    phrases of its relations and the relations' names in the registry. Instances are recognised by their form.
    """

    labels: Collection[str] = ()
    traversals: Sequence[str] = ()
    relations: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
