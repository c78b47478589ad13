"""`supermap bench memory`: what questions cost as the memory grows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.bench_numbers import parse_objects
from supermap_cli.commands.common import JsonOption, err, kept_or_temporary, out, print_json
from supermap_cli.commands.tables import print_table
from supermap_cli.commands.whole_numbers import whole
from supermap_cli.errors import ConfigError

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.costs.memory.report import MemoryBench, SyntheticMemory

EXAMPLES = """
Examples:

    supermap bench memory

    supermap bench memory --instances 1000,10000 --folder /tmp/memories

    supermap bench memory --json > memory.json
"""

GROWTH_NOTES = {
    "fixed": "the answer is as large in both memories",
    "listed": "the answer grows, the first of it are listed, and counts come from an index",
    "grows": "the answer rests on all there is of a common thing: it takes longer the more there is",
}


def memory(
    instances: Annotated[
        str, typer.Option(metavar="SMALL,LARGE", help="How many objects the two memories hold.")
    ] = "1000,100000",
    traversals: Annotated[int, typer.Option(min=4, callback=whole, help="How many traversals each of them has.")] = 100,
    seed: Annotated[int, typer.Option(min=0, callback=whole, help="What is made up follows from it.")] = 0,
    folder: Annotated[
        Path | None,
        typer.Option(help="Where the memories are kept, and taken from if they are there. [default: a temporary one]"),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Measure what questions cost in a small and in a large memory, both made up: time, and memory used.

    A building is furnished, seen and changed over months, and its memory written: a hundred observations for every
    object, 40 kB each, minutes for 100,000 of them. Then every command that reads, and every kind of question, is asked
    of both, each in a process of its own.
    """
    from supermap_cli.costs.memory.report import measure_memories  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    small, large = parse_two_sizes(instances)
    console = err()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with kept_or_temporary(folder) as memories_folder:
        measured = measure_memories(
            (small, large), traversals, seed, memories_folder, lambda message: console.print(message, markup=False)
        )
    if json:
        print_json(to_document(measured))
    else:
        print_memory_bench(out(), measured)


def parse_two_sizes(text: str) -> tuple[int, int]:
    """`"1000,100000"` -> (1000, 100000). Raises `ConfigError` for anything but two numbers that grow."""
    numbers = parse_objects(text, "--instances", "1000,100000")
    if len(numbers) != 2 or numbers[0] >= numbers[1]:
        raise ConfigError(f"--instances {text!r} are not a small and a large number", cure="write 1000,100000")
    return numbers[0], numbers[1]


def print_memory_bench(console: Console, bench: MemoryBench) -> None:
    """All figures for people."""
    machine = bench.machine
    system = f"{machine.cpus} cores, {machine.system}, Python {machine.python}, supermap {machine.supermap}"
    made = (_made_row(name, made) for name, made in (("small", bench.small), ("large", bench.large)))
    columns: tuple[str, ...] = ("memory", "instances#", "observations#", "keyframes#", "traversals#", "MB#", "made in#")
    print_table(console, system, columns, made)
    columns = (
        *("question", "kind", "answer", "small ms#", "large ms#", "ratio#"),
        *("first ms#", "large first ms#", "ratio#", "MB over#", "large MB over#"),
    )
    print_table(console, "Milliseconds when asked again, when asked for the first time; memory", columns, _rows(bench))
    for bound, words in GROWTH_NOTES.items():
        console.print(f"{bound}: {words}", markup=False)
    console.print(
        f"worst ratio but of those that grow: {bench.worst_ratio:.1f}; most memory: {bench.worst_over_mb:.0f} MB",
        markup=False,
    )


def _made_row(name: str, made: SyntheticMemory) -> tuple[str, ...]:
    took = "was there" if made.made_s is None else f"{made.made_s:.0f} s"
    counts = (made.instances, made.observations, made.keyframes, made.traversals)
    return (name, *map(str, counts), f"{made.size_mb:.0f}", took)


def _rows(bench: MemoryBench) -> Iterator[tuple[str, ...]]:
    for row in bench.questions:
        small, large = row.small, row.large
        again = (f"{small.again_ms:.1f}", f"{large.again_ms:.1f}", f"{row.ratio:.1f}")
        first = (f"{small.first_ms:.1f}", f"{large.first_ms:.1f}", f"{row.ratio_first:.1f}")
        listed = f"{row.bound}, {small.listed} / {large.listed}"
        yield (row.question, row.kind, listed, *again, *first, f"{small.over_mb:.0f}", f"{large.over_mb:.0f}")
