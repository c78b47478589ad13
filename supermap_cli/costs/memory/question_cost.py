"""One question to one memory, in a process that does nothing else."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from pydantic import BaseModel, ConfigDict

from supermap_cli.costs.memory.questions import Command
from supermap_cli.costs.peak_memory import memory_mb, peak_memory_mb
from supermap_cli.memory import open_store
from supermap_cli.memory.opening import read_sql
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.clock import clock_of
from supermap_cli.query.details import details, details_at
from supermap_cli.query.diff import Diff, diff
from supermap_cli.query.instants import instant_of
from supermap_cli.query.inventory import Inventory, inventory
from supermap_cli.query.life import history
from supermap_cli.query.overview import Overview, overview, overview_at
from supermap_cli.query.resolution import Answer, answer
from supermap_cli.query.views import to_document

MAX_REPEATS = 5
REPEAT_BUDGET_S = 5.0
"""After so long nothing is asked once more."""


class QuestionJob(BaseModel):
    """A question to the memory at `db`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    db: Path
    command: Command
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class QuestionCost:
    """What a question took, from opening the database to the finished document; the program was loaded before.

    `first_ms`: for the first time in the process, nothing of the file being in the system's memory where that can be
    had; `again_ms`: the median of further times. `over_mb` is the most memory beyond what the loaded program had.
    `listed` things were told in the answer.
    """

    first_ms: float
    again_ms: float
    over_mb: float
    listed: int


def ask(job: QuestionJob) -> QuestionCost:
    """Ask, and ask again."""
    before_mb = memory_mb()
    _drop_from_page_cache(job.db)
    first_ms, listed = _timed(job)
    times_ms = [_timed(job)[0]]
    while len(times_ms) < MAX_REPEATS and sum(times_ms) < 1000 * REPEAT_BUDGET_S:
        times_ms.append(_timed(job)[0])
    return QuestionCost(first_ms, median(times_ms), max(peak_memory_mb() - before_mb, 0.0), listed)


def _timed(job: QuestionJob) -> tuple[float, int]:
    began = time.perf_counter()
    if job.command == "db sql":
        with read_sql(str(job.db), job.arguments[0]) as found:
            listed = len(list(found.rows))
    else:
        with open_store(str(job.db), read_only=True) as store, store.reader() as reader:
            told = _READS[job.command](reader, job.arguments)
            to_document(told)
        listed = _listed(told)
    return 1000 * (time.perf_counter() - began), listed


def _drop_from_page_cache(db: Path) -> None:
    """Ask the system to drop the file from its memory; where it cannot, the first answer is as fast as it comes."""
    if hasattr(os, "posix_fadvise"):
        with db.open("rb") as file:
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _show(reader: MapReader, arguments: tuple[str, ...]) -> object:
    named = None if not arguments or arguments[0].startswith("--") else arguments[0]
    if "--at" not in arguments:
        return overview(reader) if named is None else details(reader, named)
    clock = clock_of(reader)
    instant = instant_of(arguments[-1], reader, clock)
    return overview_at(reader, instant, clock) if named is None else details_at(reader, named, instant, clock)


_READS: dict[Command, Callable[[MapReader, tuple[str, ...]], Any]] = {
    "query": lambda reader, arguments: answer(" ".join(arguments), reader),
    "show": _show,
    "history": lambda reader, arguments: history(reader, arguments[0]),
    "diff": lambda reader, arguments: diff(reader, *arguments),
    "db info": lambda reader, _: inventory(reader),
}


def _listed(told: object) -> int:
    match told:
        case Answer():
            return len(told.instances) or len(told.nearest)
        case Overview():
            return len(told.instances)
        case Diff():
            return len(told.changes)
        case Inventory():
            return len(told.counts)
        case _:
            return 1
