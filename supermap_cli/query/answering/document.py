"""The answer to a question, as the published JSON Schema has it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from supermap_cli.query.answering.asking import Decision
from supermap_cli.query.presence_at import PresenceValue
from supermap_cli.query.views import BoxView, InstanceView, Vector
from supermap_cli.types.memory import Presence

if TYPE_CHECKING:  # what compares visits is imported where changes are asked for
    from supermap_cli.query.answering.happenings import Change

Intent = Literal[
    "find", "count", "exists", "holds", "most of", "compare", "distance", "describe", "when", "changes", "moved where"
]
Truth = Literal["yes", "no", "unknown"]


@dataclass(frozen=True)
class NearMiss:
    """An instance that almost matches, and the reason why it does not."""

    id: str
    label: str
    presence: Presence | PresenceValue
    position: Vector
    box: BoxView
    reason: str
    distance_m: float | None


@dataclass(frozen=True)
class AskedRelation:
    """The relation of a question and the reference instances; `more` if there are more than listed."""

    name: str
    reference: str
    references: tuple[str, ...]
    more: bool = False


@dataclass(frozen=True)
class Measurement:
    """What was measured of an instance, or between it and another (`other`): the value with its unit, which is "m",
    "m3", "ns" (a time), "s", or "1" (a number or a share).
    """

    id: str
    what: str
    value: float
    unit: str
    other: str | None = None


@dataclass(frozen=True)
class Explanation:
    """How an answer came about: the question as it was understood, in words, as a tree, and each candidate's fate."""

    understood: str
    tree: str
    candidates: tuple[Decision, ...]


@dataclass(frozen=True)
class Answer:
    """An answer, which may be empty; `message` is its sentence.

    `more` is the number of matches that are not listed in `instances` (the most recently seen are listed), or `None`
    where they were not counted. `count` is set for "how many" only, and `count_at_most` where some may or may not
    count. `verdict` answers a question of yes or no. `readings` are further readings of the question, which were not
    taken.
    """

    query: str
    intent: Intent
    time: str
    message: str
    notes: tuple[str, ...]
    instances: tuple[InstanceView, ...]
    relation: AskedRelation | None
    nearest: tuple[NearMiss, ...]
    more: int | None = 0
    count: int | None = field(default=None, metadata={"optional": True})
    count_at_most: int | None = field(default=None, metadata={"optional": True})
    verdict: Truth | None = field(default=None, metadata={"optional": True})
    measures: tuple[Measurement, ...] | None = field(default=None, metadata={"optional": True})
    changes: tuple[Change, ...] | None = field(default=None, metadata={"optional": True})
    readings: tuple[str, ...] | None = field(default=None, metadata={"optional": True})
    explanation: Explanation | None = field(default=None, metadata={"optional": True})


@dataclass(frozen=True)
class Reply:
    """What a module for one kind of question gives; the rest of the answer is the same for all."""

    intent: Intent
    message: str
    instances: tuple[InstanceView, ...] = ()
    nearest: tuple[NearMiss, ...] = ()
    relation: AskedRelation | None = None
    more: int | None = 0
    count: int | None = None
    count_at_most: int | None = None
    verdict: Truth | None = None
    measures: tuple[Measurement, ...] = ()
    changes: tuple[Change, ...] = ()
