"""What all parts of one answer share: the map, its clock, the words, the notes, and the trace of `--explain`."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.language.questions import Anything, Identified, Named, Noun, Robot, Union, Usable
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.nouns import LabelMatch, Words, match_labels, noun_text, wider_note
from supermap_cli.query.answering.times import QuestionTimes
from supermap_cli.query.clock import Clock
from supermap_cli.query.map_relations import MapRelations
from supermap_cli.types.labels import DYNAMIC_CLASSES


@dataclass(frozen=True)
class Value:
    """What a measure gives of a thing: the value with its unit, and the other thing where it is a distance."""

    value: float
    unit: str
    other: str | None = None


MAX_TRACED = 200
"""Candidates that an explanation lists."""


@dataclass(frozen=True)
class Decision:
    """Why a candidate was kept or dropped."""

    id: str
    kept: bool
    reason: str


@dataclass
class Trace:
    """The decisions on candidates, the last one of each; the first `MAX_TRACED` candidates."""

    decisions: dict[tuple[str, str], Decision] = field(default_factory=dict)

    def add(self, text_id: str, reason: str, *, kept: bool) -> None:
        """Note a decision; one on the same candidate and reason replaces it."""
        key = text_id, reason
        if key in self.decisions or len(self.decisions) < MAX_TRACED:
            self.decisions[key] = Decision(text_id, kept, reason)


@dataclass
class Asking:
    """One question being answered."""

    reader: MapReader
    clock: Clock
    words: Words
    limit: int
    trace: Trace | None = None
    times: QuestionTimes = field(init=False)
    notes: list[str] = field(default_factory=list)
    measures: dict[str, Value] = field(default_factory=dict)
    loosely: dict[str, frozenset[str]] = field(default_factory=dict)
    _instances: dict[str, StoredInstance | None] = field(default_factory=dict)
    _labels: dict[Noun, LabelMatch] = field(default_factory=dict)

    def note(self, *notes: str | None) -> None:
        """Add notes to the answer."""
        self.notes += [note for note in notes if note]

    def instance(self, text_id: str) -> StoredInstance | None:
        """The believed instance (or person, or animal) with an id; a merged one is its survivor, which a note says."""
        if text_id not in self._instances:
            found = self.reader.instance(text_id)
            if found is not None and found.presence == "doubted" and found.label not in DYNAMIC_CLASSES:
                found = None
            if found is not None and found.id.casefold() != text_id.casefold():
                self.note(f"{text_id} is part of {found.id} today")
            self._instances[text_id] = found
        return self._instances[text_id]

    def labels(self, noun: Noun) -> LabelMatch:
        """The labels that a noun names. Requires a noun that is no id, and not "anything"."""
        assert isinstance(noun, Named | Usable)  # noqa: S101 - callers have told ids and "anything"
        if noun not in self._labels:
            match = match_labels(noun, self._map_labels, self.words)
            if not match.labels and match.dynamic:
                match = match_labels(noun, self._map_labels | self._doubted_labels, self.words)
            if not match.labels:
                self.note(wider_note(noun, self._map_labels, self.words))
            if not match.labels and isinstance(noun, Named) and self._is_no_thing(noun):
                raise RefusedQuestionError(
                    "unknowable",
                    f"'{noun.written}': a map holds things, not the parts, rooms and walls of a place",
                    part=noun.written,
                    cure="ask for things",
                )
            if match.loosely:
                self.loosely[noun_text(noun)] = match.labels
            self._labels[noun] = match
        return self._labels[noun]

    def _is_no_thing(self, noun: Named) -> bool:
        """Whether a noun names what no map holds, so that its absence from one says nothing."""
        return self.words.category(noun.name) is not None and not self.words.knows(noun.name)

    def doubted_labels(self, noun: Noun) -> frozenset[str]:
        """The labels of demoted instances that a noun names."""
        if not isinstance(noun, Named | Usable):
            return frozenset()
        return match_labels(noun, self._doubted_labels, self.words).labels

    def is_known(self, noun: Noun) -> bool:
        """Whether something in the map is, or was, what a noun names."""
        match noun:
            case Anything() | Robot():
                return True
            case Union(members):
                return any(self.is_known(member.noun) for member in members)
            case Identified(text_id):
                return self.instance(text_id) is not None
            case _:
                return bool(self.labels(noun).labels)

    def is_dynamic(self, noun: Noun) -> bool:
        """Whether a noun names what moves by itself."""
        if isinstance(noun, Identified):
            instance = self.instance(noun.id)
            return instance is not None and instance.label in DYNAMIC_CLASSES
        return isinstance(noun, Named | Usable) and self.labels(noun).dynamic

    @cached_property
    def relations(self) -> MapRelations:
        """What relations are judged by in this map."""
        return MapRelations(self.reader)

    @cached_property
    def robot_pose(self) -> FloatArray | None:
        """The robot's last pose, (4, 4) `T_map_base`; `None` without a keyframe."""
        return self.reader.last_pose()

    @property
    def robot_position(self) -> FloatArray | None:
        """Where the robot was last, (3,) metres in the map; `None` without a keyframe."""
        return None if self.robot_pose is None else self.robot_pose[:3, 3]

    @cached_property
    def _map_labels(self) -> frozenset[str]:
        return self.reader.search.labels()

    @cached_property
    def _doubted_labels(self) -> frozenset[str]:
        return self.reader.search.doubted_labels()
