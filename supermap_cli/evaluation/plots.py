"""Plots of an evaluation: the map over the truth from above, and the changes over time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from supermap_cli.errors import EvaluationError
from supermap_cli.evaluation.change_recall import BelievedPositions, changed_places
from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import KnownTruth, Place, known_truth
from supermap_cli.evaluation.objects import ObjectScores
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.output_files import check_output, replace_file
from supermap_cli.types.truth import GroundTruth, TrueTraversal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GOOD, MISSED, FALSE, IGNORED = "#1a7f4b", "#d97706", "#c1121f", "#8a8a8a"
TRAJECTORY, WALL = "#7aa6d8", "#b8b8b8"
WIDTH_IN, MAP_HEIGHT_IN, CHANGE_MARGIN_IN = 10.0, 7.0, 1.2
"""Inches: width of the plot, height of the map's panel, height of the changes' panel besides its rows."""
ROW_HEIGHT_IN = 0.26
"""Inches of a row of the plot of changes."""
GAP_SHARE = 0.04
"""Gap between two traversals on the time axis, as a share of their total length."""
DPI = 130
"""Dots per inch of a .png."""
SUFFIXES = (".png", ".svg", ".pdf")


def draw(
    path: Path, estimate: EstimatedMap, truth: GroundTruth, scores: ObjectScores, *, panel_names: Sequence[str]
) -> None:
    """Write a plot (.png, .svg or .pdf) with the panels "map", "change" or both, one below the other; "change" is left
    out where nothing changed.

    `scores` are those of the objects at the map's end.

    Raises `ExportError` where the file cannot be written.
    """
    known = known_truth(estimate, truth)
    changed = list(changed_places(known, truth))
    if not changed and "map" in panel_names:
        panel_names = ["map"]
    heights = {"map": MAP_HEIGHT_IN, "change": CHANGE_MARGIN_IN + ROW_HEIGHT_IN * max(len(changed), 1)}
    figure = _figure((WIDTH_IN, sum(heights[name] for name in panel_names)))
    panels = figure.subplots(len(panel_names), squeeze=False, height_ratios=[heights[name] for name in panel_names])[
        :, 0
    ]
    for panel, panel_name in zip(panels, panel_names, strict=True):
        if panel_name == "map":
            _draw_map(panel, estimate, truth, scores)
        else:
            _draw_changes(panel, estimate, known, changed)
    content = BytesIO()
    try:
        figure.savefig(content, dpi=DPI, format=path.suffix.lower().removeprefix("."))
    except OSError as error:
        cure = "name another file with --plot"
        raise EvaluationError(f"the picture cannot be drawn: {error}", where=str(path), cure=cure) from error
    check_picture(path)
    replace_file(path, content.getvalue())


def check_picture(path: Path) -> None:
    """Check that a plot can be written to a file. Raises `EvaluationError` or `ExportError` if not."""
    folder = path.parent
    if path.suffix.lower() not in SUFFIXES:
        raise EvaluationError("a picture of an unknown kind", where=str(path), cure="name a .png, .svg or .pdf file")
    if not folder.is_dir():
        raise EvaluationError("there is no such folder", where=str(folder), cure="make it, or name another file")
    if path.is_dir() or not os.access(folder, os.W_OK):
        raise EvaluationError("the picture cannot be written there", where=str(path), cure="name another file")
    check_output(path, path.suffix.lower().removeprefix("."), option="--plot")


def _figure(size_in: tuple[float, float]) -> Figure:
    """A figure that needs no display and leaves pyplot's state alone."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - keeps start-up light
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


# -- seen from above


def _draw_map(panel: Axes, estimate: EstimatedMap, truth: GroundTruth, scores: ObjectScores) -> None:
    walls = [surface.points_world[:, :2] for surface in truth.surfaces if surface.label in {"wall", "door", "window"}]
    if walls:
        x, y = np.concatenate(walls).T
        panel.scatter(x, y, s=0.3, color=WALL, linewidths=0, rasterized=True)
    for traversal in truth.traversals:
        panel.plot(*traversal.T_world_base[:, :2, 3].T, color=TRAJECTORY, lw=0.8, zorder=1)
    right = {match.object_id for match in scores.matched}
    missed = {obj.id for obj in scores.missed}
    for true in truth.objects:
        state = true.state_at(int(estimate.keyframes_ns[-1]))
        if true.kind == "object" and state is not None:
            colour = GOOD if true.id in right else MISSED if true.id in missed else IGNORED
            _outline(panel, state.box, colour, style="--", text=true.id if true.id in missed else "")
    right = {match.instance_id for match in scores.matched}
    false = {instance.id for instance in scores.false}
    for instance in estimate.objects:
        if instance.presence == "present":
            colour = GOOD if instance.id in right else FALSE if instance.id in false else IGNORED
            _outline(panel, instance.box, colour, style="-", text=instance.id, filled=True)
    kinds = [("right", GOOD, "-"), ("its true box", GOOD, "--"), ("missed", MISSED, "--"), ("false", FALSE, "-")]
    _add_legend(panel, [*kinds, ("hardly shown: not judged", IGNORED, "--"), ("the robot's true way", TRAJECTORY, "-")])
    panel.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", title=f"The map over the truth: {truth.scenario}")


