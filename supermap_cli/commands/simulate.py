"""`supermap simulate`: recordings of a world that is known exactly."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands import common
from supermap_cli.commands.common import JsonOption, err, interrupt_on_sigterm, print_json, sane
from supermap_cli.commands.tables import print_table
from supermap_cli.commands.whole_numbers import whole
from supermap_cli.errors import ConfigError, SimulationError

if TYPE_CHECKING:
    from supermap_cli.simulation.detection.detector_errors import DetectorErrors
    from supermap_cli.simulation.recording.recorder import RecordedScenario
    from supermap_cli.simulation.scenario import Scenario

EXAMPLES = """
Examples:

    supermap simulate --list

    supermap simulate office-twice --out office --seed 1

    supermap simulate tiny --out tiny --perfect

    supermap simulate office --rig three-cameras

    supermap simulate office --out hard --error recall=0.7 --error false_positives=1.5

    supermap simulate room --domain masks=hull --domain odometry=drift-3

    supermap simulate room --domain random --seed 7 --out anything
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(simulate)


def simulate(  # noqa: PLR0917 - a command line has many options
    scenario: Annotated[
        str | None, typer.Argument(metavar="SCENARIO", help="What to simulate; see --list.", show_default=False)
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The robot's sensors; see --list. [default: as the scenario says]"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The folder to write to. [default: the scenario's name]")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, callback=whole, help="Another seed is another world, another way, other noise.")
    ] = 1,
    seconds: Annotated[
        float | None,
        typer.Option(
            min=1, max=86400, callback=sane, help="How long each recording lasts. [default: as the scenario says]"
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files of an earlier simulation.")] = False,
    perfect: Annotated[bool, typer.Option("--perfect", help="A detector without errors.")] = False,
    error: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="One of the detector's errors, e.g. recall=0.8; may be repeated."),
    ] = None,
    domain: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LEVEL",
            help="Vary one axis, e.g. masks=hull; may be repeated. `random` draws a level of every other axis.",
        ),
    ] = None,
    listed: Annotated[
        bool, typer.Option("--list", help="List the scenarios, the rigs, the axes and the detector's errors.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate a robot's recordings, with the exact truth beside them.

    Rooms with furniture and small things, a robot that drives through them, people who carry things: one .mcap for each
    visit, with recorded detections, and truth.json, which `supermap eval` holds a map against.
    """
    if listed:
        _list(as_json=as_json)
        return
    if scenario is None:
        raise SimulationError("no scenario given", cure="name one of those that `supermap simulate --list` shows")
    began = time.perf_counter()
    recorded = simulate_scenario(
        scenario,
        out or Path(scenario),
        seed,
        seconds,
        lambda usual: detector_errors(error or [], perfect=perfect, usual=usual),
        overwrite=overwrite,
        rig=rig,
        domain=domain or [],
    )
    total_s = time.perf_counter() - began
    if as_json:
        print_json(to_document(recorded, total_s))
    else:
        _print(recorded, total_s)


def simulate_scenario(
    name: str,
    folder: Path,
    seed: int,
    seconds: float | None,
    errors: Callable[[DetectorErrors], DetectorErrors] | None = None,
    *,
    overwrite: bool,
    rig: str | None = None,
    domain: Sequence[str] = (),
) -> RecordedScenario:
    """Make a scenario and record it, with progress bars. `errors` gives the detector's from the scenario's own."""
    interrupt_on_sigterm()
    try:
        # Heavy imports, only when a simulation starts.
        from supermap_cli.simulation.domains.axes import choose_levels  # noqa: PLC0415
        from supermap_cli.simulation.recording.recorder import record  # noqa: PLC0415
        from supermap_cli.simulation.scenarios import make_scenario  # noqa: PLC0415

        with err().status(f"making {name}"):
            scenario = make_scenario(name, seed, seconds=seconds, rig=rig, levels=choose_levels(domain, seed))
        used = scenario.errors if errors is None else errors(scenario.errors)
        with progress_bars(scenario) as progress:
            return record(scenario, folder, errors=used, seed=seed, overwrite=overwrite, progress=progress)
    except KeyboardInterrupt:
        err().print("interrupted: nothing was written", markup=False)
        raise


def detector_errors(given: list[str], *, perfect: bool, usual: DetectorErrors | None = None) -> DetectorErrors:
    """The usual errors, or none if `perfect`, with those of the command line laid over them.

    Raises `ConfigError` for unknown ones.
    """
    from pydantic import ValidationError  # noqa: PLC0415 - keeps start-up light

    from supermap_cli.commands.build_options import pairs  # noqa: PLC0415
    from supermap_cli.simulation.detection.detector_errors import DetectorErrors  # noqa: PLC0415
    from supermap_cli.wrong_entries import wrong_entry  # noqa: PLC0415

    values = (DetectorErrors.perfect() if perfect else usual or DetectorErrors()).model_dump()
    try:
        return DetectorErrors.model_validate(values | pairs(given, "--error", "recall=0.8"))
    except ValidationError as error:
        entry, what = wrong_entry(error)
        known = ", ".join(DetectorErrors.model_fields)
        raise ConfigError(f"--error {'.'.join(entry)}: {what}", cure=f"the errors are {known}") from error


@contextmanager
def progress_bars(scenario: Scenario) -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each traversal over its images, with rate, realtime factor and time left, on stderr."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %  {task.fields[speed]}  left"),
        TimeRemainingColumn(),
    )
    spans_s = {
        traversal.name: (traversal.route.end_ns - traversal.route.start_ns) / 1e9 for traversal in scenario.traversals
    }
    console = err()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        tasks = {name: bars.add_task(f"{name}.mcap", total=None, start=False, speed="") for name in spans_s}
        began: dict[str, float] = {}

        def advance(name: str, done: int, total: int) -> None:
            if name not in began:
                began[name] = time.monotonic()
                bars.start_task(tasks[name])
            spent_s = max(time.monotonic() - began[name], 1e-3)
            speed = f"{done / spent_s:.1f} images/s  {spans_s[name] * done / total / spent_s:.1f} x realtime"
            bars.update(tasks[name], completed=done, total=total, speed=speed)

        yield advance


def to_document(recorded: RecordedScenario, total_s: float) -> dict[str, object]:
    """What was written, as JSON values."""
    truth = recorded.ground_truth
    return {
        "scenario": truth.scenario,
        "seed": truth.seed,
        "recordings": [
            {
                "path": str(path),
                "traversal": traversal.name,
                "seconds": round((traversal.end_ns - traversal.start_ns) / 1e9, 3),
                "bytes": path.stat().st_size,
                "detection_images": len(traversal.stamps_ns),
            }
            for path, traversal in zip(recorded.recordings, truth.traversals, strict=True)
        ],
        "truth": str(recorded.truth),
        "objects": sum(true_object.kind == "object" for true_object in truth.objects),
        "people": sum(true_object.kind == "person" for true_object in truth.objects),
        "changes": len(truth.changes),
        "questions": len(truth.questions),
        "total_s": round(total_s, 3),
        "timings": [asdict(timing) for timing in recorded.timings],
    }


def _print(recorded: RecordedScenario, total_s: float) -> None:
    console, truth = common.out(), recorded.ground_truth
    recorded_s = sum((traversal.end_ns - traversal.start_ns) / 1e9 for traversal in truth.traversals)
    console.print(
        f"{truth.scenario}, seed {truth.seed}: {recorded_s:.1f} s recorded in {total_s:.1f} s "
        f"({recorded_s / max(total_s, 1e-9):.1f} x realtime)",
        markup=False,
    )
    for path, traversal in zip(recorded.recordings, truth.traversals, strict=True):
        seconds, size = (traversal.end_ns - traversal.start_ns) / 1e9, path.stat().st_size / 1e6
        console.print(
            f"  {path}: {seconds:.1f} s, {size:.0f} MB, {len(traversal.stamps_ns)} images with detections", markup=False
        )
    objects, people = (sum(true_object.kind == kind for true_object in truth.objects) for kind in ("object", "person"))
    console.print(
        f"  {recorded.truth}: {objects} objects, {people} people, {len(truth.changes)} changes, "
        f"{len(truth.questions)} questions",
        markup=False,
    )
    db = recorded.truth.parent / "map.db"
    paths = " ".join(shlex.quote(str(path)) for path in recorded.recordings)
    console.print("\nNext:", markup=False)
    console.print(f"  supermap build {paths} --db {shlex.quote(str(db))}", markup=False, soft_wrap=True)
    truth_path = shlex.quote(str(recorded.truth))
    console.print(f"  supermap eval all {shlex.quote(str(db))} {truth_path}", markup=False, soft_wrap=True)


def _list(*, as_json: bool) -> None:
    """The scenarios, the rigs, and the detector's errors with their defaults."""
    from supermap_cli.simulation.detection.detector_errors import DetectorErrors  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.simulation.domains.axes import AXES  # noqa: PLC0415
    from supermap_cli.simulation.rigs import RIGS  # noqa: PLC0415
    from supermap_cli.simulation.scenarios import SCENARIOS  # noqa: PLC0415

    errors = DetectorErrors.model_fields
    if as_json:
        print_json(
            {
                "scenarios": [{"name": name, "description": text} for name, text in SCENARIOS.items()],
                "rigs": [{"name": name, "description": text} for name, text in RIGS.items()],
                "axes": [
                    {
                        "name": axis.name,
                        "description": axis.text,
                        "usual": axis.usual,
                        "levels": [{"name": name, "description": level.text} for name, level in axis.levels.items()],
                    }
                    for axis in AXES.values()
                ],
                "errors": [
                    {"name": name, "default": field.default, "description": field.description or ""}
                    for name, field in errors.items()
                ],
            }
        )
        return
    console = common.out()
    print_table(console, "", ("scenario", "what it is"), SCENARIOS.items())
    print_table(console, "", ("--rig", "what it is"), RIGS.items())
    levels = (
        (f"{axis.name}={name}" + (" *" if name == axis.usual else ""), f"{axis.text}: {level.text}")
        for axis in AXES.values()
        for name, level in axis.levels.items()
    )
    print_table(console, "", ("--domain (* usual)", "what it is"), levels)
    rows = ((name, f"{field.default:g}", field.description or "") for name, field in errors.items())
    print_table(console, "", ("--error", "default#", "of the detector"), rows)
