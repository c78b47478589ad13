"""Which labels of a map a phrase means: plurals, synonyms, kinds, and at last the head noun alone."""

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
        """The singular of an English noun; a word that is none already stays as it is."""
        if word in self.irregular:
            return self.irregular[word]
        if len(word) <= 3 or word.endswith(("ss", "us", "is")):
            return word
        for ending, replacement in _PLURALS:
            if word.endswith(ending):
                return word[: len(word) - len(ending)] + replacement
        return word

    def forms_of(self, names: Iterable[str]) -> frozenset[str]:
        """Names as they may be written: as they are, and in plurals that no rule makes."""
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
    """The labels that a phrase means, and what had to be left out or taken loosely (`note`) to find them."""

    labels: frozenset[str]
    note: str | None = None


@cache
def load_vocabulary() -> Vocabulary:
    """The synonym table that comes with the program."""
    table = tomllib.loads((files("supermap_cli.query") / "synonyms.toml").read_text(encoding="utf-8"))
    synonyms = {name: frozenset(group) for group in table["same"] for name in group}
    lists = {part: {name: tuple(names) for name, names in table[part].items()} for part in ("kinds", "similar")}
    return Vocabulary(synonyms, lists["kinds"], lists["similar"], table["irregular"])


def match_labels(phrase: str, labels: Collection[str]) -> LabelMatch:
    """The labels among those of a map that a phrase means; none, if nothing fits.

    First the phrase itself with its synonyms and kinds; then what a coarse detector may have called it; then the same
    without the words before its head noun ("red chair": chair).
    """
    vocabulary = load_vocabulary()
    known = {label: vocabulary.normalise(label) for label in labels}
    normalised = vocabulary.normalise(phrase.split(" of ", maxsplit=1)[0])
    words = normalised.split()
    for start in range(len(words)):
        name = " ".join(words[start:])
        left_out = " ".join(words[:start])
        note = f"'{left_out}' is not understood and was left out" if left_out else None
        if found := _matching_labels(name, known, vocabulary):
            return LabelMatch(found, note)
        if found := _similar_labels(name, known, vocabulary):
            taken = ", ".join(f"'{label}'" for label in sorted(found))
            return LabelMatch(found, "; ".join(filter(None, [note, f"'{name}' was taken as {taken}"])))
    return LabelMatch(frozenset())


def _matching_labels(name: str, known: Mapping[str, str], vocabulary: Vocabulary) -> frozenset[str]:
    names = vocabulary.names_of(name)
    wanted = set(names)
    for synonym in names:
        for kind in vocabulary.kinds.get(synonym, ()):
            wanted |= vocabulary.names_of(kind)
    return frozenset(label for label, normal in known.items() if normal in wanted or _has_head_noun(normal, names))


def _similar_labels(name: str, known: Mapping[str, str], vocabulary: Vocabulary) -> frozenset[str]:
    wanted: set[str] = set()
    for synonym in vocabulary.names_of(name):
        for other in vocabulary.similar.get(synonym, ()):
            wanted |= vocabulary.names_of(other)
    return frozenset(label for label, normal in known.items() if normal in wanted)


def _has_head_noun(normal: str, names: Iterable[str]) -> bool:
    return any(normal.endswith(f" {name}") for name in names if " " not in name)
