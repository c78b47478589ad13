"""What words mean: names of things, their synonyms, kinds and uses, and which nouns a map can be asked for.

English has two files: `en.tsv`, from WordNet 3.0 and detectors' vocabularies (made by `tools/build_lexicon.py`), and
`en.toml`, by hand, which wins. They are read when a word is first asked for. A line of `en.tsv`: name, category (a
capital if the word is common), other names, the classes that it is a kind of, and its kinds, separated by tabs; lists
by semicolons. The category "=" gives the singular of an irregular plural instead.
"""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from importlib.resources import files
from typing import Any, Literal

from supermap_cli.language.inflection import normalise, regular_singular, singulars
from supermap_cli.language.spelling import MOST_SUGGESTIONS, close_words

Category = Literal["thing", "food", "animal", "plant", "person", "place", "structure", "part", "material"]

HELD: frozenset[Category] = frozenset({"thing", "food", "animal", "plant", "person"})
"""What a map of things can hold, so that it may be denied. Rooms, walls, parts of things and materials are understood,
but that a map has none says nothing about the place.
"""

_CATEGORIES: Mapping[str, Category] = {
    "t": "thing",
    "f": "food",
    "a": "animal",
    "p": "plant",
    "h": "person",
    "l": "place",
    "r": "part",
    "m": "material",
}

LEAST_JOINED = 3
"""Letters of the second of two words that may have been written for one: shorter ones are prepositions mostly."""
NEVER_JOINED = frozenset({"the", "and", "for", "off", "out", "near", "are", "was", "any", "all", "not", "has", "with"})
LONGEST_NAME = 5
"""Words of the longest name that is looked for ("case of water bottles" has 4)."""


@dataclass(frozen=True)
class NounMatch:
    """A noun found in a question.

    `name` is English, singular, as the lexicon writes it; `written` is what stood in the question, `length` its number
    of words. `hypernym` is set where kinds of it have names of their own.
    """

    name: str
    written: str
    length: int
    hypernym: bool


