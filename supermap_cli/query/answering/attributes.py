"""Whether things have the attributes of a question: yes, no, or unsure where the map cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Literal

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.language.questions import Attribute, Colour, MadeOf, Noun, Size
from supermap_cli.query.answering.asking import Asking
from supermap_cli.query.answering.colours import ColourReading, read_colour
from supermap_cli.query.answering.nouns import noun_text
from supermap_cli.query.candidates import CandidateSource, InstanceCandidate, label_in_state

Verdict = Literal["yes", "no", "unsure"]

MATERIAL_LABELS = {
    "cardboard": ("cardboard", "carton"),
    "glass": ("glass",),
    "leather": ("leather",),
    "metal": ("metal", "steel", "iron", "metallic"),
    "paper": ("paper",),
    "plastic": ("plastic",),
    "wood": ("wood", "wooden", "woody"),
}
"""Words of a label that say a material."""

SAME_SIZE = 0.05
"""Share by which a size must differ from the median to be called large or small. Chosen: the error of sides built of
voxels of 2 cm.
"""


@dataclass(frozen=True)
class AttributeReading:
    """A verdict, and what it rests on."""

    verdict: Verdict
    reason: str


@dataclass
class AttributeReader:
    """Reads attributes of candidates; colours are read from the map once per instance."""

    asking: Asking
    _colours: dict[int, ColourReading] = field(default_factory=dict)

    def readings(
        self, candidates: Sequence[InstanceCandidate], attribute: Attribute, noun: Noun, everything: CandidateSource
    ) -> list[AttributeReading]:
        """A reading for each candidate. `everything` is what the noun names, whose median sizes are measured by."""
        match attribute:
            case Colour(name):
                colours = self.colours(candidates)
                return [_colour_reading(colours[candidate.instance.number], name) for candidate in candidates]
            case Size(word):
                sizes = self._sizes(everything, word)
                return [_size_reading(candidate.state.box, word, sizes, noun) for candidate in candidates]
            case MadeOf(name):
                return [_material_reading(label_in_state(each.instance, each.state), name) for each in candidates]

    def colours(self, candidates: Sequence[InstanceCandidate]) -> dict[int, ColourReading]:
        """The colours of candidates by instance number: those of their newest geometry."""
        missing = {each.instance.number for each in candidates} - self._colours.keys()
        clouds = self.asking.reader.voxels_of(missing)
        self._colours |= {number: read_colour(cloud) for number, cloud in clouds.items()}
        return {each.instance.number: self._colours[each.instance.number] for each in candidates}

    def _sizes(self, everything: CandidateSource, word: str) -> list[float]:
        newest: dict[int, InstanceCandidate] = {}
        for batch in everything.batches():
            newest |= {candidate.instance.number: candidate for candidate in batch}
        return [size_of(candidate.state.box, word) for candidate in newest.values()]


def size_of(box: Box3D, word: str) -> float:
    """What a size word speaks of: the height, the longer horizontal side (metres), or the volume (cubic metres)."""
    if word in {"tall", "low", "height"}:
        return float(box.size[2])
    if word in {"wide", "narrow", "width"}:
        return float(box.size[:2].max())
    return box.volume


def size_unit(word: str) -> str:
    """The unit of `size_of`."""
    return "m" if word in {"tall", "low", "wide", "narrow", "height", "width"} else "m3"


def _colour_reading(colour: ColourReading, name: str) -> AttributeReading:
    if colour.name == name:
        return AttributeReading("yes", colour.words)
    return AttributeReading("unsure" if colour.may_be(name) else "no", colour.words)


def _size_reading(box: Box3D, word: str, sizes: list[float], noun: Noun) -> AttributeReading:
    name = noun_text(noun)
    if len(sizes) < 2:
        return AttributeReading("unsure", f"the map has no other {name} to compare it with")
    middle, size = median(sizes), size_of(box, word)
    reason = f"{size:.2f} {size_unit(word)}, the median {name} {middle:.2f} {size_unit(word)}"
    if abs(size - middle) <= SAME_SIZE * middle:
        return AttributeReading("unsure" if len(set(sizes)) > 1 else "no", reason)
    larger = word in {"big", "tall", "wide"}
    return AttributeReading("yes" if (size > middle) == larger else "no", reason)


def _material_reading(label: str, name: str) -> AttributeReading:
    """A label may say a material; where it says none, nobody knows."""
    words = set(label.casefold().replace("-", " ").split())
    said = [material for material, forms in MATERIAL_LABELS.items() if words & set(forms)]
    if name in said or name in words:
        return AttributeReading("yes", f"called '{label}'")
    if said:
        return AttributeReading("no", f"called '{label}'")
    return AttributeReading("unsure", "the map holds no materials, and its label says none")
