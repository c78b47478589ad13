"""What the functions of a rule's value share: choosing among the parts of a rule by their type."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from supermap_cli.language.forest import NoReading, Word

T = TypeVar("T")


@dataclass(frozen=True)
class Duration:
    """A length of time in seconds."""

    seconds: float


@dataclass(frozen=True)
class Length:
    """A distance in metres."""

    metres: float


@dataclass(frozen=True)
class Comparative:
    """A word that compares ("bigger"): by which measure."""

    measure: str


def of_type(parts: Sequence[Any], kind: type[T]) -> list[T]:
    """The parts that are of a type."""
    return [part for part in parts if isinstance(part, kind)]


def only(parts: Sequence[Any], kind: type[T]) -> T:
    """The part of a type. Raises `NoReading` unless there is exactly one."""
    found = of_type(parts, kind)
    if len(found) != 1:
        raise NoReading
    return found[0]


def maybe(parts: Sequence[Any], kind: type[T]) -> T | None:
    """The part of a type, if there is one. Raises `NoReading` if there are several."""
    found = of_type(parts, kind)
    if len(found) > 1:
        raise NoReading
    return found[0] if found else None


def words(parts: Sequence[Any], *kinds: str) -> list[Word]:
    """The terminals of some kinds."""
    return [part for part in parts if isinstance(part, Word) and part.kind in kinds]
