"""`supermap build`: recordings in, memory out."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.build_options import override, request
from supermap_cli.commands.common import (
    AlignOption,
    BackendOption,
    CameraOption,
    ClockOption,
    DbOption,
    DetectionToleranceOption,
    DetectorOption,
    EndOption,
    FrameOption,
    JsonOption,
    MountOption,
    OdometryOption,
    RateOption,
    RecordingLimitOption,
    RigOption,
    RobotOption,
    SegmenterOption,
    StartOption,
    TopicOption,
    TrackerOption,
    WaitOption,
    database_url,
    err,
    interrupt_on_sigterm,
    out,
    print_json,
    sane,
    waiting,
)
from supermap_cli.commands.failed_builds import remembered
from supermap_cli.commands.viewers import RerunConnectOption, RerunOption, RerunSaveOption, viewers
from supermap_cli.errors import BuildStoppedError, ConfigError, SupermapError

if TYPE_CHECKING:
    from supermap_cli.config import BuildConfig
    from supermap_cli.drivers.build_summary import BuildSummary
    from supermap_cli.drivers.stopped_builds import Unfinished
    from supermap_cli.drivers.traversal_build import Progress, TraversalBuild
    from supermap_cli.hookspecs import RecordingRequest
    from supermap_cli.memory.store import MapStore
    from supermap_cli.plugin_manager import Plugins
    from supermap_cli.protocols import Recording

EXAMPLES = """
Examples:

    supermap build run.mcap

    supermap build monday.mcap tuesday.mcap --db office.db

    supermap build run.bag --detector onnx --option onnx.model=yolox_nano.onnx

    supermap build run.mcap --topic color=/cam/image_raw --topic depth=/cam/depth --start 10 --end 60

    supermap build run.mcap --topic color.front=/front/image_raw --topic color.left=/left/image_raw

    supermap build run.mcap --min-confidence 0.8

    supermap build run.mcap --resume

    supermap build run.mcap --rerun-save run.rrd
