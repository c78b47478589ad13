"""Builds the English lexicon that SuperMap ships: `supermap_cli/language/lexicons/en.tsv`.

    python tools/build_lexicon.py --wordnet /usr/share/wordnet

From WordNet 3.0 (the files `data.noun`, `index.*`, `cntlist.rev`; Debian's package `wordnet-base`) it takes the nouns
of things (artifacts, food, animals, plants), each in the one sense in which people ask a map for it. The class
names of detectors (`tools/vocabularies/*.txt`) are added. `wordfreq` (PyPI) leaves out words that hardly anybody uses.

A line of the result: name, category and whether it is common, its other names, its classes, and its kinds; see
`supermap_cli.language.lexicon`.
"""

from __future__ import annotations

import argparse
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from wordfreq import zipf_frequency

from supermap_cli.language.inflection import normalise, singulars

ROOT = Path(__file__).resolve().parents[1]
VOCABULARIES = ROOT / "tools" / "vocabularies"
RESULT = ROOT / "supermap_cli" / "language" / "lexicons" / "en.tsv"

CATEGORIES = {5: "a", 6: "t", 8: "r", 13: "f", 17: "t", 18: "h", 20: "p"}
"""The lexicographer files of concrete nouns (lexnames(5WN): noun.animal, artifact, body, food, object, person, plant)
and the category of a name in them: animal, thing, part, food, person, plant.
"""

SUBTREES = {
    "l": ("structure.n.01", "way.n.06", "facility.n.01", "excavation.n.03", "opening.n.10", "geological_formation.n.01",
          "land.n.04", "body_of_water.n.01", "celestial_body.n.01"),
    "r": ("part.n.02", "part.n.03", "body_part.n.01", "plant_part.n.01", "fastener.n.02", "surface.n.01"),
    "m": ("substance.n.07", "substance.n.04", "fabric.n.01"),
}  # fmt: skip
"""Categories that whole branches of WordNet get: places, parts of things, materials."""

LEFT_OUT = ("microorganism.n.01", "drug.n.01", "genus.n.02", "family.n.06")
"""Branches that nobody asks a map for."""

BY_HAND = tomllib.loads((ROOT / "tools" / "lexicon.toml").read_text(encoding="utf-8"))
NEVER_NOUNS = frozenset(BY_HAND["vague"]) | frozenset(BY_HAND["closed_class"])

RARE_ZIPF = 2.0
"""Words below this frequency (log10 per 10^9 words; Zipf scale of van Heuven et al. 2014) are left out unless a
detector names them: 1 in 10^7 words, where regional and historical names begin. Chosen by reading the lists on both
sides.
"""
COMMON_ZIPF = 3.0
"""From this frequency on (1 in 10^6 words) a word counts as common. Chosen alike."""


@dataclass(frozen=True)
class Synset:
    """A set of WordNet: its key, the category of its branch, its lemmas as written, its hypernyms."""

    offset: str
    file: int
    lemmas: tuple[str, ...]
    hypernyms: tuple[str, ...]
    instance: bool


@dataclass
class WordNet:
    """The nouns of WordNet."""

    synsets: dict[str, Synset]
    senses: dict[str, tuple[str, ...]]
    uses: Mapping[tuple[str, str], int]
    _categories: dict[str, str] = field(default_factory=dict)

    def synset(self, name: str) -> str:
        """The offset of a synset that is written as "chair.n.01"."""
        lemma, _, number = name.rsplit(".", 2)
        return self.senses[lemma][int(number) - 1]

    def ancestors(self, offset: str) -> frozenset[str]:
        """The synset and all its hypernyms."""
        found: set[str] = set()
        open_ = [offset]
        while open_:
            found.add(current := open_.pop())
            open_ += [up for up in self.synsets[current].hypernyms if up not in found]
        return frozenset(found)


