"""`supermap export`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from supermap_cli.commands.common import AtOption, DbOption, database_url, err, sane

if TYPE_CHECKING:
    from supermap_cli.exporting.selection import ExportSource

EXAMPLES = """
Examples:

    supermap export --out office.json

    supermap export --out plan.geojson --traversal monday

    supermap export --out cloud.ply --label chair --label "dining table"

    supermap export --format csv --out tables

    supermap export --format geojson --out - --at 10:21

    supermap export --out grid.yaml --robot-height 0.5

    supermap export --out plan.png --traversal tuesday

    supermap export --out scene.glb --colours instance

    supermap export --out graph.graphml

    supermap export --out map.mcap --traversal monday

    supermap export --out map.rrd
"""
STDOUT = Path("-")


@dataclass(frozen=True)
class ExportTarget:
    """The path and the options of an export."""

    path: Path
    force: bool
    observations: bool
    ascii_text: bool
    by_instance: bool = False
    robot_height_m: float | None = None


class Colours(StrEnum):
    """Colours of points."""

    SEEN = "seen"
    INSTANCE = "instance"


class Format(StrEnum):
    """Export formats."""

    JSON = "json"
    GEOJSON = "geojson"
    PLY = "ply"
    CSV = "csv"
    PARQUET = "parquet"
    GRID = "grid"
    SVG = "svg"
    PNG = "png"
    OBJECTS = "objects"
    GLB = "glb"
    GRAPHML = "graphml"
    DOT = "dot"
    MCAP = "mcap"
    RRD = "rrd"


_SUFFIXES = {
    **{f".{kind}": kind for kind in Format if kind not in {Format.CSV, Format.PARQUET, Format.OBJECTS, Format.GRID}},
    ".csv": Format.OBJECTS,
    ".gv": Format.DOT,
    ".yaml": Format.GRID,
    ".yml": Format.GRID,
}
"""Suffix -> format; a folder of tables has none, and one CSV file is that of the objects."""
_CURRENT_STATE_FORMATS = frozenset(
    {Format.GEOJSON, Format.PLY, Format.SVG, Format.PNG, Format.OBJECTS, Format.GLB, Format.DOT}
)
_TO_STDOUT = frozenset({Format.JSON, Format.GEOJSON, Format.OBJECTS, Format.GRAPHML, Format.DOT})


RobotHeightOption = Annotated[
    float | None,
    typer.Option(min=0.05, max=10, callback=sane, help="grid: m that must be free. [default: just above its cameras]"),
]
ColoursOption = Annotated[Colours, typer.Option(help="ply, glb: points as they were seen, or by instance.")]


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(export)


def export(  # noqa: PLR0917 - the options of the command
    out: Annotated[
        Path,
        typer.Option(
            metavar="PATH",
            help="The file, or the folder for tables; - is stdout, for formats of text.",
            show_default=False,
        ),
    ],
    db: DbOption = None,
    format_: Annotated[
        Format | None,
        typer.Option("--format", help="One of those below. [default: by the file's suffix]", show_default=False),
    ] = None,
    label: Annotated[list[str] | None, typer.Option(help="Only what has this label; may be repeated.")] = None,
    present: Annotated[
        bool | None,
        typer.Option(
            "--present/--all",
            help="What stands now, or all that ever did; with --at, then. [default: --all for json, graphml and "
            "tables, else --present; with --at, what stood and what perhaps did]",
            show_default=False,
        ),
    ] = None,
    traversal: Annotated[str | None, typer.Option(help="What this traversal saw, where it saw it.")] = None,
    at: AtOption = None,
    observations: Annotated[
        bool, typer.Option("--observations", help="json: every observation, too, without its crop.")
    ] = False,
    ascii_text: Annotated[bool, typer.Option("--ascii", help="ply: as text instead of binary.")] = False,
    robot_height: RobotHeightOption = None,
    colours: ColoursOption = Colours.SEEN,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Write the memory for other programs: documents, plans, 3D scenes, graphs, or tables.

    `json`: everything, by the schema `export`. `svg`, `png`: a floor plan with things, ways and changes. `geojson`:
    footprints and the robot's ways from above, in metres. `ply`: the objects' voxels with colour, instance and label.
    `glb`: boxes and points for 3D viewers. `mcap`: ROS 2 messages for Foxglove and RViz, with the recordings' stamps.
    `rrd`: keyframes, objects and changes over time for Rerun (extra `rerun`).
    `graphml`, `dot`: relations and changes as a graph. `objects` (.csv): a table of objects. `csv`, `parquet`: a folder
    with a file for each table. `grid` (.yaml): the floor as nav2's map_server reads it, with a PGM picture beside it.
    With --at, what left or came within a gap in which nobody looked is in it, its `presence` "unknown", with the bounds
    of that gap. An export that is stopped leaves nothing half.
    """
    from supermap_cli.exporting.selection import ExportSource, select_part  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory import open_store  # noqa: PLC0415
    from supermap_cli.output_files import refuse_files_of  # noqa: PLC0415

    chosen = format_ or _SUFFIXES.get(out.suffix.lower())
    by_instance = colours is Colours.INSTANCE
    chosen_part = bool(label) or present is not None or traversal is not None or at is not None
    _check_usage(chosen, out, observations=observations, ascii_text=ascii_text, by_instance=by_instance)
    _check_grid(chosen, part=chosen_part, height=robot_height is not None)
    assert chosen is not None  # noqa: S101 - `_check_usage` holds that
    presences = _presences(chosen, present, traversal=traversal is not None, at=at is not None)
    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        if store.file is not None and out != STDOUT:
            refuse_files_of(store.file, out, option="--out")
        selection = select_part(reader, label or (), presences=presences, traversal=traversal, at=at)
        with _progress(f"writing {chosen}") as progress:
            source = ExportSource(reader, selection, progress)
            target = ExportTarget(out, force, observations, ascii_text, by_instance, robot_height)
            summary = _WRITERS[chosen](source, target)
    if out != STDOUT:
        err().print(f"{out}: {summary}", markup=False)


