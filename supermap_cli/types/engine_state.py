"""State of an object that only the mapping engine reads, stored to resume the object in the next build.

In an `InstanceRecord` and in the database it is a JSON document (`engine_state`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields
from typing import Any

from supermap_cli.errors import MemoryStoreError

ViewpointCounts = tuple[int, int, float, float, float]


@dataclass(frozen=True)
class EngineState:
    """`label_counts` and `label_weight` are those of the label belief. `viewpoints`: cell of viewing directions ->
    supporting views, all views, the sum of their log likelihood ratios, that of these numbers' magnitudes, and the
    greatest of them. `state_*` is the current state, `gone_ns` the stamp since which there is none; `best_crop` is the
    quality of the best image crop; `seen_apart` says in how many images other objects, by number, were seen beside it
    with masks of their own; `found_by` in how many looks each detector, by its identity, found it, and missed it;
    `words` are the label counts of each detector that is known; `relief` says in how many looks, called by a label,
    it looked flat for one so called, and in how many it stood out. `log_odds_by_views` is the existence by detections
    and misses alone, `None` in databases that know no other.
    """

    label_counts: Mapping[str, float]
    label_weight: float
    viewpoints: Mapping[str, ViewpointCounts]
    state_index: int
    state_first_seen_ns: int
    state_empty_before_ns: int | None
    gone_ns: int | None
    best_crop: float
    seen_apart: Mapping[str, int] = field(default_factory=dict)
    found_by: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    words: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    relief: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    log_odds_by_views: float | None = None

    def to_document(self) -> dict[str, object]:
        """JSON numbers and strings only."""
        lists: dict[str, Mapping[str, Sequence[float]]] = {
            "viewpoints": self.viewpoints,
            "found_by": self.found_by,
            "relief": self.relief,
        }
        documents = {name: {key: list(values) for key, values in entries.items()} for name, entries in lists.items()}
        return asdict(self) | documents

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> EngineState:
        """Read what `to_document` wrote. Raises `MemoryStoreError` for anything else."""
        try:
            document = _with_label_counts(document)
            values = {name: document[name] for name in _REQUIRED}
            values["seen_apart"] = {str(int(number)): int(n) for number, n in document.get("seen_apart", {}).items()}
            values["found_by"] = _pairs(document.get("found_by", {}))
            values["relief"] = _pairs(document.get("relief", {}))
            by_views = document.get("log_odds_by_views")
            values["log_odds_by_views"] = None if by_views is None else float(by_views)
            values["words"] = {
                str(name): {str(label): float(count) for label, count in counts.items()}
                for name, counts in document.get("words", {}).items()
            }
            state = cls(
                **values | {"viewpoints": {name: _cell(stored) for name, stored in values["viewpoints"].items()}}
            )
            if state._is_valid():
                return state
        except (KeyError, TypeError, ValueError, AttributeError):
            pass
        raise MemoryStoreError(
            "the engine state is damaged, it cannot be built on",
            cure="run `supermap db check`, and go back to a sound copy of the database",
        )

    def _is_valid(self) -> bool:
        reals = [*self.label_counts.values(), self.label_weight, self.best_crop, self.log_odds_by_views or 0.0]
        reals += [real for cell in self.viewpoints.values() for real in cell[2:]]
        reals += [looks for both in self.found_by.values() for looks in both]
        reals += [looks for both in self.relief.values() for looks in both]
        reals += [count for counts in self.words.values() for count in counts.values()]
        integers = [self.state_index, self.state_first_seen_ns]
        integers += [stamp_ns for stamp_ns in (self.state_empty_before_ns, self.gone_ns) if stamp_ns is not None]
        return (
            bool(self.label_counts)
            and all(map(math.isfinite, reals))
            and all(isinstance(number, int) for number in integers)
        )


_REQUIRED = tuple(
    entry.name for entry in fields(EngineState) if entry.default_factory is MISSING and entry.default is MISSING
)


def _with_label_counts(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """Databases of version 0.1 stored sums of log likelihoods: a word that was sure added log 20 to that of a label
    never said.
    """
    if "label_counts" in document:
        return document
    unseen_log = float(document["unseen_log"])
    counts = {
        label: max(0.0, (float(log) - unseen_log) / math.log(20)) for label, log in document["label_logs"].items()
    }
    return {**document, "label_counts": counts, "label_weight": float(document["looks"])}


def _pairs(stored: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    return {str(name): (float(first), float(second)) for name, (first, second) in stored.items()}


def _cell(stored: list[float] | int) -> ViewpointCounts:
    """A cell of `viewpoints`; databases of version 0.1 stored the number of supporting views only, later ones no
    magnitudes: all views are then taken to have said equally much.
    """
    if isinstance(stored, int):
        return stored, stored, 0.0, 0.0, 0.0
    supports, looks, log_ratios, *magnitudes = stored
    total, greatest = magnitudes or (abs(log_ratios), abs(log_ratios) / max(looks, 1))
    return int(supports), int(looks), float(log_ratios), float(total), float(greatest)
