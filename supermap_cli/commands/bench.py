"""`supermap bench`: what a build costs, stage by stage: what a robot needs to have on board."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from supermap_cli.commands import bench_memory
from supermap_cli.commands.bench_numbers import parse_objects
from supermap_cli.commands.build_options import override, request
from supermap_cli.commands.common import (
    AlignOption,
    BackendOption,
    CameraOption,
    DetectorOption,
    EndOption,
    FrameOption,
    JsonOption,
    OdometryOption,
    RateOption,
    SegmenterOption,
    StartOption,
    TopicOption,
    TrackerOption,
    err,
    out,
    print_json,
)
from supermap_cli.commands.tables import print_table
from supermap_cli.temporary_folders import temporary_folder

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.costs.job import CostJob, Measurement
    from supermap_cli.costs.report import Bench

EXAMPLES = """
Examples:

    supermap bench run.mcap

    supermap bench run.mcap --json > before.json

    supermap bench run.mcap --compare before.json

    supermap bench run.mcap --objects 40,400

    supermap bench memory
"""


class BenchGroup(TyperGroup):
    """Measures recordings, unless the first word is the name of something else to measure."""

    default_command = "recordings"

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """`bench run.mcap` is `bench recordings run.mcap`."""
        if args and args[0] not in {*self.commands, "--help", "-h"}:
            args = [self.default_command, *args]
        return super().parse_args(ctx, args)


def register(app: typer.Typer) -> None:
    """Add the group to the app."""
    group = typer.Typer(
        cls=BenchGroup, no_args_is_help=True, epilog=EXAMPLES, help="Measure what building or asking costs."
    )
    group.command("recordings", epilog=EXAMPLES.replace("bench run.mcap", "bench recordings run.mcap"))(bench)
    group.command(epilog=bench_memory.EXAMPLES)(bench_memory.memory)
    app.add_typer(group, name="bench")


def bench(  # noqa: PLR0917 - a command line has many options
    recordings: Annotated[
        list[Path], typer.Argument(help="Recordings as `supermap build` takes them; one traversal each.")
    ],
    detector: DetectorOption = None,
    odometry: OdometryOption = None,
    segmenter: SegmenterOption = None,
    tracker: TrackerOption = None,
    option: BackendOption = None,
    topic: TopicOption = None,
    frame: FrameOption = None,
    camera: CameraOption = None,
    start: StartOption = None,
    end: EndOption = None,
    rate: RateOption = None,
    align: AlignOption = "auto",
    objects: Annotated[
        str | None,
        typer.Option(metavar="N,N,...", help="Also measure mapping with so many objects in the map, e.g. 40,400."),
    ] = None,
    compare: Annotated[
        Path | None, typer.Option(metavar="OLD.json", help="Set the figures against those of an earlier --json.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Measure what building costs: time by stage, memory and disk. The map goes to a temporary database.

    The recordings are built as `supermap build` does it, then once more one stage at a time, then only decoded, each
    in a process of its own. Other programs at work on the machine show in the figures.
    """
    from supermap_cli.config import load_user_config  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.costs.job import CostJob  # noqa: PLC0415
    from supermap_cli.costs.report import compare as compare_benches  # noqa: PLC0415
    from supermap_cli.costs.report import read_bench  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    earlier = None if compare is None else read_bench(compare)
    wanted = parse_objects(objects)
    config = override(
        load_user_config(Path.cwd()).build,
        detector=detector,
        odometry=odometry,
        segmenter=segmenter,
        tracker=tracker,
        options=option,
        topics=topic,
        frames=frame,
        camera=camera,
        rate=rate,
    )
    with temporary_folder("supermap-bench-") as folder:
        job = CostJob(
            measurement="build",
            recordings=tuple(recordings),
            config=config,
            request=request(config, start, end),
            align=align,
            db=folder / "build.db",
        )
        measured = measure(job, recordings, wanted, folder)
    if earlier is not None and compare is not None:
        measured = replace(measured, compared=compare_benches(measured, earlier, compare))
    if json:
        print_json(to_document(measured))
    else:
        print_bench(out(), measured)