def _presences(chosen: Format, present: bool | None, *, traversal: bool, at: bool) -> frozenset[str]:
    """The exported presences: today's, or as of a time those of then.

    Demoted instances ("doubted") are only exported with everything.
    """
    from supermap_cli.exporting.selection import (  # noqa: PLC0415 - keeps start-up light
        ALL_PRESENCES,
        ANY_PRESENCE_AT,
        BELIEVED,
        POSSIBLY_PRESENT,
        PRESENT,
    )

    if present or (present is None and chosen in _CURRENT_STATE_FORMATS and not (traversal or at)):
        return PRESENT
    if at:
        return POSSIBLY_PRESENT if present is None else ANY_PRESENCE_AT
    return BELIEVED if traversal else ALL_PRESENCES


def _check_usage(chosen: Format | None, out: Path, *, observations: bool, ascii_text: bool, by_instance: bool) -> None:
    if chosen is None:
        raise typer.BadParameter(f"say --format {', '.join(Format)}", param_hint="--out")
    if out == STDOUT and chosen not in _TO_STDOUT:
        raise typer.BadParameter(f"{chosen} needs a path", param_hint="--out")
    if observations and chosen is not Format.JSON:
        raise typer.BadParameter("is for json; folders of tables have them always", param_hint="--observations")
    if ascii_text and chosen is not Format.PLY:
        raise typer.BadParameter("is for ply", param_hint="--ascii")
    if by_instance and chosen not in {Format.PLY, Format.GLB}:
        raise typer.BadParameter("is for ply and glb", param_hint="--colours")


def _check_grid(chosen: Format | None, *, part: bool, height: bool) -> None:
    if chosen is Format.GRID and part:
        raise typer.BadParameter("a grid is of the whole map as it is now", param_hint="--label, --at, --traversal")
    if chosen is not Format.GRID and height:
        raise typer.BadParameter("is for grid", param_hint="--robot-height")


