"""A plan of a map drawn as SVG or PNG."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from supermap_cli.drawing.colours import colour_of, hex_of
from supermap_cli.drawing.label_places import Name, place_names
from supermap_cli.drawing.map_plan import MapPlan, PlanChange, PlanThing, Standing
from supermap_cli.drawing.observed_floor import ObservedFloor
from supermap_cli.drawing.text import figure_style, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS_PER_INCH = 72
WIDTH_IN, HEIGHTS_IN, DPI = 12.0, (5.0, 16.0), 150
"""Width and range of heights of a plan in inches, and pixels per inch of a PNG."""
_MARGINS_IN = (0.65, 0.2, 1.0, 0.5)
"""Left, right, bottom and top: axes, legend and title."""
NAME_PT, SMALL_PT = 6.5, 7.5
MOST_NAMES = 250
"""Things that are named on a plan: on a page, more are not read."""
UNSEEN, FREE = "#e3e6ea", "#ffffff"
_STRUCTURE_RGB = np.array([0.28, 0.32, 0.38])
WAY_COLOURS = ("#5b8def", "#7c3aed", "#0f9fa8", "#64748b")
STYLES: dict[Standing, tuple[str | None, Any, str]] = {
    "present": (None, "-", "stands there"),
    "unknown": ("#b45309", ":", "nobody can say"),
    "doubted": ("#6b7885", ":", "doubted: more likely not real"),
    "absent": ("#c0152f", "--", "gone"),
    "ended": ("#6b7885", "--", "stood there before"),
}
"""Standing -> its colour (`None`: that of its label), its line, and what the legend says."""
CHANGES = {
    "appeared": ("#15803d", "P", "appeared"),
    "reappeared": ("#15803d", "P", "came back"),
    "disappeared": ("#c0152f", "X", "disappeared"),
    "moved": ("#b45309", ">", "moved"),
}
"""Kind of change -> colour, marker, and what the legend says."""


def plan_picture(plan: MapPlan, image_format: str) -> bytes:
    """The picture as `svg` or `png`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - keeps start-up light
    from matplotlib.figure import Figure  # noqa: PLC0415

    low, high = plan.extent()
    left, right, bottom, top = _MARGINS_IN
    aspect = float((high - low)[1] / (high - low)[0])
    height_in = float(np.clip((WIDTH_IN - left - right) * aspect + bottom + top, *HEIGHTS_IN))
    with figure_style():
        figure = Figure(figsize=(WIDTH_IN, height_in))
        FigureCanvasAgg(figure)
        size_in = np.array([WIDTH_IN - left - right, height_in - bottom - top])
        axes: Any = figure.add_axes((left / WIDTH_IN, bottom / height_in, *(size_in / (WIDTH_IN, height_in))))
        draw_plan(axes, plan, size_in)
        axes.set_title(plain(plan.title), loc="left", fontsize=10, parse_math=False)
        axes.set_xlabel("x (m)", fontsize=SMALL_PT)
        axes.set_ylabel("y (m)", fontsize=SMALL_PT)
        axes.tick_params(labelsize=SMALL_PT)
        handles = _legend_handles(plan)
        figure.legend(handles=handles, loc="lower center", ncols=5, frameon=False, fontsize=SMALL_PT)
        content = BytesIO()
        metadata = {"Date": None} if image_format == "svg" else {}
        figure.savefig(content, dpi=DPI, format=image_format, metadata=metadata)
    return content.getvalue()


def draw_plan(axes: Axes, plan: MapPlan, size_in: Any, *, only: str | None = None) -> None:
    """Draw a plan on axes of a size (2,) in inches. With `only`, the thing of that id stands out, and it alone is
    named.
    """
    low, high = fitted(*plan.extent(), size_in)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", facecolor=UNSEEN)
    if plan.floor is not None:
        _draw_floor(axes, plan.floor)
    for number, way in enumerate(plan.ways):
        _draw_way(axes, way.points, WAY_COLOURS[number % len(WAY_COLOURS)])
    _draw_things(axes, plan.things, only)
    for change in plan.changes:
        _draw_change(axes, change)
    named = [thing for thing in plan.things if only is None or thing.id == only]
    _draw_names(axes, named, low, size_in * POINTS_PER_INCH, float(size_in[0] * POINTS_PER_INCH / (high - low)[0]))


def fitted(low: Any, high: Any, size_in: Any) -> tuple[Any, Any]:
    """The extent grown about its middle to the shape of axes of a size in inches."""
    middle, size = (low + high) / 2, high - low
    m_per_in = float((size / size_in).max())
    return middle - size_in * m_per_in / 2, middle + size_in * m_per_in / 2


def _draw_floor(axes: Axes, floor: ObservedFloor) -> None:
    rgba = np.zeros((*floor.free.shape, 4))
    rgba[floor.free] = (1, 1, 1, 1)
    solid = floor.structure > 0
    shade = 0.35 + 0.65 * floor.structure[solid][:, None]
    rgba[solid, :3] = 1 - shade * (1 - _STRUCTURE_RGB)
    rgba[solid, 3] = 1
    (x0, y0), (x1, y1) = floor.low.tolist(), floor.high.tolist()
    axes.imshow(rgba, extent=(x0, x1, y0, y1), origin="lower", interpolation="nearest", zorder=0)


