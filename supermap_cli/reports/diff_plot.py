"""A diff as an image: the map before and after, from above."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from supermap_cli.errors import SupermapError
from supermap_cli.memory.reading import MapReader
from supermap_cli.output_files import check_output, replace_file
from supermap_cli.query.diff import Diff
from supermap_cli.reports.diff_plan import Panel, before_after_panels
from supermap_cli.reports.floor_plan import Outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "appeared": "#15803d",
    "disappeared": "#c0152f",
    "moved": "#b45309",
    "relabelled": "#6d28d9",
    "unchanged": "#8c99a7",
    "not-observed-again": "#2563a8",
    "first-observed": "#2563a8",
    "not-looked-at": "#8c99a7",
    "at-neither": "#8c99a7",
    "doubted": "#8c99a7",
}
HOLLOW = frozenset({"not-observed-again", "first-observed", "not-looked-at", "at-neither", "doubted"})
"""Kinds of which no picture shows that they stand there on both sides."""
SUFFIXES = (".png", ".svg", ".pdf")


def check_plot(path: Path) -> None:
    """Raises `SupermapError` for an unsupported image suffix or a file of another kind, before anything is computed."""
    if path.suffix.lower() not in SUFFIXES:
        raise SupermapError("a picture of an unknown kind", where=str(path), cure="name a .png, .svg or .pdf file")
    check_output(path, path.suffix.lower().removeprefix("."), option="--plot")


def draw_diff(diff: Diff, reader: MapReader, path: Path) -> None:
    """Write the image (.png, .svg or .pdf). Raises `SupermapError` if it cannot be written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - keeps start-up light
    from matplotlib.figure import Figure  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    panels = before_after_panels(diff, reader)
    width, height = panels[0].extent.size_px
    figure = Figure(figsize=(14.0, 7.0 * height / width + 1.1), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, panel in zip(figure.subplots(1, 2, sharex=True, sharey=True), panels, strict=True):
        _draw_panel(axes, panel)
    counted = {kind: count for kind, count in diff.counts.items() if count}
    handles = [
        Patch(facecolor=COLOURS[kind.replace(" ", "-")], alpha=0.6, label=f"{kind} ({count})")
        for kind, count in counted.items()
    ]
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    content = BytesIO()
    figure.savefig(content, dpi=130, format=path.suffix.lower().removeprefix("."))
    check_plot(path)
    replace_file(path, content.getvalue())


def _draw_panel(axes: Axes, panel: Panel) -> None:
    for trajectory in panel.trajectories:
        axes.plot(trajectory[:, 0], trajectory[:, 1], color="#a9c3e2", linewidth=0.9, zorder=1)
    for outline in panel.outlines:
        _draw_outline(axes, outline)
    for arrow in panel.arrows:
        axes.annotate(
            "",
            xy=(float(arrow.end[0]), float(arrow.end[1])),
            xytext=(float(arrow.start[0]), float(arrow.start[1])),
            arrowprops={"arrowstyle": "-|>", "color": COLOURS["moved"], "linewidth": 1.3},
            zorder=6,
        )
    (x0, y0), (x1, y1) = panel.extent.low, panel.extent.high
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", title=panel.title, xlabel="x (m)", ylabel="y (m)")
    axes.grid(color="#eef1f4", linewidth=0.6)
    axes.set_axisbelow(True)


def _draw_outline(axes: Axes, outline: Outline) -> None:
    from matplotlib.patches import Polygon  # noqa: PLC0415 - keeps start-up light
    from matplotlib.patheffects import withStroke  # noqa: PLC0415

    kind, ghost = outline.style.removesuffix(" ghost"), outline.style.endswith(" ghost")
    hollow = ghost or kind in HOLLOW
    colour, unchanged = COLOURS[kind], kind == "unchanged"
    axes.add_patch(
        Polygon(
            outline.corners,
            closed=True,
            facecolor="none" if hollow else colour + "66",
            edgecolor=colour,
            linestyle="--" if hollow else "-",
            linewidth=0.8 if unchanged else 1.4,
            zorder=2 if unchanged else 3,
        )
    )
    if outline.label:
        x, y = outline.corners.mean(axis=0)
        name = axes.text(
            x,
            y,
            outline.label,
            fontsize=4.5 if unchanged else 7,
            color="#6b7885" if unchanged else colour,
            weight="normal" if unchanged else "bold",
            ha="center",
            va="center",
            zorder=4 if unchanged else 5,
        )
        name.set_path_effects([withStroke(linewidth=1.2, foreground="white")])
