"""`supermap eval perception`: what late, rare and dropped detections cost."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.benchmark import KeepOption, SeedsOption, build_and_score, format_cell, parse_seeds, tabulate
from supermap_cli.commands.common import JsonOption, kept_or_temporary, out, print_json
from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.config import PerceptionConfig

EXAMPLES = """
Examples:

    supermap eval perception office --seeds 1

    supermap eval perception --seeds 1,2,3 --keep worlds --json
"""
SCENARIOS = ("office", "office-twice")
FIGURES = (
    *("objects: F1", "objects: precision", "objects: recall", "objects: box IoU of the right ones"),
    *("instances: AP50", "instances: AP25"),
    *("identity: instances per object", "identity: switches of static objects", "identity: relocated, found"),
    *("identity: stale objects", "change: change recall, per object", "change: change recall, per frame"),
    *("change: F1 of the diff", "questions answered exactly right"),
)


@dataclass(frozen=True)
class PerceptionFigure:
    """One line of the table: the mean over the seeds for each way of perceiving, in their order; `None` where no world
    gave occasion for it.
    """

    name: str
    means: tuple[float | None, ...]


@dataclass(frozen=True)
class PerceptionTable:
    """The figures of one scenario, a column for each way of perceiving."""

    scenario: str
    seeds: tuple[int, ...]
    figures: tuple[PerceptionFigure, ...]


@dataclass(frozen=True)
class PerceptionStudy:
    """The whole study; `ways` name the columns."""

    ways: tuple[str, ...]
    tables: tuple[PerceptionTable, ...]


def perception(
    scenarios: Annotated[
        list[str] | None, typer.Argument(metavar="SCENARIO...", help="What to simulate. [default: office office-twice]")
    ] = None,
    seeds: SeedsOption = "1,2,3",
    keep: KeepOption = None,
    json: JsonOption = False,
) -> None:
    """Build worlds with detections that come at once, up to 2 s late, at 1 Hz, and with a fifth of them dropped.

    Images are mapped at the same rate each time: those without detections by their depth.
    """
    from supermap_cli.query.views import to_document  # noqa: PLC0415 - keeps start-up light

    chosen = parse_seeds(seeds)
    ways = perception_configs()
    tables = []
    with kept_or_temporary(keep) as folder:
        for scenario in scenarios or SCENARIOS:
            tables.append(PerceptionTable(scenario, chosen, _compare(scenario, chosen, folder, ways)))
            if not json:
                _print(out(), tables[-1], tuple(ways))
    if json:
        print_json(to_document(PerceptionStudy(tuple(ways), tuple(tables))))


def perception_configs() -> dict[str, PerceptionConfig]:
    """Column of the table -> configuration of perception."""
    from supermap_cli.config import PerceptionConfig  # noqa: PLC0415 - keeps start-up light

    return {
        "at once": PerceptionConfig(),
        "up to 2 s late": PerceptionConfig(delay_s=2.0),
        "at 1 Hz": PerceptionConfig(rate_hz=1.0),
        "a fifth dropped": PerceptionConfig(dropped=0.2),
    }


def _compare(
    scenario: str, seeds: tuple[int, ...], folder: Path, ways: dict[str, PerceptionConfig]
) -> tuple[PerceptionFigure, ...]:
    from supermap_cli.config import BuildConfig  # noqa: PLC0415 - keeps start-up light

    columns = []
    for perception_config in ways.values():
        config = BuildConfig(perception=perception_config)
        figures = tabulate([build_and_score(scenario, seed, folder / scenario / str(seed), config) for seed in seeds])
        columns.append({figure.name: figure.mean for figure in figures})
    defined = (name for name in FIGURES if any(column.get(name) is not None for column in columns))
    return tuple(PerceptionFigure(name, tuple(column.get(name) for column in columns)) for name in defined)


def _print(console: Console, table: PerceptionTable, ways: tuple[str, ...]) -> None:
    title = f"{table.scenario}, mean of seeds {', '.join(map(str, table.seeds))}"
    print_table(
        console,
        "",
        (title, *(f"{perception_config}#" for perception_config in ways)),
        ((figure.name, *map(format_cell, figure.means)) for figure in table.figures),
    )