"""


RecordingsArgument = Annotated[
    list[Path], typer.Argument(help="ROS 1 .bag, ROS 2 .db3 or .mcap files, or rosbag2 folders; one traversal each.")
]
PerceptionRateOption = Annotated[
    float | None,
    typer.Option(
        callback=sane, help="Images perceived a second, the others give depth. [default: all that are mapped]"
    ),
]
NameOption = Annotated[str | None, typer.Option(help="Name of the traversal. [default: the file's name]")]
MinConfidenceOption = Annotated[
    float | None,
    typer.Option(
        metavar="P",
        help="Probability of being right (there, and rightly called) from which an object enters the map, between "
        "0 and 1: higher, and less is wrong and more is missing. None is surer than about 0.97. [default: 0.5]",
    ),
]
AblateOption = Annotated[
    list[str] | None,
    typer.Option(help="Switch a component off: tracker, semantic-fusion or geometric-consistency."),
]
ResumeOption = Annotated[
    bool,
    typer.Option("--resume", help="Resume a stopped build; what is in the map already is passed over."),
]
RestartOption = Annotated[bool, typer.Option("--restart", help="Remove what a stopped build wrote, and start again.")]
AgainOption = Annotated[bool, typer.Option("--again", help="Build a recording that is in the map once more.")]


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(build)


def build(  # noqa: PLR0917 - a command line has many options
    recordings: RecordingsArgument,
    db: DbOption = None,
    detector: DetectorOption = None,
    odometry: OdometryOption = None,
    segmenter: SegmenterOption = None,
    tracker: TrackerOption = None,
    option: BackendOption = None,
    topic: TopicOption = None,
    frame: FrameOption = None,
    mount: MountOption = None,
    rig: RigOption = None,
    clock: ClockOption = None,
    robot: RobotOption = None,
    camera: CameraOption = None,
    detection_tolerance: DetectionToleranceOption = None,
    limit: RecordingLimitOption = None,
    start: StartOption = None,
    end: EndOption = None,
    rate: RateOption = None,
    perception_rate: PerceptionRateOption = None,
    min_confidence: MinConfidenceOption = None,
    align: AlignOption = "auto",
    name: NameOption = None,
    ablate: AblateOption = None,
    resume: ResumeOption = False,
    restart: RestartOption = False,
    again: AgainOption = False,
    wait: WaitOption = 30.0,
    rerun: RerunOption = False,
    rerun_connect: RerunConnectOption = None,
    rerun_save: RerunSaveOption = None,
    as_json: JsonOption = False,
) -> None:
    """Build recordings into the map database, one traversal each.

    Ctrl-C finishes the keyframes at work and keeps what is mapped; --resume goes on from there, also after a crash, and
    ends in the same memory.
    """
    from supermap_cli.config import load_user_config  # noqa: PLC0415 - heavy imports only when a build starts

    _check_name(name, recordings)
    watched = viewers(database_url(db), spawn=rerun, connect=rerun_connect, save=rerun_save)
    follow = Follow(_unfinished(resume=resume, restart=restart), again, name, align, wait, watched)
    config = override(
        load_user_config(Path.cwd()).build,
        detector=detector,
        odometry=odometry,
        segmenter=segmenter,
        tracker=tracker,
        options=option,
        topics=topic,
        frames=frame,
        mounts=mount,
        rig=rig,
        clocks=clock,
        robot=robot,
        camera=camera,
        detection_tolerance=detection_tolerance,
        limits=limit,
        rate=rate,
        perception_rate=perception_rate,
        min_confidence=min_confidence,
        ablate=ablate,
    )
    wanted = request(config, start, end)
    summaries: list[BuildSummary] = []
    with _told_at_the_end(summaries, as_json=as_json):
        for summary in build_all(recordings, config, wanted, database_url(db), follow):
            _print_warnings(summary)
            summaries.append(summary)
            if not as_json:
                print_summary(summary, database_url(db))


def _check_name(name: str | None, recordings: list[Path]) -> None:
    """Raise `ConfigError` for a name that is none, or that several traversals would have."""
    if name is None:
        return
    from supermap_cli.memory.names import checked_name  # noqa: PLC0415 - keeps start-up light

    checked_name(name)
    if len(recordings) > 1:
        raise ConfigError("--name names one traversal", cure="build the recordings one by one")


def _print_warnings(summary: BuildSummary) -> None:
    for warning in summary.warnings:
        err().print(f"warning: {warning}", markup=False)


@dataclass(frozen=True)
class Follow:
    """How recordings follow what is in the map: what becomes of a build that was stopped, whether one may be in the map
    already, its name, how it is placed, how long another program that writes is waited for, and which viewers are told.
    """

    unfinished: Unfinished = "refuse"
    again: bool = False
    name: str | None = None
    align: str = "auto"
    wait_s: float = 30.0
    viewers: Mapping[str, str] = field(default_factory=dict)


def _unfinished(*, resume: bool, restart: bool) -> Unfinished:
    """What becomes of a build that was stopped."""
    if resume and restart:
        raise ConfigError("a stopped build cannot both go on and begin anew", cure="give --resume or --restart")
    return "resume" if resume else "restart" if restart else "refuse"


def build_all(
    paths: list[Path], config: BuildConfig, wanted: RecordingRequest, url: str, follow: Follow
) -> Iterator[BuildSummary]:
    """Build one recording after the other into one database."""
    from supermap_cli.allocation import keep_freed_memory  # noqa: PLC0415 - heavy imports only when a build starts
    from supermap_cli.memory.opening import open_store  # noqa: PLC0415
    from supermap_cli.plugin_manager import load_plugins  # noqa: PLC0415

    interrupt_on_sigterm()
    keep_freed_memory()
    plugins = load_plugins()
    for broken in plugins.broken:
        err().print(f"warning: plugin {broken.name} is left out: {broken.error}", markup=False)
    with open_store(url, create=True, waiting=waiting(follow.wait_s)) as store:
        for path in paths:
            with remembered(path):
                summary = _build_one(path, config, wanted, store, plugins, follow)
            if summary is not None:
                yield summary


def _build_one(  # noqa: PLR0917 - what a build is made of
    path: Path,
    config: BuildConfig,
    wanted: RecordingRequest,
    store: MapStore,
    plugins: Plugins,
    follow: Follow,
) -> BuildSummary | None:
    """Build one recording; `None` where it is in the map already, and is to go on."""
    from supermap_cli.drivers.traversal_build import TraversalBuild  # noqa: PLC0415 - heavy

    began = time.perf_counter()
    recording = open_recording(path, wanted, plugins)
    if follow.unfinished == "resume" and (known := _complete(store, recording)) is not None:
        err().print(f"{path} is in the map already, as traversal {known!r}", markup=False)
        return None
    try:
        traversal = TraversalBuild(recording, plugins, config, store, began, viewers=follow.viewers)
    except SupermapError as error:
        error.add_warnings(recording.warnings)
        raise
    with progress_bar(path, recording) as progress, _told_what_is_kept(traversal):
        return traversal.run(
            name=follow.name,
            align=follow.align,
            progress=progress,
            unfinished=follow.unfinished,
            again=follow.again,
        )


def _complete(store: MapStore, recording: Recording) -> str | None:
    """The name of the complete traversal of a recording, if it is not being built again."""
    fingerprint = recording.fingerprint()
    if (unfinished := store.unfinished()) is not None and unfinished.fingerprint == fingerprint:
        return None
    known = (
        traversal
        for traversal in store.traversals()
        if traversal.fingerprint == fingerprint and traversal.status == "complete"
    )
    return next((traversal.name for traversal in known), None)


@contextmanager
def _told_what_is_kept(traversal: TraversalBuild) -> Iterator[None]:
    """Where a build fails, what it warned of is told with the error; where some keyframes were committed, that they are
    kept, and how to go on.
    """
    try:
        yield
    except BuildStoppedError as stopped:
        stopped.add_warnings(traversal.collected_warnings())
        raise
    except BaseException as error:
        if isinstance(error, SupermapError):
            error.add_warnings(traversal.collected_warnings())
        if traversal.kept_s is not None:
            kept = (
                f"the first {traversal.kept_s:.1f} s are in the map: --resume goes on from there, --restart begins anew"
            )
            if isinstance(error, SupermapError):
                error.warnings = (*error.warnings, kept)
            else:
                err().print(kept)
        raise


@contextmanager
def _told_at_the_end(summaries: list[BuildSummary], *, as_json: bool) -> Iterator[None]:
    """Print what was built as one document, also when a later recording fails."""
    try:
        yield
    finally:
        if as_json and summaries:
            print_json({"traversals": [summary_json(summary) for summary in summaries]})


def open_recording(path: Path, wanted: RecordingRequest, plugins: Plugins) -> Recording:
    """Open a recording by a plugin that knows its format, else as a bag."""
    from supermap_cli.recordings import open_bag_recording  # noqa: PLC0415

    opened = plugins.open_recording(path, wanted)
    return opened if opened is not None else open_bag_recording(path, wanted)


@contextmanager
def progress_bar(path: Path, recording: Recording) -> Iterator[Progress]:
    """A bar over the recording's time with rate, time left and realtime factor, on stderr."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    span_s = max((recording.end_ns - recording.start_ns) / 1e9, 1e-3)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %  {task.fields[speed]}  left"),
        TimeRemainingColumn(),
    )
    console = err()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(path.name, total=span_s, speed="placing")
        began = time.monotonic()

        def advance(stamp_ns: int, keyframes: int) -> None:
            done_s = (stamp_ns - recording.start_ns) / 1e9
            spent_s = max(time.monotonic() - began, 1e-3)
            speed = f"{keyframes / spent_s:.1f} keyframes/s  {done_s / spent_s:.1f} x realtime"
            bar.update(task, completed=done_s, speed=speed)

        yield advance


