"""`supermap eval benchmark`: simulated worlds of several seeds, built and scored: one table of all figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import JsonOption, err, kept_or_temporary, out, print_json
from supermap_cli.commands.tables import print_table
from supermap_cli.commands.whole_numbers import is_whole, whole
from supermap_cli.errors import ConfigError, EvaluationError

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.config import BuildConfig
    from supermap_cli.evaluation.calibration import Rated
    from supermap_cli.evaluation.report import Report

EXAMPLES = """
Examples:

    supermap eval benchmark

    supermap eval benchmark office --seeds 1,2 --keep worlds --json

    supermap eval benchmark room --domain masks=hull --seeds 1,2

    supermap eval benchmark --suite domains --jobs 2 --keep worlds

    supermap eval benchmark --suite domains --jobs 2 --keep worlds --resume
"""
SCENARIOS = ("office", "office-twice", "panorama")
DATABASE_NAME = "benchmark.db"


SeedsOption = Annotated[str, typer.Option(metavar="N,N,...", help="Which worlds of each.")]
KeepOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Where the worlds are kept, and used again if they are there already. [default: nowhere]",
        show_default=False,
    ),
]


class Suite(StrEnum):
    """Fixed sets of worlds."""

    DOMAINS = "domains"


class HalfOption(StrEnum):
    """The halves of a suite (`simulation.domains.suite`)."""

    DEVELOPMENT = "development"
    REPORT = "report"


@dataclass(frozen=True)
class BenchmarkFigure:
    """One line of the table: its values by seed, in the order of the seeds, and their mean over the worlds that gave
    occasion for it; `None` where none did.
    """

    name: str
    values: tuple[float | None, ...]
    mean: float | None


@dataclass(frozen=True)
class BenchmarkTable:
    """All figures of one scenario, a column for each seed; `rated` are, of each seed, the confidences of the map's
    instances and whether they are right (`ObjectScores.rated`).
    """

    scenario: str
    seeds: tuple[int, ...]
    figures: tuple[BenchmarkFigure, ...]
    rated: tuple[tuple[Rated, ...], ...]


@dataclass(frozen=True)
class Benchmark:
    """The whole table."""

    tables: tuple[BenchmarkTable, ...]


def benchmark(  # noqa: PLR0917 - a command line has many options
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(metavar="SCENARIO...", help="What to simulate. [default: office office-twice panorama]"),
    ] = None,
    seeds: SeedsOption = "1,2,3",
    domain: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=LEVEL", help="Vary one axis of every world, as `simulate --domain` does."),
    ] = None,
    suite: Annotated[
        Suite | None, typer.Option(help="Build a fixed set of worlds instead: every level of every axis.")
    ] = None,
    half: Annotated[
        HalfOption | None, typer.Option(help="Of the suite, only the seeds for development or those for reports.")
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Of the suite, only this axis; may be repeated.")
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, callback=whole, help="How many worlds of the suite are built at a time.")
    ] = 2,
    keep: KeepOption = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Of the suite, take the worlds that an earlier run with this --keep has scored as they were scored "
            "then, whatever has become of the program, and build only the others.",
        ),
    ] = False,
    json: JsonOption = False,
) -> None:
    """Simulate worlds, build and score each, and print all figures with their means: the tables in docs/benchmarks.md.

    Kept worlds take up to 1 GB each and are what their seed says only as long as the simulator stays the same; the maps
    in them (benchmark.db) are built anew.
    """
    from supermap_cli.query.views import to_document  # noqa: PLC0415 - keeps start-up light

    if suite is not None:
        from supermap_cli.commands.domain_suite import run_suite  # noqa: PLC0415

        if scenarios or domain:
            raise ConfigError("--suite says which worlds there are", cure="leave out SCENARIO and --domain")
        if resume and keep is None:
            raise ConfigError("--resume goes on with an earlier run", cure="say with --keep where that kept its worlds")
        run_suite(half, axis or (), jobs, keep, resume=resume, json=json)
        return
    if resume:
        raise ConfigError("--resume goes on with a suite", cure="give --suite domains, or leave it out")
    chosen = parse_seeds(seeds)
    tables = []
    with kept_or_temporary(keep) as folder:
        for scenario in scenarios or SCENARIOS:
            reports = [
                build_and_score(scenario, seed, folder / scenario / str(seed), domain=domain or ()) for seed in chosen
            ]
            rated = tuple(() if report.map is None else report.map.rated for report in reports)
            tables.append(BenchmarkTable(scenario, chosen, tabulate(reports), rated))
            if not json:
                _print(out(), tables[-1])
    if json:
        print_json(to_document(Benchmark(tuple(tables))))


def parse_seeds(text: str) -> tuple[int, ...]:
    """`"1,2,3"` -> (1, 2, 3). Raises `EvaluationError` for anything else."""
    parts = [part.strip() for part in text.split(",")]
    if not all(is_whole(part) for part in parts):
        raise EvaluationError(f"--seeds {text!r} is not understood", cure="write --seeds 1,2,3")
    return tuple(dict.fromkeys(map(int, parts)))


def tabulate(reports: Sequence[Report]) -> tuple[BenchmarkFigure, ...]:
    """The figures of several worlds, by name, in the order of the first world that has them."""
    columns = [dict(_figures(report)) for report in reports]
    names = dict.fromkeys(name for column in columns for name in column)
    return tuple(_figure(name, [column.get(name) for column in columns]) for name in names)


def _figure(name: str, values: Sequence[float | None]) -> BenchmarkFigure:
    defined = [value for value in values if value is not None]
    mean = sum(defined) / len(defined) if defined else None
    rounded = tuple(None if value is None else round(value, 4) for value in values)
    return BenchmarkFigure(name, rounded, None if mean is None else round(mean, 4))


def _figures(report: Report) -> Iterator[tuple[str, float | None]]:
    """(name, value) of the figures of the table."""
    if report.map is not None:
        yield "objects: F1", report.map.labelled.f1
        yield "objects: precision", report.map.labelled.precision
        yield "objects: recall", report.map.labelled.recall
        yield "objects: F1 without label", report.map.unlabelled.f1
        yield "objects: box IoU of the right ones", report.map.iou
        yield "objects: people left in the map", len(report.map.people)
    if report.instances is not None:
        yield "instances: AP", report.instances.ap
        yield "instances: AP50", report.instances.ap50
        yield "instances: AP25", report.instances.ap25
    if report.semantics is not None:
        yield "semantics: mIoU, objects only", report.semantics.without_background.miou
        yield "semantics: mIoU, with background", report.semantics.with_background.miou
        yield "semantics: f-mIoU, with background", report.semantics.with_background.fmiou
        yield "semantics: accuracy, with background", report.semantics.with_background.accuracy
    if report.identity is not None:
        yield "identity: instances per object", report.identity.instances_per_object
        yield "identity: switches of static objects", report.identity.switches
        yield "identity: relocated, found", report.identity.relocated_found
        yield "identity: relocated, same id", report.identity.relocated_kept
        yield "identity: stale objects", len(report.identity.stale)
        yield "identity: people, one track a passage", report.identity.passages.followed
        yield "identity: IDF1", report.identity.tracking.idf1
        yield "identity: HOTA", report.identity.tracking.hota
    if report.change is not None:
        recall, reported = report.change.recall, report.change.reported
        claimed = report.change.claimed
        yield "change: claimed where nothing changes", None if claimed is None else len(claimed)
        yield "change: detection recall, per object", recall.per_object.detection_recall
        yield "change: change recall, per object", recall.per_object.change_recall
        yield "change: detection recall, per frame", recall.per_frame.detection_recall
        yield "change: change recall, per frame", recall.per_frame.change_recall
        overall = reported.overall
        yield "change: precision of the diff", None if overall is None else overall.precision
        yield "change: recall of the diff", None if overall is None else overall.recall
        yield "change: F1 of the diff", None if overall is None else overall.f1
    if report.query is not None:
        yield "questions answered exactly right", report.query.exact
    yield "odometry: way off its true way (m)", max(report.alignment_rmse_m.values(), default=None)


def build_and_score(
    scenario: str, seed: int, folder: Path, config: BuildConfig | None = None, *, domain: Sequence[str] = ()
) -> Report:
    """Simulate a world, unless it is there, build it anew, by default with the default configuration, and score it."""
    from supermap_cli.commands.build import Follow, build_all  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.commands.build_options import request  # noqa: PLC0415
    from supermap_cli.commands.simulate import simulate_scenario  # noqa: PLC0415
    from supermap_cli.config import BuildConfig  # noqa: PLC0415
    from supermap_cli.evaluation.pairing import true_traversals  # noqa: PLC0415
    from supermap_cli.evaluation.reading import read_map  # noqa: PLC0415
    from supermap_cli.evaluation.report import score  # noqa: PLC0415
    from supermap_cli.memory import open_store  # noqa: PLC0415
    from supermap_cli.simulation.domains.axes import choose_levels  # noqa: PLC0415
    from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415

    if not (folder / TRUTH_FILE).is_file():
        simulate_scenario(scenario, folder, seed, None, overwrite=False, domain=domain)
    truth, db = read_truth(folder / TRUTH_FILE), folder / DATABASE_NAME
    there, wanted = (truth.scenario, truth.seed, dict(truth.levels)), (scenario, seed, choose_levels(domain, seed))
    if there != wanted:
        raise EvaluationError(
            f"this is {_world_name(*there)}, not {_world_name(*wanted)}",
            where=str(folder / TRUTH_FILE),
            cure="name another folder with --keep",
        )
    with open_store(str(db), create=True) as store:
        store.remove(lambda traversal: true_traversals(traversal, truth))
    recordings, config = [folder / traversal.recording for traversal in truth.traversals], config or BuildConfig()
    for summary in build_all(recordings, config, request(config, None, None), str(db), Follow()):
        err().print(f"{scenario}, seed {seed}: built {summary.traversal} in {summary.total_s:.0f} s", markup=False)
    return score(*read_map(str(db), folder / TRUTH_FILE))


def _world_name(scenario: str, seed: int, levels: Mapping[str, str]) -> str:
    return ", ".join([scenario, f"seed {seed}", *(f"{axis}={level}" for axis, level in levels.items())])


def _print(console: Console, table: BenchmarkTable) -> None:
    columns = (table.scenario, *(f"seed {seed}#" for seed in table.seeds), "mean#")
    rows = ((figure.name, *map(format_cell, figure.values), format_cell(figure.mean)) for figure in table.figures)
    print_table(console, "", columns, rows)


def format_cell(value: float | None) -> str:
    """A figure as text; `-` for `None`, counts without decimals."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.3f}"