def _outline(panel: Axes, box: Box3D, colour: str, *, style: str, text: str, filled: bool = False) -> None:
    corners = np.vstack([box.footprint(), box.footprint()[:1]])
    if filled:
        panel.fill(*corners.T, color=colour, alpha=0.15, lw=0)
    panel.plot(*corners.T, color=colour, ls=style, lw=1.0)
    if text:
        x, y, _ = box.center
        panel.text(x, y, text, fontsize=5, ha="center", va="center", color=colour, zorder=4)


# -- over time


class TimeAxis:
    """Sensor time on the plot's axis: the traversals side by side in seconds, with gaps between them."""

    def __init__(self, traversals: Sequence[TrueTraversal]) -> None:
        lengths_s = [(traversal.end_ns - traversal.start_ns) / 1e9 for traversal in traversals]
        starts_s = np.cumsum([0.0, *(length_s + GAP_SHARE * sum(lengths_s) for length_s in lengths_s)])[:-1]
        self.spans = [
            (traversal.start_ns, traversal.end_ns, float(start_s))
            for traversal, start_s in zip(traversals, starts_s, strict=True)
        ]

    def at(self, stamps_ns: IntArray) -> FloatArray:
        """Seconds on the axis (n,) of stamps (n,); NaN outside the traversals."""
        seconds = np.full(len(stamps_ns), np.nan)
        for start_ns, end_ns, start_s in self.spans:
            within = (stamps_ns >= start_ns) & (stamps_ns <= end_ns)
            seconds[within] = start_s + (stamps_ns[within] - start_ns) / 1e9
        return seconds

    def bars(self, since_ns: int | None, until_ns: int | None) -> list[tuple[float, float]]:
        """An interval as (start, length) bars in seconds on the axis, one for each traversal it overlaps."""
        bars = []
        for start_ns, end_ns, start_s in self.spans:
            low_ns = start_ns if since_ns is None else max(since_ns, start_ns)
            high_ns = end_ns if until_ns is None else min(until_ns, end_ns)
            if low_ns < high_ns:
                bars.append((start_s + (low_ns - start_ns) / 1e9, (high_ns - low_ns) / 1e9))
        return bars


def _draw_changes(panel: Axes, estimate: EstimatedMap, known: KnownTruth, changed: Sequence[int]) -> None:
    """Draw a row for each changed place: above, when the object stood there; below, when the map has it there, and the
    samples of `change_recall`, green where the map is right and red where not.
    """
    axis, believed_positions = TimeAxis(known.traversals), BelievedPositions(estimate, known)
    seconds = axis.at(known.stamps_ns)
    for row, k in enumerate(changed):
        place, believed = known.places[k], believed_positions.there(k)
        panel.broken_barh(axis.bars(place.state.since_ns, place.state.until_ns), (row - 0.4, 0.35), color=GOOD)
        panel.plot(seconds[believed], np.full(believed.sum(), row + 0.15), "s", ms=1.5, color=TRAJECTORY)
        there, left = known.in_view_with_object[k], known.in_view_left[k]
        right, wrong = (there & believed) | (left & ~believed), (there & ~believed) | (left & believed)
        for samples, colour in ((right, GOOD), (wrong, FALSE)):
            panel.plot(seconds[samples], np.full(samples.sum(), row + 0.3), "|", ms=5, color=colour)
    for traversal, (start_ns, end_ns, start_s) in zip(known.traversals, axis.spans, strict=True):
        panel.axvspan(start_s, start_s + (end_ns - start_ns) / 1e9, color="#f3f3f3", zorder=0)
        panel.text(start_s, -0.95, f" {traversal.name}", fontsize=7, va="center")
    panel.set_yticks(range(len(changed)), [_row_name(known.places[k]) for k in changed], fontsize=7)
    panel.set(ylim=(max(len(changed), 1) - 0.4, -1.3), xlabel="time within the traversals (s)")
    panel.set_title("What changed: when it stood where, and what the map holds")
    kinds = [("stands there", GOOD, "-"), ("the map holds it to be there", TRAJECTORY, "s")]
    _add_legend(panel, [*kinds, ("in view: the map is right", GOOD, "|"), ("in view: the map is wrong", FALSE, "|")])


def _row_name(place: Place) -> str:
    """The object, and which of its places it is, where it has several."""
    return place.object.id + (f", place {place.index + 1}" if len(place.object.states) > 1 else "")


def _add_legend(panel: Axes, entries: Sequence[tuple[str, str, str]]) -> None:
    """A legend of (text, colour, style) beside the panel; the style is that of a line, or a marker."""
    handles = [panel.plot([], [], style, color=colour, label=text)[0] for text, colour, style in entries]
    panel.legend(handles=handles, fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