def _json(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.document import write_document  # noqa: PLC0415 - keeps start-up light

    with _text_file(target, "json") as file:
        write_document(source, file, observations=target.observations)
    return _size(target.path)


def _geojson(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.geojson import write_geojson  # noqa: PLC0415 - keeps start-up light

    with _text_file(target, "geojson") as file:
        write_geojson(source, file)
    return _size(target.path)


def _ply(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415
    from supermap_cli.exporting.ply import write_ply  # noqa: PLC0415 - keeps start-up light

    with atomic_file(target.path, "ply", force=target.force) as unfinished:
        count = write_ply(source, unfinished, ascii_text=target.ascii_text, by_instance=target.by_instance)
    return f"{count} points, {_size(target.path)}"


def _csv(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.csv_tables import FILES, write_csv_tables  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.exporting.destination import atomic_folder  # noqa: PLC0415

    with atomic_folder(target.path, FILES, "csv", force=target.force) as unfinished:
        return _rows(write_csv_tables(source, unfinished))


def _parquet(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_folder  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.exporting.parquet_tables import FILES, write_parquet_tables  # noqa: PLC0415

    with atomic_folder(target.path, FILES, "parquet", force=target.force) as unfinished:
        return _rows(write_parquet_tables(source, unfinished))


def _plan(source: ExportSource, target: ExportTarget, kind: str) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.exporting.plan import write_plan  # noqa: PLC0415

    with atomic_file(target.path, kind, force=target.force) as unfinished:
        count = write_plan(source, unfinished, kind)
    return f"{count} things, {_size(target.path)}"


def _glb(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415
    from supermap_cli.exporting.glb import write_glb  # noqa: PLC0415 - keeps start-up light

    with atomic_file(target.path, "glb", force=target.force) as unfinished:
        boxes, points = write_glb(source, unfinished, by_instance=target.by_instance)
    return f"{boxes} boxes, {points} points, {_size(target.path)}"


def _objects(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.csv_tables import write_objects_csv  # noqa: PLC0415 - keeps start-up light

    with _text_file(target, "csv") as file:
        count = write_objects_csv(source, file)
    return f"{count} objects, {_size(target.path)}"


def _graph(source: ExportSource, target: ExportTarget, kind: str) -> str:
    from supermap_cli.exporting.graphs import write_dot, write_graphml  # noqa: PLC0415 - keeps start-up light

    write = write_graphml if kind == Format.GRAPHML else write_dot
    with _text_file(target, kind) as file:
        nodes, edges = write(source, file)
    return f"{nodes} nodes, {edges} edges, {_size(target.path)}"


def _mcap(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415
    from supermap_cli.exporting.ros.layout import SUFFIX, layout_json  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.exporting.ros.recording import write_mcap  # noqa: PLC0415

    layout = target.path.with_suffix(SUFFIX)
    with (
        atomic_file(target.path, "map recording", force=target.force) as unfinished,
        atomic_file(layout, "layout", force=target.force) as unfinished_layout,
    ):
        counts = write_mcap(source, unfinished)
        unfinished_layout.write_text(layout_json(), encoding="utf-8")
    return f"{sum(counts.values())} messages on {len(counts)} topics, {_size(target.path)}; with {layout.name}"


def _rrd(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415
    from supermap_cli.exporting.rerun_file import check_rerun, write_rrd  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.plugin_manager import load_plugins  # noqa: PLC0415

    check_rerun()
    with atomic_file(target.path, "rrd", force=target.force) as unfinished:
        count = write_rrd(source, unfinished, load_plugins())
    return f"{count} keyframes, {_size(target.path)}"


def _grid(source: ExportSource, target: ExportTarget) -> str:
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.exporting.map_server import grid_pgm, grid_yaml  # noqa: PLC0415
    from supermap_cli.navigation.observed_space import occupancy_grid  # noqa: PLC0415

    image = target.path.parent / f"{target.path.stem}.pgm"
    with (
        atomic_file(target.path, "map_server", force=target.force) as partial,
        atomic_file(image, "pgm", force=target.force) as partial_image,
    ):
        grid = occupancy_grid(source.reader, target.robot_height_m)
        partial_image.write_bytes(grid_pgm(grid))
        partial.write_text(grid_yaml(grid, image), encoding="utf-8")
    width, height = grid.cells.shape
    areas = ", ".join(f"{area:.1f} m2 {kind}" for kind, area in grid.counts().items())
    return f"with {image.name}, {width} x {height} cells of {grid.cell_m:g} m: {areas}"


_WRITERS: dict[Format, Callable[[ExportSource, ExportTarget], str]] = {
    Format.JSON: _json,
    Format.GEOJSON: _geojson,
    Format.PLY: _ply,
    Format.CSV: _csv,
    Format.PARQUET: _parquet,
    Format.GRID: _grid,
    Format.SVG: partial(_plan, kind="svg"),
    Format.PNG: partial(_plan, kind="png"),
    Format.OBJECTS: _objects,
    Format.GLB: _glb,
    Format.GRAPHML: partial(_graph, kind="graphml"),
    Format.MCAP: _mcap,
    Format.RRD: _rrd,
    Format.DOT: partial(_graph, kind="dot"),
}


@contextmanager
def _text_file(target: ExportTarget, kind: str) -> Iterator[TextIO]:
    """A text file that gets its name when complete; or stdout."""
    from supermap_cli.exporting.destination import atomic_file  # noqa: PLC0415 - keeps start-up light

    if target.path == STDOUT:
        yield sys.stdout
        return
    with (
        atomic_file(target.path, kind, force=target.force) as unfinished,
        unfinished.open("w", encoding="utf-8") as file,
    ):
        yield file


@contextmanager
def _progress(what: str) -> Iterator[Callable[[str, int], None] | None]:
    """A spinner on stderr with the number of rows, if it is a terminal."""
    console = err()
    if not console.is_terminal:
        yield None
        return
    with console.status(what) as status:
        yield lambda name, count: status.update(f"{what}: {count} {name.replace('_', ' ')}")


def _rows(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items())


def _size(out: Path) -> str:
    if out == STDOUT:
        return ""
    size = out.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