class Lexicon:
    """English; see `supermap_cli.language.translations` for other languages."""

    def __init__(self, extract: str, table: Mapping[str, Any]) -> None:
        self._extract = extract
        self._table = table
        self._synonyms = {name: frozenset(group) for group in table["same"] for name in group}
        self._irregular: Mapping[str, str] = table["irregular"]
        self._kinds: Mapping[str, list[str]] = table["kinds"]
        self._similar: Mapping[str, list[str]] = table["similar"]

    # --- Names ---

    def longest_noun(self, words: Sequence[str], start: int, extra: Collection[str] = ()) -> NounMatch | None:
        """The longest known noun that begins at `words[start]`; `extra` are names that count as known, as the labels of
        a map do.
        """
        labels = _normalised(frozenset(extra))
        for length in range(min(LONGEST_NAME, len(words) - start), 0, -1):
            written = " ".join(words[start : start + length])
            if "," not in written and (name := self.name_of(written, labels)) is not None:
                return NounMatch(name, written, length, self.has_kinds(name))
        return None

    def name_of(self, written: str, extra: Collection[str] = ()) -> str | None:
        """The name that a noun is written for, in singular or plural, in one word or two; `None` if it is not known.

        `extra` are normalised names that count as known.
        """
        phrase = normalise(written)
        if not phrase:
            return None
        for spelling in _spellings(phrase):
            forms = [form for form in (self.irregular_singular(spelling), *singulars(spelling)) if form is not None]
            known = [form for form in forms if form in extra or self.category(form) is not None]
            if known:  # "clocks" is a plant, too, and more likely some clocks
                things = (form for form in known if form in extra or self.category(form) == "thing")
                return next(things, known[0])
        return None

    def irregular_singular(self, phrase: str) -> str | None:
        """The singular of a phrase whose last word has an irregular plural."""
        before, space, word = phrase.rpartition(" ")
        single = self._irregular.get(word)
        if single is None:
            fields = self._fields(word)
            single = fields[1] if fields and fields[0] == "=" else None
        return before + space + single if single is not None else None

    def normalise(self, label: str) -> str:
        """A label as a name: normalised, in the singular."""
        return self.name_of(label) or regular_singular(normalise(label))

    def category(self, name: str) -> Category | None:
        """What a normalised name in the singular names; `None` if it is no known noun."""
        if name in self._own_categories:
            return self._own_categories[name]
        fields = self._fields(name)
        return _CATEGORIES.get(fields[0][0].lower()) if fields else None

    def knows(self, name: str) -> bool:
        """Whether a name is a noun of something that a map can hold: one that may be denied."""
        return self.category(name) in HELD

    def is_common(self, name: str) -> bool:
        """Whether a name is in everyday use: a rare one that is close to a word of the map is likely a misspelling."""
        if name in self._own_categories:
            return True
        fields = self._fields(name)
        return fields is not None and fields[0][0].isupper()

    # --- Meanings ---

    def synonyms(self, name: str) -> frozenset[str]:
        """Other names of the same thing, without the name itself."""
        return self._group(name) - {name}

    def kinds(self, name: str) -> frozenset[str]:
        """All names of things that are a kind of it ("furniture": "couch", "sofa", "desk", ...), without its own."""
        own = self._group(name)
        found: set[str] = set()
        open_ = [child for other in own for child in self._children(other)]
        while open_:
            kind = open_.pop()
            if kind not in found and kind not in own:
                found.add(kind)
                open_ += [*self._group(kind), *self._children(kind)]
        return frozenset(found)

    def has_kinds(self, name: str) -> bool:
        """Whether kinds of it have names of their own."""
        return any(self._children(other) for other in self._group(name))

    def is_kind_of(self, name: str, other: str) -> bool:
        """Whether `name` is `other`, or a kind of it."""
        return name in self._group(other) or name in self.kinds(other)

    def near_kinds(self, name: str) -> frozenset[str]:
        """What a detector with few words calls it for want of a better one ("stool": "chair"); by hand only."""
        near = {other for own in self._group(name) for other in self._similar.get(own, ())}
        return frozenset(other for entry in near for other in self._group(entry)) - self._group(name)

    def wider_names(self, name: str) -> frozenset[str]:
        """The words for the classes that it belongs to ("rocking chair": "chair", "seat", "furniture"). What is called
        so may be it, or may not.
        """
        found: set[str] = set()
        open_ = list(self._group(name))
        while open_:
            for parent in self._parents(open_.pop()):
                if parent not in found:
                    found.add(parent)
                    open_ += self._group(parent)
        return frozenset(found)

    @cached_property
    def uses(self) -> Mapping[str, frozenset[str]]:
        """Use ("sit on") -> the names of everything that serves it, kinds and synonyms included."""
        named = {use: [name for entry in row["names"] for name in self._group(entry)] for use, row in self._uses}
        return {use: frozenset(names).union(*(self.kinds(name) for name in names)) for use, names in named.items()}

    @cached_property
    def use_phrases(self) -> Mapping[str, str]:
        """What people say for a use ("lie down on") -> the use ("sleep on")."""
        return {phrase: use for use, row in self._uses for phrase in (*row["say"], use)}

    @property
    def material_words(self) -> Mapping[str, str]:
        """Word for a material ("wooden") -> its name ("wood")."""
        materials: Mapping[str, str] = self._table["materials"]
        return materials

    @property
    def colour_words(self) -> Mapping[str, str]:
        """Word for a colour ("crimson") -> the basic colour term that covers it ("red")."""
        colours: Mapping[str, str] = self._table["colours"]
        return colours

    # --- Misspellings ---

    def suggest(self, word: str, among: Collection[str] | None = None) -> tuple[str, ...]:
        """Known words that a word may be a misspelling of, the likeliest first; none for one that is far from all.

        `among` are the names of the map: those that are close enough come before all other words.
        """
        written = normalise(word)
        of_map = _names_of(frozenset(among)) if among is not None else {}
        found = [of_map[form] for form, _ in close_words(written, of_map)]
        found += [name for name, _ in close_words(written, self._common_names) if name not in found]
        return tuple(dict.fromkeys(found))[:MOST_SUGGESTIONS]

    # --- The files ---

    def _fields(self, name: str) -> tuple[str, ...] | None:
        """The fields of a name's line, less the name; at least one."""
        low, high = 1, len(self._extract)
        while low < high:  # its lines are sorted by name; low and high are beginnings of lines
            at = self._extract.rfind("\n", low - 1, (low + high) // 2) + 1
            end = self._extract.index("\n", at)
            found, _, fields = self._extract[at:end].partition("\t")
            if found == name:
                return tuple(fields.split("\t"))
            low, high = (end + 1, high) if found < name else (low, at)
        return None

    @lru_cache(maxsize=4096)  # noqa: B019 - there is one lexicon of a language, for ever
    def _group(self, name: str) -> frozenset[str]:
        """The name and its synonyms: those of the table, and those that the extract adds to them. Two groups of the
        table are never joined.
        """
        own = self._synonyms.get(name)
        if own is None:
            others = self._extracted(name)
            own = next((self._synonyms[other] for other in others if other in self._synonyms), None)
            if own is None:
                return frozenset({name, *others})
        table = self._synonyms.keys() | self._kinds.keys()
        added = {other for member in own for other in self._extracted(member)} - table
        return own | added | {name}

    def _extracted(self, name: str) -> tuple[str, ...]:
        """The synonyms that the extract gives."""
        fields = self._fields(name)
        return tuple(self._listed(name, 1)) if fields and fields[0] != "=" else ()

    def _parents(self, name: str) -> frozenset[str]:
        """The names of the classes that a name is said to belong to."""
        by_hand = self._classes_by_hand.get(name, frozenset())
        extracted = {parent for parent in self._listed(name, 2) if parent not in self._kinds}
        return frozenset(by_hand | {parent for parent in extracted if name not in self._not_kinds(parent)})

    def _children(self, name: str) -> frozenset[str]:
        """The names that are said to be kinds of it: by hand alone where the table has the class."""
        if name in self._kinds:
            return frozenset(self._kinds[name]) - self._not_kinds(name)
        more: list[str] = self._table["more_kinds"].get(name, [])
        return frozenset((*more, *self._listed(name, 3))) - self._not_kinds(name)

    def _not_kinds(self, name: str) -> frozenset[str]:
        return frozenset(self._table["not_kinds"].get(name, ()))

    def _listed(self, name: str, field: int) -> Sequence[str]:
        """A list in a field of a name's line (counted without the name)."""
        fields = self._fields(name)
        return fields[field].split(";") if fields and len(fields) > field and fields[field] else ()

    @cached_property
    def _classes_by_hand(self) -> Mapping[str, frozenset[str]]:
        classes: dict[str, set[str]] = defaultdict(set)
        for section in (self._kinds, self._table["more_kinds"]):
            for parent, names in section.items():
                for name in names:
                    classes[name].add(parent)
        return {
            name: frozenset(parents - {p for p in parents if name in self._not_kinds(p)})
            for name, parents in classes.items()
        }

    @cached_property
    def _own_categories(self) -> Mapping[str, Category]:
        """The names of the table and what they name."""
        own: dict[str, Category] = dict.fromkeys(self._synonyms, "thing")
        for section in (self._kinds, self._table["more_kinds"]):
            own |= dict.fromkeys([*section, *(name for names in section.values() for name in names)], "thing")
        own |= dict.fromkeys([*self._similar], "thing")
        own |= dict.fromkeys(self._synonyms["person"] | {"person", *self._kinds["person"]}, "person")
        own |= dict.fromkeys(self._table["not_held"]["places"], "place")
        return own | dict.fromkeys(self._table["not_held"]["structure"], "structure")

    @cached_property
    def _uses(self) -> tuple[tuple[str, Mapping[str, list[str]]], ...]:
        return tuple(self._table["uses"].items())

    @cached_property
    def _common_names(self) -> tuple[str, ...]:
        """The names that a misspelling may have meant when the map has none that is close."""
        lines = (line.split("\t", 2) for line in self._extract.split("\n") if line)
        return (*self._own_categories, *(fields[0] for fields in lines if fields[1][0].isupper()))


@cache
def load_lexicon(language: str = "en") -> Lexicon:
    """The lexicon of a language (ISO 639-1)."""
    folder = files("supermap_cli.language.lexicons")
    extract = (folder / f"{language}.tsv").read_text(encoding="utf-8")
    return Lexicon(extract, tomllib.loads((folder / f"{language}.toml").read_text(encoding="utf-8")))


def _spellings(phrase: str) -> Iterable[str]:
    """The phrase, and as one word what was written as two ("book shelf": "bookshelf", but not "cart on": "carton")."""
    yield phrase
    first, _, second = phrase.partition(" ")
    if phrase.count(" ") == 1 and len(second) >= LEAST_JOINED and {first, second}.isdisjoint(NEVER_JOINED):
        yield first + second


@lru_cache(maxsize=16)
def _normalised(labels: frozenset[str]) -> frozenset[str]:
    return frozenset(map(normalise, labels))


@lru_cache(maxsize=16)
def _names_of(labels: frozenset[str]) -> dict[str, str]:
    """Written form -> label: misspellings are compared with the label and with its words' plural."""
    forms = {normalise(label): label for label in labels}
    return {**{f"{form}s": label for form, label in forms.items() if not form.endswith("s")}, **forms}