def print_summary(summary: BuildSummary, db: str) -> None:
    """What a build did, for people."""
    from rich.table import Table  # noqa: PLC0415

    console = out()
    total_s, stages_s = summary.total_s, sum(timing.total_s for timing in summary.timings)
    if summary.resumed_s is not None:
        console.print(f"{summary.traversal}: went on at {summary.resumed_s:.1f} s", markup=False)
    console.print(
        f"{summary.traversal}: {_keyframes(summary)} of {summary.recorded_s:.1f} s mapped in "
        f"{total_s:.1f} s ({summary.recorded_s / max(total_s, 1e-9):.1f} x realtime) into {db}",
        markup=False,
    )
    console.print("  " + ", ".join(f"{kind} {backend}" for kind, backend in summary.backends.items()), markup=False)
    console.print(f"  {summary.placement.method}", markup=False)
    counts = ", ".join(f"{n} {label}" for label, n in summary.statistics.labels.items())
    console.print(
        f"  {summary.statistics.detections} detections, {summary.statistics.observations} observations of "
        f"{summary.instances} objects in the map now: {counts}",
        markup=False,
    )
    if summary.instances == 0:
        console.print(f"  0 objects: {summary.statistics.funnel()}", markup=False)
    table = Table(box=None, pad_edge=False, padding=(0, 2))
    for heading in ("stage", "total s", "share", "runs", "mean ms", "p95 ms"):
        table.add_column(heading, justify="left" if heading == "stage" else "right")
    for timing in summary.timings:
        share = f"{100 * timing.total_s / max(stages_s, 1e-9):.0f} %"
        table.add_row(
            timing.stage,
            f"{timing.total_s:.2f}",
            share,
            str(timing.runs),
            f"{timing.mean_ms:.1f}",
            f"{timing.p95_ms:.1f}",
        )
    console.print(table)


def _keyframes(summary: BuildSummary) -> str:
    mapped, perceived = summary.statistics.keyframes, summary.statistics.perceived
    return f"{mapped} keyframes" + (f" ({perceived} of them perceived)" if perceived < mapped else "")


def summary_json(summary: BuildSummary) -> dict[str, object]:
    """What a build did, for programs."""
    return {
        "traversal": summary.traversal,
        "keyframes": summary.statistics.keyframes,
        "perceived": summary.statistics.perceived,
        "detections": summary.statistics.detections,
        "observations": summary.statistics.observations,
        "objects": summary.instances,
        "labels": summary.statistics.labels,
        "recorded_s": summary.recorded_s,
        "resumed_s": summary.resumed_s,
        "total_s": summary.total_s,
        "clock_shift_ns": summary.clock_shift_ns,
        "placed": summary.placement.method,
        "backends": summary.backends,
        "warnings": list(summary.warnings),
        "timings": [asdict(timing) for timing in summary.timings],
    }