def read_wordnet(folder: Path) -> WordNet:
    """The nouns, their senses by frequency, and how often each part of speech of a word was met in tagged text."""
    synsets: dict[str, Synset] = {}
    for line in (folder / "data.noun").read_text(encoding="utf-8").splitlines():
        if line.startswith(" "):
            continue
        fields = line.partition("|")[0].split()
        count = int(fields[3], 16)
        lemmas = tuple(fields[4 + 2 * index] for index in range(count))
        pointers = fields[5 + 2 * count :]
        ups = [(pointers[at], pointers[at + 1]) for at in range(0, len(pointers) - 3, 4) if pointers[at] in {"@", "@i"}]
        synsets[fields[0]] = Synset(
            fields[0], int(fields[1]), lemmas, tuple(up for _, up in ups), any(kind == "@i" for kind, _ in ups)
        )
    senses: dict[str, tuple[str, ...]] = {}
    for line in (folder / "index.noun").read_text(encoding="utf-8").splitlines():
        if not line.startswith(" "):
            fields = line.split()
            senses[fields[0]] = tuple(fields[6 + int(fields[3]) :])
    return WordNet(synsets, senses, read_uses(folder))


def read_uses(folder: Path) -> dict[tuple[str, str], int]:
    """(lemma, "n" or "-") -> how often it was tagged as a noun, or as another part of speech; (lemma, number of the
    noun's sense) -> how often in that sense (cntlist.rev).
    """
    uses: dict[tuple[str, str], int] = defaultdict(int)
    for line in (folder / "cntlist.rev").read_text(encoding="utf-8").splitlines():
        key, number, count = line.split()
        lemma, _, rest = key.partition("%")
        uses[lemma, "n" if rest.startswith("1:") else "-"] += int(count)
        if rest.startswith("1:"):
            uses[lemma, number] += int(count)
    return uses