def _draw_way(axes: Axes, points: Any, colour: str) -> None:
    if not len(points):
        return
    axes.plot(points[:, 0], points[:, 1], color=colour, linewidth=1.0, alpha=0.75, zorder=2)
    axes.plot(*points[0], marker="o", color=colour, markersize=5, markeredgecolor="white", zorder=4)
    axes.plot(*points[-1], marker="s", color=colour, markersize=5, markeredgecolor="white", zorder=4)


def _draw_things(axes: Axes, things: Sequence[PlanThing], only: str | None) -> None:
    """Low things last, so that the cup is seen on its table: a plan shows what lies on top by its outline."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415 - keeps start-up light

    for standing, (colour, line, _) in STYLES.items():
        chosen = sorted((thing for thing in things if thing.standing == standing), key=lambda thing: thing.z_max)
        if not chosen:
            continue
        colours = [colour or hex_of(colour_of(thing.label)) for thing in chosen]
        faint = [only is not None and thing.id != only for thing in chosen]
        filled = standing == "present"
        axes.add_collection(
            PolyCollection(
                [thing.corners for thing in chosen],
                facecolors=[
                    c + ("22" if pale else "77") if filled else "none" for c, pale in zip(colours, faint, strict=True)
                ],
                edgecolors=[c + ("55" if pale else "ff") for c, pale in zip(colours, faint, strict=True)],
                linestyles=line,
                linewidths=[1.0 if only is None or pale else 2.2 for pale in faint],
                zorder=3 if filled else 3.5,
            )
        )


def _draw_change(axes: Axes, change: PlanChange) -> None:
    colour, marker, _ = CHANGES[change.kind]
    if change.kind == "moved":
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", xy=tuple(change.end), xytext=tuple(change.start), arrowprops=arrow, zorder=6)
    else:
        axes.plot(*change.end, marker=marker, color=colour, markersize=7, markeredgecolor="white", zorder=6)


def _draw_names(axes: Axes, things: Sequence[PlanThing], low: Any, size_pt: Any, pt_per_m: float) -> None:
    """Names stand on a pale ground: an outline around their letters would make them shapes in an SVG, not text."""
    ground = {"facecolor": "white", "alpha": 0.6, "edgecolor": "none", "pad": 0.4}
    shown = sorted(things, key=lambda thing: (thing.standing != "present", -float(np.ptp(thing.corners, axis=0).max())))
    shown = shown[:MOST_NAMES]
    texts = [plain(thing.id) + ("?" if thing.standing == "unknown" else "") for thing in shown]
    names = [
        Name(
            (thing.middle - low) * pt_per_m,
            np.ptp(thing.corners, axis=0) / 2 * pt_per_m,
            np.array([_width_pt(text) / 2, NAME_PT * 0.6]),
        )
        for thing, text in zip(shown, texts, strict=True)
    ]
    for thing, text, place in zip(shown, texts, place_names(names, size_pt), strict=True):
        if place is None:
            continue
        at, colour = place / pt_per_m + low, STYLES[thing.standing][0] or _darker(thing.label)
        name = axes.text(float(at[0]), float(at[1]), text, fontsize=NAME_PT, color=colour, bbox=ground, zorder=8)
        name.set(ha="center", va="center", parse_math=False)
        if np.any(np.abs(at - thing.middle) > np.ptp(thing.corners, axis=0) / 2 + 1.5 * NAME_PT / pt_per_m):
            axes.plot(*zip(at, thing.middle, strict=True), color=colour, linewidth=0.5, alpha=0.7, zorder=7)


def _width_pt(text: str) -> float:
    """About the width of a text: DejaVu Sans is 0.6 em wide on average, Chinese letters are 1 em."""
    return NAME_PT * sum(1.0 if ord(letter) > 0x2E80 else 0.6 for letter in text)


def _darker(label: str) -> str:
    red, green, blue = colour_of(label)
    return hex_of((red * 2 // 3, green * 2 // 3, blue * 2 // 3))


def _legend_handles(plan: MapPlan) -> list[Any]:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - keeps start-up light
    from matplotlib.patches import Patch  # noqa: PLC0415

    handles: list[Any] = []
    if plan.floor is not None:
        wall = hex_of(tuple(round(255 * value) for value in _STRUCTURE_RGB.tolist()))
        handles += [
            Patch(facecolor=FREE, edgecolor="#aab2bd", label=f"seen free ({plan.floor.free_m2:.0f} m²)"),
            Patch(facecolor=wall, label="structure, darker where higher"),
            Patch(facecolor=UNSEEN, edgecolor="#aab2bd", label="nobody has seen it"),
        ]
    for standing, (colour, line, words) in STYLES.items():
        count = sum(thing.standing == standing for thing in plan.things)
        if count:
            edge = colour or "#334155"
            face = "#33415533" if standing == "present" else "none"
            handles.append(Patch(facecolor=face, edgecolor=edge, linestyle=line, label=f"{words} ({count})"))
    for number, way in enumerate(plan.ways[: len(WAY_COLOURS)]):
        colour = WAY_COLOURS[number]
        handles.append(Line2D([], [], color=colour, label=f"way in {plain(way.traversal)}"))
    for kind, (colour, marker, words) in CHANGES.items():
        count = sum(change.kind == kind for change in plan.changes)
        if count:
            label = f"{words} in {plain(plan.changes_of)} ({count})"
            handles.append(Line2D([], [], color=colour, marker=marker, linestyle="none", label=label))
    return handles
