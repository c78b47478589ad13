"""Shared by commands: options, consoles, JSON output."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from supermap_cli.commands.whole_numbers import whole
from supermap_cli.config import load_user_config
from supermap_cli.errors import ConfigError

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.memory.databases.waiting import Waiting
    from supermap_cli.memory.store import MapStore

DEFAULT_DB = "supermap.db"

MOST = 4e9
"""No number on a command line is larger, of whatever unit. A window after a robot's clock was set by network begins
1.8e9 s after its first message; so many nanoseconds and a stamp fit into int64."""


def sane(parameter: typer.CallbackParam, value: float | None) -> float | None:
    """The callback of every option that takes a real number: neither NaN nor infinite, and not absurdly large."""
    if value is not None and not abs(value) <= MOST:
        raise ConfigError(
            f"{parameter.opts[0]} {value:g} is no number to work with", cure=f"give one between {-MOST:g} and {MOST:g}"
        )
    return value


DbOption = Annotated[
    str | None,
    typer.Option(
        "--db",
        metavar="PATH_OR_URL",
        help=f"The map database: a SQLite file or a database URL. [default: $SUPERMAP_DB, else {DEFAULT_DB}]",
        show_default=False,
    ),
]
TopicOption = Annotated[
    list[str] | None, typer.Option(metavar="ROLE=TOPIC", help="Which topic serves a role, e.g. color=/cam/image.")
]
FrameOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="ROLE=FRAME",
        help="The name of the `base` or `odom` frame, or the frame a `camera`, `lidar` or `imu` is in.",
    ),
]
MountOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME='[PARENT] X Y Z ROLL PITCH YAW'",
        help="Where a camera (x forward), lidar, imu or frame sits on the base or on a frame, in metres and radians.",
    ),
]
RigOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="The robot: a TOML file with frames, mounts, clocks, topics; or its URDF, for mountings that TF lacks.",
    ),
]
ClockOption = Annotated[
    list[str] | None,
    typer.Option(metavar="TOPIC=SECONDS", help="Seconds added to a topic's stamps, 0 to leave them as they are."),
]
RobotOption = Annotated[str | None, typer.Option(metavar="NAMESPACE", help="Which of several robots in the recording.")]
RecordingLimitOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="How much a recording may hold, e.g. image_pixels=200000000; see docs/configuration.md.",
    ),
]
DetectionToleranceOption = Annotated[
    float | None,
    typer.Option(
        callback=sane,
        metavar="SECONDS",
        help="Recorded detections belong to the nearest image in so many seconds. [default: 0.001]",
    ),
]
CameraOption = Annotated[str | None, typer.Option(help="Force a camera model: equirectangular.")]
StartOption = Annotated[
    float | None, typer.Option(callback=sane, help="Start, in seconds from the recording's first message.")
]
EndOption = Annotated[
    float | None, typer.Option(callback=sane, help="End, in seconds from the recording's first message.")
]
AtOption = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="TIME|TRAVERSAL",
        help="As of a time ('10:21', '2026-01-05T10:21:00Z', '12 s', 'earlier') or a traversal's end ('monday').",
    ),
]
LimitOption = Annotated[
    int,
    typer.Option(
        min=1, callback=whole, metavar="N", help="How many objects are listed, those seen last; counts are of all."
    ),
]
WaitOption = Annotated[
    float,
    typer.Option(
        min=0, max=86400, callback=sane, metavar="SECONDS", help="How long to wait while another program writes."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON by the published schema instead of a table.")]


def database_url(given: str | None) -> str:
    """The database: the option, else `SUPERMAP_DB`, else `supermap.toml`, else `supermap.db` in the current folder.

    Raises `ConfigError` for an option that is given and empty.
    """
    if given is not None and not given.strip():
        raise ConfigError("--db names nothing", cure="name a file or a URL, or leave --db out")
    return given or os.environ.get("SUPERMAP_DB") or load_user_config(Path.cwd()).db or DEFAULT_DB


def out() -> Console:
    """The console for results (stdout)."""
    return _console(stderr=False)


def err() -> Console:
    """The console for all other output (stderr)."""
    return _console(stderr=True)


def _console(*, stderr: bool) -> Console:
    """A console on which texts of recordings and maps cannot act."""
    from rich.console import Console  # noqa: PLC0415 - keeps start-up light

    from supermap_cli.printable import printable_paragraph  # noqa: PLC0415

    class SafeConsole(Console):
        def print(self, *objects: Any, **options: Any) -> None:
            texts = (printable_paragraph(each) if isinstance(each, str) else each for each in objects)
            super().print(*texts, **options)

    stream = sys.stderr if stderr else sys.stdout
    return SafeConsole(stderr=stderr, highlight=False, soft_wrap=not stream.isatty())


def waiting(seconds: float) -> Waiting:
    """Wait for other programs that write, and say so on stderr."""
    from supermap_cli.memory.databases.waiting import Waiting  # noqa: PLC0415 - keeps start-up light

    return Waiting(seconds, lambda message: err().print(message, markup=False))


def interrupt_on_sigterm() -> None:
    """SIGTERM raises `KeyboardInterrupt` from now on, as Ctrl-C does: work that is stopped politely cleans up."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)


def check_outputs(store: MapStore, named: Mapping[str, tuple[Path | None, str | None]]) -> None:
    """Refuse, before anything is computed, outputs that would be written over what they are no newer version of.

    `named` gives the path of an option and its kind (of `output_files.KINDS`; `None`: by its suffix). Raises
    `ExportError`.
    """
    from supermap_cli.output_files import check_output  # noqa: PLC0415 - keeps start-up light

    for option, (path, kind) in named.items():
        if path is not None:
            check_output(path, kind or path.suffix.lower().removeprefix("."), option=option, database=store.file)


@contextmanager
def kept_or_temporary(keep: Path | None) -> Iterator[Path]:
    """The folder `keep`, or a temporary one."""
    if keep is not None:
        yield keep
        return
    from supermap_cli.temporary_folders import temporary_folder  # noqa: PLC0415 - keeps start-up light

    with temporary_folder() as folder:
        yield folder


def print_json(value: object) -> None:
    """Print a JSON document on stdout."""
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))


DetectorOption = Annotated[str | None, typer.Option(help="The detector plugin. [default: recorded, else onnx]")]
OdometryOption = Annotated[str | None, typer.Option(help="The odometry plugin. [default: recorded, else kiss-icp]")]
SegmenterOption = Annotated[str | None, typer.Option(help="The segmenter plugin, for boxes without masks.")]
TrackerOption = Annotated[str | None, typer.Option(help="The tracker plugin.")]
BackendOption = Annotated[
    list[str] | None, typer.Option(metavar="BACKEND.NAME=VALUE", help="An option of a plugin; may be repeated.")
]
RateOption = Annotated[
    float | None, typer.Option(callback=sane, help="Images of each camera mapped per second. [default: 3]")
]
AlignOption = Annotated[
    str, typer.Option(metavar="auto|none|'X Y Z YAW'", help="How a further traversal is placed in the map.")
]
