"""A plan from above as SVG: outlines of objects, the robot's trajectory, arrows for moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

WIDTH_PX, MARGIN_PX, MAX_HEIGHT_PX = 620.0, 14.0, 760.0
"""Width, inner margin and largest height of a plan."""

MARGIN_M = 0.5
"""Free space around the drawn points."""

HALF_LETTER_PX, LINE_HEIGHT_PX = 3.1, 11
"""Half the mean width of a letter and the height of a line, for labels that must not overlap."""


@dataclass(frozen=True)
class Outline:
    """An object on the plan: the corners (4, 2) of its box in metres, and its CSS class `style`.

    `label` is drawn on the plan if not empty, `title` is its tooltip.
    """

    corners: FloatArray
    label: str
    title: str
    style: str


@dataclass(frozen=True)
class Arrow:
    """An arrow between two positions (2,), metres."""

    start: FloatArray
    end: FloatArray
    style: str = "moved"


@dataclass(frozen=True)
class Extent:
    """The part of the map that is drawn: `low`, `high` (2,), metres."""

    low: FloatArray
    high: FloatArray

    @property
    def px_per_m(self) -> float:
        """The scale that fits the extent into the maximal width and height."""
        size = np.maximum(self.high - self.low, 1e-6)
        return float(min((WIDTH_PX - 2 * MARGIN_PX) / size[0], (MAX_HEIGHT_PX - 2 * MARGIN_PX) / size[1]))

    @property
    def size_px(self) -> tuple[float, float]:
        """Width and height of the drawing."""
        width, height = (self.high - self.low) * self.px_per_m + 2 * MARGIN_PX
        return float(width), float(height)

    def to_px(self, points: FloatArray) -> FloatArray:
        """(n, 2) metres -> (n, 2) pixels, y downwards."""
        x = (points[:, 0] - self.low[0]) * self.px_per_m + MARGIN_PX
        y = (self.high[1] - points[:, 1]) * self.px_per_m + MARGIN_PX
        return np.column_stack([x, y])


def extent_of(points: Sequence[FloatArray]) -> Extent:
    """The extent of all (n, 2) points with a margin; a default extent without points."""
    non_empty = [part for part in points if len(part)]
    if not non_empty:
        return Extent(np.array([-2.0, -2.0]), np.array([2.0, 2.0]))
    together = np.concatenate(non_empty)
    return Extent(np.floor(together.min(axis=0) - MARGIN_M), np.ceil(together.max(axis=0) + MARGIN_M))


def plan_svg(
    extent: Extent, outlines: Sequence[Outline], arrows: Sequence[Arrow], trajectories: Sequence[FloatArray], title: str
) -> str:
    """The drawing. `trajectories` are (n, 2), metres; CSS classes are styled by the page (`page.STYLE`)."""
    width, height = extent.size_px
    parts = [
        f'<svg class="plan" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img">',
        f"<title>{escape(title)}</title>",
        _ARROW_TIP,
        _grid(extent),
        *(
            f'<polyline class="way" points="{_points_text(extent.to_px(trajectory))}"/>'
            for trajectory in trajectories
            if len(trajectory) > 1
        ),
    ]
    for outline in sorted(outlines, key=lambda outline: bool(outline.label)):
        corners = _points_text(extent.to_px(outline.corners))
        title_tag = f"<title>{escape(outline.title)}</title>"
        parts.append(f'<polygon class="thing {outline.style}" points="{corners}">{title_tag}</polygon>')
    for arrow in arrows:
        (x0, y0), (x1, y1) = extent.to_px(np.stack([arrow.start, arrow.end]))
        parts.append(f'<line class="arrow" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')
    parts += _label_texts(extent, outlines)
    parts += [_scale_bar(extent), "</svg>"]
    return "\n".join(parts)


_ARROW_TIP = (
    '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0 L8 4 L0 8 z" class="tip"/></marker></defs>'
)


def _label_texts(extent: Extent, outlines: Sequence[Outline]) -> list[str]:
    """The labels of outlines, moved down where they would overlap."""
    taken: list[tuple[float, float, float]] = []
    texts = []
    labelled = sorted(
        (outline for outline in outlines if outline.label), key=lambda outline: float(-outline.corners[:, 1].max())
    )
    for outline in labelled:
        x, y = extent.to_px(outline.corners.mean(axis=0)[None])[0]
        half = HALF_LETTER_PX * len(outline.label)
        x = float(np.clip(x, half + 2, extent.size_px[0] - half - 2))
        while any(
            abs(y - other_y) < LINE_HEIGHT_PX and abs(x - other_x) < half + other_half
            for other_x, other_y, other_half in taken
        ):
            y += LINE_HEIGHT_PX
        taken.append((x, y, half))
        texts.append(f'<text class="name {outline.style}" x="{x:.1f}" y="{y + 3.5:.1f}">{escape(outline.label)}</text>')
    return texts


def _grid(extent: Extent) -> str:
    """Grid lines every metre, or every 5 or 10 m in a large map."""
    size = float((extent.high - extent.low).max())
    step = 1 if size <= 25 else 5 if size <= 120 else 10
    lines = []
    width, height = extent.size_px
    for x in np.arange(np.ceil(extent.low[0] / step) * step, extent.high[0] + 1e-9, step):
        px = extent.to_px(np.array([[x, extent.low[1]]]))[0, 0]
        lines.append(f"M{px:.1f} {MARGIN_PX:.1f}V{height - MARGIN_PX:.1f}")
    for y in np.arange(np.ceil(extent.low[1] / step) * step, extent.high[1] + 1e-9, step):
        px = extent.to_px(np.array([[extent.low[0], y]]))[0, 1]
        lines.append(f"M{MARGIN_PX:.1f} {px:.1f}H{width - MARGIN_PX:.1f}")
    return f'<path class="grid" d="{"".join(lines)}"/>'


def _scale_bar(extent: Extent) -> str:
    """A scale bar of one metre, or more if that is too short."""
    metres = next((m for m in (1, 2, 5, 10, 20, 50) if m * extent.px_per_m >= 30), 100)
    length, (_, height) = metres * extent.px_per_m, extent.size_px
    y = height - 7
    return (
        f'<path class="scale" d="M{MARGIN_PX} {y - 3}v6M{MARGIN_PX} {y}h{length:.1f}m0 -3v6"/>'
        f'<text class="name scale" x="{MARGIN_PX + length + 5:.1f}" y="{y + 3.5:.1f}" style="text-anchor:start">'
        f"{metres} m</text>"
    )


def _points_text(points: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
