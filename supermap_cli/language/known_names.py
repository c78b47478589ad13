"""The names that a question may use besides the words of its language: labels, traversals, relations of a map."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class KnownNames:
    """Names of a map. `labels` and `traversals` are written as the map has them; `relations` maps a language to the
    phrases of its relations and the relations' names in the registry. Instances are recognised by their form.
    """

    labels: Collection[str] = ()
    traversals: Sequence[str] = ()
    relations: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
