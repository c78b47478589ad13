"""Measures one question to one memory, in a process that does nothing else."""

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
from supermap_cli.query.answers import Answer, answer
from supermap_cli.query.clock import clock_of
from supermap_cli.query.details import details, details_at
from supermap_cli.query.diff import Diff, diff
from supermap_cli.query.inventory import Inventory, inventory
from supermap_cli.query.object_history import object_history
from supermap_cli.query.overview import Overview, overview, overview_at
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.query.views import to_document

MAX_REPEATS = 5
"""Times that a question is asked again; the median counts."""
REPEAT_BUDGET_S = 5.0
"""Seconds of repeating after which a question is not asked again."""


class QuestionJob(BaseModel):
    """A question to the memory at `db`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    db: Path
    command: Command
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class QuestionCost:
    """Cost of a question, from opening the database to the finished document; the program was loaded before.

    `first_ms`: the first time in the process, with the file dropped from the page cache where the system allows it;
    `again_ms`: the median of the repeats. `over_mb`: peak memory in 10^6 bytes beyond that of the loaded program.
    `listed`: rows of the answer.
    """

    first_ms: float
    again_ms: float
    over_mb: float
    listed: int


def measure_question(job: QuestionJob) -> QuestionCost:
    """Ask once with a cold page cache, then repeat."""
    before_mb = memory_mb()
    _drop_from_page_cache(job.db)
    first_ms, listed = _time_once(job)
    times_ms = [_time_once(job)[0]]
    while len(times_ms) < MAX_REPEATS and sum(times_ms) < 1000 * REPEAT_BUDGET_S:
        times_ms.append(_time_once(job)[0])
    return QuestionCost(first_ms, median(times_ms), max(peak_memory_mb() - before_mb, 0.0), listed)


def _time_once(job: QuestionJob) -> tuple[float, int]:
    began = time.perf_counter()
    if job.command == "db sql":
        with read_sql(str(job.db), job.arguments[0]) as found:
            listed = len(list(found.rows))
    else:
        with open_store(str(job.db), read_only=True) as store, store.reader() as reader:
            answer_document = _READERS[job.command](reader, job.arguments)
            to_document(answer_document)
        listed = _listed_count(answer_document)
    return 1000 * (time.perf_counter() - began), listed


def _drop_from_page_cache(db: Path) -> None:
    """Drop the file from the page cache where the system can (posix_fadvise(2))."""
    if hasattr(os, "posix_fadvise"):
        with db.open("rb") as file:
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _read_show(reader: MapReader, arguments: tuple[str, ...]) -> object:
    named = None if not arguments or arguments[0].startswith("--") else arguments[0]
    if "--at" not in arguments:
        return overview(reader) if named is None else details(reader, named)
    clock = clock_of(reader)
    instant = parse_time_point(arguments[-1], reader, clock)
    return overview_at(reader, instant, clock) if named is None else details_at(reader, named, instant, clock)


_READERS: dict[Command, Callable[[MapReader, tuple[str, ...]], Any]] = {
    "query": lambda reader, arguments: answer(" ".join(arguments), reader),
    "show": _read_show,
    "history": lambda reader, arguments: object_history(reader, arguments[0]),
    "diff": lambda reader, arguments: diff(reader, *arguments),
    "db info": lambda reader, _: inventory(reader),
}


def _listed_count(answer_document: object) -> int:
    match answer_document:
        case Answer():
            return len(answer_document.instances) or len(answer_document.nearest)
        case Overview():
            return len(answer_document.instances)
        case Diff():
            return len(answer_document.changes)
        case Inventory():
            return len(answer_document.counts)
        case _:
            return 1
