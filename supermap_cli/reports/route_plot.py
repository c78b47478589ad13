"""A route as a picture from above: free floor, obstacles, the way, and the things that it leads to."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from supermap_cli.navigation.grid import FREE, OCCUPIED, OccupancyGrid
from supermap_cli.navigation.route import GoalThing, PlannedRoute, Waypoint
from supermap_cli.output_files import replace_file
from supermap_cli.printable import printable_line
from supermap_cli.query.views import box_of
from supermap_cli.reports.diff_plot import check_plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_UNKNOWN, _FREE, _OCCUPIED, _DRIVEN = "#d1d6db", "#ffffff", "#404752", "#c7dbf2"
"""Of cells; `_DRIVEN` is floor that was not seen, but driven over."""
_WAY, _GOAL, _OTHER = "#2563a8", "#15803d", "#b45309"
_MARGIN_M = 0.5
"""m around the grid: room for the names of what stands at its edge. Chosen."""
_INCHES = 9.0
"""Width of the picture in inches, at most half of its height: an A4 page is as wide. Chosen."""


def draw_route(route: PlannedRoute, grid: OccupancyGrid, path: Path) -> None:
    """Write the picture (.png, .svg or .pdf). Raises `SupermapError` if it cannot be written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - keeps start-up light
    from matplotlib.figure import Figure  # noqa: PLC0415

    nx, ny = grid.cells.shape
    figure = Figure(figsize=(_INCHES, min(2 * _INCHES, _INCHES * ny / nx) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    _draw_floor(axes, grid)
    x, y, _ = route.start.position
    axes.plot([x], [y], "o", color=_WAY, markersize=7, zorder=5)
    axes.annotate("start", (x, y), xytext=(5, 5), textcoords="offset points", color=_WAY, fontsize=8)
    for number, waypoint in enumerate(route.waypoints, start=1):
        _draw_waypoint(axes, number, waypoint, route.robot_radius_m)
    axes.set(aspect="equal", title=printable_line(route.instruction), xlabel="x (m)", ylabel="y (m)")
    content = BytesIO()
    figure.savefig(content, dpi=130, format=path.suffix.lower().removeprefix("."))
    check_plot(path)
    replace_file(path, content.getvalue())


def _draw_floor(axes: Axes, grid: OccupancyGrid) -> None:
    from matplotlib.colors import to_rgb  # noqa: PLC0415 - keeps start-up light

    image = np.full((*grid.cells.shape, 3), to_rgb(_UNKNOWN))
    image[grid.driven] = to_rgb(_DRIVEN)
    image[grid.cells == FREE] = to_rgb(_FREE)
    image[grid.cells == OCCUPIED] = to_rgb(_OCCUPIED)
    axes.set_facecolor(_UNKNOWN)
    (x0, y0), (x1, y1) = grid.origin_xy, grid.origin_xy + np.array(grid.cells.shape) * grid.cell_m
    axes.imshow(image.swapaxes(0, 1), origin="lower", extent=(x0, x1, y0, y1), interpolation="nearest")
    axes.set(xlim=(x0 - _MARGIN_M, x1 + _MARGIN_M), ylim=(y0 - _MARGIN_M, y1 + _MARGIN_M))


def _draw_waypoint(axes: Axes, number: int, waypoint: Waypoint, radius_m: float) -> None:
    from matplotlib.patches import Circle  # noqa: PLC0415 - keeps start-up light

    for thing in waypoint.candidates:
        _draw_thing(axes, thing, thing.id, _OTHER)
    if waypoint.thing is not None:
        gone = waypoint.status == "gone"
        name = f"{number}: {waypoint.thing.id}" + (" (gone)" if gone else "")
        _draw_thing(axes, waypoint.thing, name, _OTHER if waypoint.pose is None else _GOAL, dashed=gone)
    if waypoint.pose is None:
        return
    way = np.array(waypoint.way)
    axes.plot(way[:, 0], way[:, 1], color=_WAY, linewidth=1.6, zorder=4)
    x, y, _ = waypoint.pose.position
    ahead = 1.8 * radius_m * np.array([np.cos(waypoint.pose.yaw), np.sin(waypoint.pose.yaw)])
    axes.add_patch(Circle((x, y), radius_m, facecolor=_GOAL + "33", edgecolor=_GOAL, zorder=5))
    arrow = {"arrowstyle": "-|>", "color": _GOAL, "linewidth": 1.6}
    axes.annotate("", xy=(x + ahead[0], y + ahead[1]), xytext=(x, y), arrowprops=arrow, zorder=6)


def _draw_thing(axes: Axes, thing: GoalThing, name: str, colour: str, *, dashed: bool = False) -> None:
    from matplotlib.patches import Polygon  # noqa: PLC0415 - keeps start-up light

    corners = box_of(thing.box).footprint()
    line = "--" if dashed else "-"
    axes.add_patch(Polygon(corners, closed=True, facecolor=colour + "33", edgecolor=colour, linestyle=line, zorder=3))
    x, y = corners.mean(axis=0)
    ground = {"boxstyle": "round,pad=0.15", "facecolor": (1, 1, 1, 0.8), "edgecolor": "none"}
    text = printable_line(name)
    axes.text(x, y, text, fontsize=7, color=colour, weight="bold", ha="center", va="center", bbox=ground, zorder=7)
