"""The life of a thing as a bar: when it was seen, when nobody can say, when its place was seen empty."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from supermap_cli.drawing.text import plain
from supermap_cli.types.memory import StateRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Kind = Literal["seen", "not contradicted", "nobody can say", "seen empty"]
COLOURS: dict[Kind, str] = {
    "seen": "#15803d",
    "not contradicted": "#a7d7b5",
    "nobody can say": "#f2c879",
    "seen empty": "#e79aa6",
}
GAP_SHARE = 0.25
"""Width of the time between two traversals, as a share of that of a traversal: days pass in which nobody looks."""


@dataclass(frozen=True)
class Stretch:
    """A part of a life: [start_ns, end_ns] of map time."""

    start_ns: int
    end_ns: int
    kind: Kind


@dataclass(frozen=True)
class TraversalViews:
    """A traversal, and how often it saw the thing: keyframes that support it, of those with its place in view."""

    name: str
    start_ns: int
    end_ns: int
    supported: int
    in_view: int


def life(states: Sequence[StateRecord], first_ns: int, now_ns: int) -> list[Stretch]:
    """The parts of a life from the start of the map, `first_ns`, to its end, in the order of time; none overlap."""
    return [stretch for stretch in _stretches(states, first_ns, now_ns) if stretch.end_ns > stretch.start_ns]


def _stretches(states: Sequence[StateRecord], first_ns: int, now_ns: int) -> Iterator[Stretch]:
    known_ns = first_ns
    empty = False
    for number, state in enumerate(states):
        empty_ns = known_ns if state.empty_before_ns is None else max(known_ns, state.empty_before_ns)
        empty_ns = min(empty_ns, state.first_seen_ns)
        if empty or state.empty_before_ns is not None:
            yield Stretch(known_ns, empty_ns, "seen empty")
        yield Stretch(empty_ns, state.first_seen_ns, "nobody can say")
        yield Stretch(state.first_seen_ns, state.last_seen_ns, "seen")
        after_ns = states[number + 1].first_seen_ns if number + 1 < len(states) else now_ns
        gone_ns = state.gone_ns
        if gone_ns is None:
            last = number + 1 == len(states)
            yield Stretch(
                state.last_seen_ns, max(after_ns, state.last_seen_ns), "not contradicted" if last else "nobody can say"
            )
            known_ns = max(after_ns, state.last_seen_ns)
            continue
        gone_ns = min(gone_ns, max(after_ns, state.last_seen_ns))
        yield Stretch(state.last_seen_ns, gone_ns, "nobody can say")
        known_ns, empty = max(gone_ns, state.last_seen_ns), True
    if states and states[-1].gone_ns is not None:
        yield Stretch(known_ns, now_ns, "seen empty")


def draw_life(axes: Axes, stretches: Sequence[Stretch], visits: Sequence[TraversalViews], font_pt: float) -> None:
    """Draw the bar. Traversals are equally wide, the time between them narrow."""
    from matplotlib.patches import Patch  # noqa: PLC0415 - keeps start-up light

    ordered = sorted(visits, key=lambda visit: visit.start_ns)
    stamps, places = _scale(ordered)
    for stretch in stretches:
        start, end = np.interp([stretch.start_ns - stamps[0], stretch.end_ns - stamps[0]], stamps - stamps[0], places)
        axes.barh(0, max(end - start, 0.004), left=start, height=0.7, color=COLOURS[stretch.kind], linewidth=0)
    for number, visit in enumerate(ordered):
        start = number * (1 + GAP_SHARE)
        axes.plot([start, start + 1], [-0.52, -0.52], color="#334155", linewidth=2, solid_capstyle="butt")
        words = f"seen in {visit.supported} of {visit.in_view} views" if visit.in_view else "its place was not in view"
        said: Any = axes.text(
            start + 0.5, -0.66, f"{plain(visit.name)}\n{words}", fontsize=font_pt, ha="center", va="top"
        )
        said.set_parse_math(False)
    axes.set(xlim=(-0.05, max(places[-1], 1.0) + 0.05), ylim=(-1.7, 0.5))
    axes.axis("off")
    kinds = [kind for kind in COLOURS if any(stretch.kind == kind for stretch in stretches)]
    handles = [Patch(facecolor=COLOURS[kind], label=kind) for kind in kinds]
    axes.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.5, -0.25), ncols=4, frameon=False, fontsize=font_pt
    )


def _scale(visits: Sequence[TraversalViews]) -> tuple[Any, Any]:
    """Stamps of map time (n,) ns and their places (n,) on the axis."""
    stamps, places = [], []
    for number, visit in enumerate(visits):
        start = number * (1 + GAP_SHARE)
        stamps += [visit.start_ns, max(visit.end_ns, visit.start_ns + 1)]
        places += [start, start + 1]
    return np.array(stamps or [0, 1], np.int64), np.array(places or [0.0, 1.0])
