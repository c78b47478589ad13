"""Matches a phrase to the labels of a map: plurals, synonyms, hyponyms, and finally the head noun alone."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class Vocabulary:
    """The synonym table (`synonyms.toml`)."""

    synonyms: Mapping[str, frozenset[str]]
    kinds: Mapping[str, tuple[str, ...]]
    similar: Mapping[str, tuple[str, ...]]
    irregular: Mapping[str, str]

    def normalise(self, phrase: str) -> str:
        """Lower case, single spaces, the last word in the singular."""
        words = re.findall(r"[^\W_]+", phrase.casefold())
        return " ".join([*words[:-1], self.singular(words[-1])]) if words else ""

    def singular(self, word: str) -> str:
        """The singular of an English noun; a singular stays as it is."""
        if word in self.irregular:
            return self.irregular[word]
        if len(word) <= 3 or word.endswith(("ss", "us", "is")):
            return word
        for ending, replacement in _PLURALS:
            if word.endswith(ending):
                return word[: len(word) - len(ending)] + replacement
        return word

    def forms_of(self, names: Iterable[str]) -> frozenset[str]:
        """The names and their irregular plurals."""
        irregular = {(singular, plural) for plural, singular in self.irregular.items()}
        forms = set(names)
        for name in names:
            words = name.split()
            forms |= {" ".join([*words[:-1], plural]) for singular, plural in irregular if words[-1:] == [singular]}
        return frozenset(forms)

    def names_of(self, name: str) -> frozenset[str]:
        """A normalised name with all its synonyms."""
        return self.synonyms.get(name, frozenset((name,)))


_PLURALS = (
    ("sses", "ss"),
    ("ches", "ch"),
    ("shes", "sh"),
    ("xes", "x"),
    ("zzes", "zz"),
    ("oes", "o"),
    ("ies", "y"),
    ("s", ""),
)


@dataclass(frozen=True)
class LabelMatch:
    """The labels that match a phrase, and a note on words that were ignored or matched loosely."""

    labels: frozenset[str]
    note: str | None = None


@cache
def load_vocabulary() -> Vocabulary:
    """The synonym table shipped with the package."""
    table = tomllib.loads((files("supermap_cli.query") / "synonyms.toml").read_text(encoding="utf-8"))
    synonyms = {name: frozenset(group) for group in table["same"] for name in group}
    lists = {
        section: {name: tuple(names) for name, names in table[section].items()} for section in ("kinds", "similar")
    }
    return Vocabulary(synonyms, lists["kinds"], lists["similar"], table["irregular"])


def match_labels(phrase: str, labels: Collection[str]) -> LabelMatch:
    """The labels of a map that match a phrase; empty if none does.

    Tried in order: the phrase with its synonyms and kinds; labels that a coarse detector may use for it; the same
    without the words before its head noun ("red chair": chair).
    """
    vocabulary = load_vocabulary()
    normalised_labels = {label: vocabulary.normalise(label) for label in labels}
    normalised = vocabulary.normalise(phrase.split(" of ", maxsplit=1)[0])
    words = normalised.split()
    for start in range(len(words)):
        name = " ".join(words[start:])
        left_out = " ".join(words[:start])
        note = f"'{left_out}' is not understood and was left out" if left_out else None
        if matching := _matching_labels(name, normalised_labels, vocabulary):
            return LabelMatch(matching, note)
        if matching := _similar_labels(name, normalised_labels, vocabulary):
            taken = ", ".join(f"'{label}'" for label in sorted(matching))
            return LabelMatch(matching, "; ".join(filter(None, [note, f"'{name}' was taken as {taken}"])))
    return LabelMatch(frozenset())


def _matching_labels(name: str, normalised_labels: Mapping[str, str], vocabulary: Vocabulary) -> frozenset[str]:
    names = vocabulary.names_of(name)
    wanted = set(names)
    for synonym in names:
        for kind in vocabulary.kinds.get(synonym, ()):
            wanted |= vocabulary.names_of(kind)
    return frozenset(
        label
        for label, normalised_label in normalised_labels.items()
        if normalised_label in wanted or _has_head_noun(normalised_label, names)
    )


def _similar_labels(name: str, normalised_labels: Mapping[str, str], vocabulary: Vocabulary) -> frozenset[str]:
    wanted: set[str] = set()
    for synonym in vocabulary.names_of(name):
        for other in vocabulary.similar.get(synonym, ()):
            wanted |= vocabulary.names_of(other)
    return frozenset(label for label, normalised_label in normalised_labels.items() if normalised_label in wanted)


def _has_head_noun(normalised_label: str, names: Iterable[str]) -> bool:
    return any(normalised_label.endswith(f" {name}") for name in names if " " not in name)