def read_vocabularies(folder: Path) -> tuple[frozenset[str], list[list[str]]]:
    """All names of the detectors' classes, and the groups of names that LVIS gives to one class."""
    names: set[str] = set()
    groups: list[list[str]] = []
    for path in sorted(folder.glob("*.txt")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("#") or not line.strip():
                continue
            group = [normalise(name) for name in line.split(";") if name.strip()]
            if path.stem in WRITTEN_IN_PLURAL:
                group = [singular(name) for name in group]
            names.update(group)
            if path.stem == "lvis" and len(group) > 1:
                groups.append(group)
    return frozenset(names), groups


WRITTEN_IN_PLURAL = {"objects365", "open_images"}
"""Vocabularies that write some of their names in the plural."""


def singular(name: str) -> str:
    """A class in the singular: Objects365 and Open Images write some in the plural."""
    words = name.split()
    last = words[-1] if words else ""
    if last in BY_HAND["plural_only"] or len(last) < 4 or last.endswith(("ss", "us", "is")) or not last.endswith("s"):
        return name
    for ending, other in (("ches", "ch"), ("shes", "sh"), ("sses", "ss"), ("xes", "x"), ("ies", "y"), ("oes", "o")):
        if last.endswith(ending) and last not in {"cookies", "movies", "shoes"}:
            return " ".join([*words[:-1], last.removesuffix(ending) + other])
    return " ".join([*words[:-1], last[:-1]])


@dataclass
class Entry:
    """A name of the lexicon."""

    name: str
    category: str
    common: bool
    synset: str | None
    synonyms: set[str] = field(default_factory=set)
    parents: tuple[str, ...] = ()


class Builder:
    """Chooses the names, their sense and their neighbours."""

    def __init__(self, wordnet: WordNet, vocabulary: frozenset[str], groups: list[list[str]]) -> None:
        self.wordnet = wordnet
        self.vocabulary = vocabulary
        self.groups = groups
        self.subtrees = {wordnet.synset(name): letter for letter, names in SUBTREES.items() for name in names}
        self.left_out = frozenset(map(wordnet.synset, LEFT_OUT))
        self.entries: dict[str, Entry] = {}

    def build(self) -> dict[str, Entry]:
        """All entries by name."""
        for lemma in self.wordnet.senses:
            if (entry := self.from_wordnet(lemma)) is not None:
                self.entries[entry.name] = entry
        for name in sorted(self.vocabulary - self.entries.keys()):
            if name.replace(" ", "_") not in NEVER_NOUNS and not name.startswith("human "):
                self.entries[name] = Entry(name, self.category_by_head(name), common=True, synset=None)
        self.link()
        return self.entries

    def from_wordnet(self, lemma: str) -> Entry | None:
        """A noun of WordNet in the sense that is meant by it, if it names a thing that people speak of."""
        name = name_of(lemma)
        if lemma in NEVER_NOUNS or not plain(name) or len(name) < 2:
            return None
        detected = name in self.vocabulary
        rank = self.sense(lemma, detected=detected)
        if rank is None or not (detected or self.is_used(lemma, name, rank)):
            return None
        offset = self.wordnet.senses[lemma][rank - 1]
        ancestors = self.wordnet.ancestors(offset)
        category = CATEGORIES[self.wordnet.synsets[offset].file]
        if not detected:
            if ancestors & self.left_out or (category in "ap" and not self.is_named_by_head(name, ancestors)):
                return None
            if category in "tr":
                branches = {self.subtrees[up] for up in ancestors if up in self.subtrees}
                category = next((letter for letter in "mrl" if letter in branches), category)
        common = detected or zipf(name) >= COMMON_ZIPF
        return Entry(name, category, common, offset)

    def is_named_by_head(self, name: str, ancestors: frozenset[str]) -> bool:
        """Whether a name of several words ends in that of its kind ("polar bear"); a single word always is."""
        head = name.rpartition(" ")[2]
        return head == name or any(head in self.wordnet.synsets[up].lemmas for up in ancestors)

    def sense(self, lemma: str, *, detected: bool) -> int | None:
        """The number of the sense: the first of a thing; of persons and parts of the body only where no other is, and
        only as the first of all. A word that no detector says must mostly mean that thing.
        """
        senses = self.wordnet.senses[lemma]
        candidates = [
            (number, CATEGORIES[synset.file])
            for number, synset in enumerate(map(self.wordnet.synsets.__getitem__, senses), start=1)
            if synset.file in CATEGORIES and not synset.instance and self.is_common_noun(synset, lemma)
        ]
        things = [(number, category) for number, category in candidates if category not in "hr"]
        if detected and things:
            by_hand: int | None = BY_HAND["senses"].get(lemma, preferred(things))
            return by_hand or None
        if not candidates or (candidates[0][1] == "h" and not detected):
            return None
        number, category = candidates[0]
        return number if number == 1 or (number == 2 and category != "r" and self.is_second(lemma)) else None

    def is_second(self, lemma: str) -> bool:
        """Whether the second sense is met at least a third as often as the first."""
        uses = self.wordnet.uses
        return 0 < uses.get((lemma, "1"), 0) <= 3 * uses.get((lemma, "2"), 0)

    def is_common_noun(self, synset: Synset, lemma: str) -> bool:
        """Whether the word is written in small letters there, or is an abbreviation ("TV", "SUV")."""
        written = [other for other in synset.lemmas if other.lower() == lemma]
        return any(other == other.lower() or (other.isupper() and len(other) > 1) for other in written)

    def is_used(self, lemma: str, name: str, rank: int) -> bool:
        """Whether people use it, as a noun; parts of the body need more than things."""
        file = self.wordnet.synsets[self.wordnet.senses[lemma][rank - 1]].file
        least = COMMON_ZIPF if CATEGORIES[file] == "r" else RARE_ZIPF
        uses = self.wordnet.uses
        as_noun, otherwise = uses.get((lemma, "n"), 0), uses.get((lemma, "-"), 0)
        return as_noun >= otherwise and min(zipf(word) for word in [name, *name.split()]) >= least

    def category_by_head(self, name: str) -> str:
        """The category of "coffee kettle" is that of "kettle"."""
        head = self.entries.get(name.rpartition(" ")[2])
        return head.category if head is not None and head.category not in "lrm" else "t"

    def link(self) -> None:
        """Synonyms are names whose chosen sense is the same; kinds are those of the nearest hypernym with a name."""
        by_synset: dict[str, list[str]] = defaultdict(list)
        for entry in self.entries.values():
            if entry.synset is not None:
                by_synset[entry.synset].append(entry.name)
        for names in by_synset.values():
            self.join(names)
        for group in self.groups:
            known = [name for name in group if name in self.entries]
            synsets = {self.entries[name].synset for name in known} - {None}
            if len(synsets) <= 1 and sum(name in other for other in self.groups for name in group) == len(group):
                self.join(known)
        for entry in self.entries.values():
            if entry.synset is not None:
                entry.parents = self.parents(entry.synset, by_synset)
            elif (head := entry.name.rpartition(" ")[2]) in self.entries and head != entry.name:
                entry.parents = (head,)

    def join(self, names: Iterable[str]) -> None:
        """Make names synonyms of one another."""
        names = set(names)
        for name in names:
            self.entries[name].synonyms |= names - {name}

    def parents(self, offset: str, by_synset: Mapping[str, list[str]]) -> tuple[str, ...]:
        """The first name of each nearest hypernym that has one."""
        found: list[str] = []
        for up in self.wordnet.synsets[offset].hypernyms:
            written = [name_of(lemma) for lemma in self.wordnet.synsets[up].lemmas]
            named = next((name for name in written if name in by_synset.get(up, ())), None)
            found += [named] if named else self.parents(up, by_synset)
        return tuple(dict.fromkeys(found))


def preferred(things: list[tuple[int, str]]) -> int:
    """The first sense of several; fruit before its tree, an animal before its meat."""
    number, category = things[0]
    better = {"p": "f", "f": "a"}.get(category)
    return next((other for other, kind in things if kind == better), number)


def name_of(lemma: str) -> str:
    """A lemma of WordNet as the lexicon writes it."""
    return normalise(lemma.replace("_", " "))


def plain(name: str) -> bool:
    """Letters and spaces only."""
    return name.isascii() and name.replace(" ", "").isalpha()


def irregular_plurals(folder: Path, entries: Mapping[str, Entry]) -> Iterable[str]:
    """A line for each plural that no rule of `supermap_cli.language.inflection` gives back."""
    for line in (folder / "noun.exc").read_text(encoding="utf-8").splitlines():
        plural, single = (name_of(word) for word in line.split()[:2])
        if single in entries and plural not in entries and single not in singulars(plural) and plain(plural):
            yield f"{plural}\t=\t{single}"


@cache
def zipf(text: str) -> float:
    """The frequency of a word in English, as log10 per 10^9 words."""
    return float(zipf_frequency(text, "en"))


def line_of(entry: Entry, kinds: Mapping[str, list[str]]) -> str:
    """The line of the file for an entry; `kinds` are the names that are said to be kinds of a name."""
    mark = entry.category.upper() if entry.common else entry.category
    lists = [sorted(entry.synonyms), entry.parents, sorted(kinds.get(entry.name, ()))]
    return "\t".join([entry.name, mark, *map(";".join, lists)]).rstrip("\t")


def main() -> None:
    """Reads, builds, writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wordnet", type=Path, required=True, help="folder with WordNet 3.0's data.noun")
    parser.add_argument("--out", type=Path, default=RESULT, help="the file to write")
    arguments = parser.parse_args()
    entries = Builder(read_wordnet(arguments.wordnet), *read_vocabularies(VOCABULARIES)).build()
    kinds: dict[str, list[str]] = defaultdict(list)
    for entry in entries.values():
        for parent in entry.parents:
            kinds[parent].append(entry.name)
    lines = [*(line_of(entry, kinds) for entry in entries.values()), *irregular_plurals(arguments.wordnet, entries)]
    arguments.out.write_text("\n".join(["", *sorted(set(lines)), ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
