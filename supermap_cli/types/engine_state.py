"""What the mapping engine keeps of a thing beside what everybody may read, to go on with it in the next build.

In an `InstanceRecord`, and in the memory, it is a JSON document (`engine_state`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from supermap_cli.errors import MemoryStoreError


@dataclass(frozen=True)
class EngineState:
    """`label_logs`, `unseen_log` and `looks` are those of the belief over labels; `viewpoints` how it was looked at, by
    cell: supporting looks, all looks and the sum of their log ratios; `state_*` the state it stands in, `gone_ns` since
    when it stands nowhere; `best_crop` how good the best picture of it was.
    """

    label_logs: Mapping[str, float]
    unseen_log: float
    looks: float
    viewpoints: Mapping[str, tuple[int, int, float]]
    state_index: int
    state_first_seen_ns: int
    state_empty_before_ns: int | None
    gone_ns: int | None
    best_crop: float

    def to_document(self) -> dict[str, object]:
        """JSON numbers and strings only."""
        return asdict(self) | {"viewpoints": {name: list(cell) for name, cell in self.viewpoints.items()}}

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> EngineState:
        """From what `to_document` made. Raises `MemoryStoreError` for anything else."""
        try:
            values = {field.name: document[field.name] for field in fields(cls)}
            state = cls(**values | {"viewpoints": {name: _cell(kept) for name, kept in values["viewpoints"].items()}})
            if state._is_whole():
                return state
        except (KeyError, TypeError, ValueError, AttributeError):
            pass
        raise MemoryStoreError(
            "the engine state is damaged, it cannot be built on",
            cure="run `supermap db check`, and go back to a sound copy of the database",
        )

    def _is_whole(self) -> bool:
        reals = [*self.label_logs.values(), self.unseen_log, self.looks, self.best_crop]
        reals += [cell[2] for cell in self.viewpoints.values()]
        whole = [self.state_index, self.state_first_seen_ns]
        whole += [stamp_ns for stamp_ns in (self.state_empty_before_ns, self.gone_ns) if stamp_ns is not None]
        return (
            bool(self.label_logs)
            and all(map(math.isfinite, reals))
            and all(isinstance(number, int) for number in whole)
        )


def _cell(kept: list[float] | int) -> tuple[int, int, float]:
    """Memories of version 0.1 kept the number of supporting looks only."""
    if isinstance(kept, int):
        return kept, kept, 0.0
    supports, looks, log_ratios = kept
    return int(supports), int(looks), float(log_ratios)
