"""The figures of `supermap bench memory`: the document it prints with --json."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from supermap_cli.costs.memory.question_cost import QuestionCost, QuestionJob
from supermap_cli.costs.memory.questions import AnswerGrowth, BenchQuestion, questions
from supermap_cli.costs.memory.rooms import room_count
from supermap_cli.costs.memory.synthetic_memory import make_memory
from supermap_cli.costs.memory.traversals import plan_traversals
from supermap_cli.costs.processes import run_process
from supermap_cli.costs.report import Machine, this_machine
from supermap_cli.errors import EvaluationError
from supermap_cli.memory import open_store

BYTES_PER_INSTANCE = 45_000
"""Bytes on disk of an instance with its hundred observations and its part of the keyframes: 40 kB, rounded up."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class SyntheticMemory:
    """One synthetic memory; sizes in 10^6 bytes. `made_s` is `None` where it existed already."""

    instances: int
    observations: int
    keyframes: int
    traversals: int
    size_mb: float
    made_s: float | None


@dataclass(frozen=True)
class MemoryRow:
    """One question to both memories; `ratio` (of the repeats) and `ratio_first` are large / small."""

    question: str
    kind: str
    bound: AnswerGrowth
    small: QuestionCost
    large: QuestionCost
    ratio: float
    ratio_first: float


@dataclass(frozen=True)
class MemoryBench:
    """All figures; `worst_ratio` and `worst_over_mb` leave out the questions whose answers are listed as a whole."""

    machine: Machine
    seed: int
    small: SyntheticMemory
    large: SyntheticMemory
    questions: tuple[MemoryRow, ...]
    worst_ratio: float
    worst_over_mb: float


def measure_memories(
    instances: tuple[int, int], traversals: int, seed: int, folder: Path, progress: Progress
) -> MemoryBench:
    """Generate two memories, unless they are in the folder, and measure every question on both."""
    paths = [folder / f"memory-{count}-{traversals}-{seed}.db" for count in instances]
    check_disk_space(folder, [count for count, path in zip(instances, paths, strict=True) if not path.exists()])
    small, large = (
        _make_or_reuse(path, count, traversals, seed, progress) for path, count in zip(paths, instances, strict=True)
    )
    rows = []
    for question in questions(plan_traversals(traversals, room_count(instances[0]))):
        row = _row(question, *(_measure(question, path) for path in paths))
        progress(f"{row.question}: {row.small.again_ms:.0f} and {row.large.again_ms:.0f} ms")
        rows.append(row)
    bounded = [row for row in rows if row.bound != "grows"]
    return MemoryBench(
        machine=this_machine(),
        seed=seed,
        small=small,
        large=large,
        questions=tuple(rows),
        worst_ratio=max(row.ratio for row in bounded),
        worst_over_mb=max(row.large.over_mb for row in bounded),
    )


def check_disk_space(folder: Path, instances: Sequence[int]) -> None:
    """Raise `EvaluationError` where the memories would not fit."""
    needed, free = BYTES_PER_INSTANCE * sum(instances), shutil.disk_usage(folder).free
    if needed > free:
        raise EvaluationError(
            f"{needed / 1e9:.1f} GB are needed for the memories, {free / 1e9:.1f} GB are free",
            where=str(folder),
            cure="name a folder on a larger disk with --folder, or fewer --instances",
        )


def _make_or_reuse(path: Path, instances: int, traversals: int, seed: int, progress: Progress) -> SyntheticMemory:
    began, made_s = time.perf_counter(), None
    if not path.exists():
        progress(f"making up a memory of {instances} instances")
        unfinished = path.with_suffix(".unfinished")
        unfinished.unlink(missing_ok=True)
        make_memory(unfinished, instances, traversals, seed, progress)
        unfinished.rename(path)
        made_s = time.perf_counter() - began
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        counts = reader.counts()
    return SyntheticMemory(
        instances=counts["instances"],
        observations=counts["observations"],
        keyframes=counts["keyframes"],
        traversals=counts["traversals"],
        size_mb=path.stat().st_size / 1e6,
        made_s=made_s,
    )


def _measure(question: BenchQuestion, path: Path) -> QuestionCost:
    job = QuestionJob(db=path, command=question.command, arguments=question.arguments)
    with tempfile.TemporaryDirectory(prefix="supermap-bench-") as folder:
        return run_process("supermap_cli.costs.memory", job, QuestionCost, Path(folder) / "question")


def _row(question: BenchQuestion, small: QuestionCost, large: QuestionCost) -> MemoryRow:
    ratio, first = large.again_ms / small.again_ms, large.first_ms / small.first_ms
    return MemoryRow(question.text, question.kind, question.bound, small, large, ratio, first)