def measure(job: CostJob, recordings: list[Path], objects: tuple[int, ...], folder: Path) -> Bench:
    """Run every measurement, one after the other."""
    from supermap_cli.costs.job import BuildRun, DecodeRun, StagesRun  # noqa: PLC0415
    from supermap_cli.costs.processes import run_job  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.costs.report import summarise  # noqa: PLC0415

    def announced(measurement: Measurement, description: str, wanted: int = 0) -> CostJob:
        err().print(f"measuring: {description}", markup=False)
        db = folder / f"{measurement}-{wanted}.db"
        return job.model_copy(update={"measurement": measurement, "objects": wanted, "db": db})

    build = run_job(announced("build", "the build as it is"), BuildRun, folder)
    stages = run_job(announced("stages", "one stage at a time"), StagesRun, folder)
    decode = run_job(announced("decode", "decoding alone"), DecodeRun, folder)
    growth = [
        (wanted, run_job(announced("growth", f"{wanted} objects in the map", wanted), StagesRun, folder))
        for wanted in objects
    ]
    return summarise(recordings, build, stages, decode, growth)


def print_bench(console: Console, bench: Bench) -> None:
    """All figures for people."""
    build, machine = bench.build, bench.machine
    console.print(
        f"{bench.keyframes} keyframes of {build.recorded_s:.1f} s, {bench.detections} detections, {bench.objects} "
        f"objects; {machine.cpus} cores, {machine.system}, Python {machine.python}, supermap {machine.supermap}",
        markup=False,
    )
    columns: tuple[str, ...]
    console.print("  " + ", ".join(f"{kind} {name}" for kind, name in bench.backends.items()) + "\n", markup=False)
    print_table(console, "", ("stage", "", "mean ms#", "p95 ms#", "share#", "runs#"), _stage_rows(bench))
    print_table(
        console,
        "Rates, with a core to itself",
        ("module", "ms a keyframe#", "Hz#", "the paper's Hz#"),
        _rate_rows(bench),
    )
    print_table(console, "", ("figure", "value#", "what it says"), _whole_rows(bench))
    if bench.growth:
        columns = ("objects in the map", "mapping, ms a keyframe#", "to the first#")
        print_table(console, "Mapping the second half of the first recording", columns, _growth_rows(bench))
    if bench.compared is not None:
        columns = ("figure", "then#", "now#", "then / now#")
        print_table(console, f"Against {bench.compared.document}", columns, _change_rows(bench))


def _stage_rows(bench: Bench) -> Iterator[tuple[str, ...]]:
    for stage in bench.stages:
        cells = (f"{stage.mean_ms:.2f}", f"{stage.p95_ms:.2f}", f"{100 * stage.share:.0f} %", str(stage.runs))
        yield (stage.stage, stage.kind, *cells)


def _rate_rows(bench: Bench) -> Iterator[tuple[str, ...]]:
    for rate in bench.rates:
        module = f"{rate.module} ({', '.join(rate.stages)})"
        yield module, f"{rate.ms:.2f}", f"{rate.hz:.1f}", f"{rate.paper_hz:g}"


def _whole_rows(bench: Bench) -> tuple[tuple[str, ...], ...]:
    build, floor = bench.build, bench.floor
    return (
        ("realtime factor", f"{build.realtime_factor:.1f}", f"recording / build; the build took {build.total_s:.1f} s"),
        ("cores at realtime", f"{build.cores:.2f}", "CPU seconds for a second of recording, all threads"),
        ("mapping", f"{floor.mapping_ms:.2f} ms", "a keyframe: all but decoding, odometry and neural inference"),
        ("decoding alone", f"{floor.decode_ms:.2f} ms", "a keyframe: the same images and recorded detections"),
        ("mapping / decoding alone", f"{floor.ratio:.2f}", "1: mapping costs as much as reading what it maps"),
        ("peak memory", f"{build.peak_memory_mb:.0f} MB", f"decoding alone: {floor.peak_memory_mb:.0f} MB"),
        ("database", f"{build.database_mb:.1f} MB", "on disk"),
    )


def _growth_rows(bench: Bench) -> Iterator[tuple[str, ...]]:
    first = bench.growth[0].mapping_ms
    for step in bench.growth:
        yield str(step.objects), f"{step.mapping_ms:.2f}", f"{step.mapping_ms / max(first, 1e-9):.2f}"


def _change_rows(bench: Bench) -> Iterator[tuple[str, ...]]:
    for change in bench.compared.changes if bench.compared is not None else ():
        ratio = "-" if change.ratio is None else f"{change.ratio:.2f}"
        yield change.figure, f"{change.then:.2f}", f"{change.now:.2f}", ratio
