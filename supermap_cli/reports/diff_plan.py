"""The content of a diff's plans from above: before and after, on the same scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.diff import Diff, ObjectChange, SideView
from supermap_cli.query.views import box_of
from supermap_cli.reports.floor_plan import Arrow, Extent, Outline, extent_of
from supermap_cli.reports.page import css_name

MAX_NAMED_CHANGES = 60
"""With more changes than this, unchanged objects are not labelled."""


@dataclass(frozen=True)
class Panel:
    """One of the two plans."""

    title: str
    extent: Extent
    outlines: Sequence[Outline]
    arrows: Sequence[Arrow]
    trajectories: Sequence[FloatArray]


def before_after_panels(diff: Diff, reader: MapReader) -> tuple[Panel, Panel]:
    """The two plans, with the robot's trajectory for each side that is a traversal."""
    trajectories = [_trajectory(side, reader) for side in (diff.before, diff.after)]
    intervals = [
        interval for change in diff.changes for interval in (change.interval_before, change.interval_after) if interval
    ]
    extent = extent_of([*(box_of(interval.box).footprint() for interval in intervals), *trajectories])
    name_unchanged = len(diff.changes) <= MAX_NAMED_CHANGES
    before = [
        outline for change in diff.changes for outline in _outlines(change, before=True, name_unchanged=name_unchanged)
    ]
    after = [
        outline for change in diff.changes for outline in _outlines(change, before=False, name_unchanged=name_unchanged)
    ]
    arrows = [
        Arrow(box_of(change.interval_before.box).center[:2], box_of(change.interval_after.box).center[:2])
        for change in diff.changes
        if change.kind == "moved" and change.interval_before is not None and change.interval_after is not None
    ]
    return (
        Panel(f"Before: {diff.before.name}", extent, before, [], trajectories[:1]),
        Panel(f"After: {diff.after.name}", extent, after, arrows, trajectories[1:]),
    )


def _outlines(change: ObjectChange, *, before: bool, name_unchanged: bool) -> list[Outline]:
    """The outline of an object on one side; empty where it is no longer or not yet present."""
    own, other = (
        (change.interval_before, change.interval_after) if before else (change.interval_after, change.interval_before)
    )
    style = css_name(change.kind)
    outlines = []
    if own is not None:
        named = change.kind != "unchanged" or name_unchanged
        outlines.append(
            Outline(
                box_of(own.box).footprint(),
                change.id if named else "",
                f"{change.id}: {change.kind}, {change.reason}",
                style,
            )
        )
    if other is not None and (own is None or change.kind == "moved") and not (before and change.kind == "moved"):
        label = change.id if own is None and change.kind in {"disappeared", "appeared"} else ""
        outlines.append(Outline(box_of(other.box).footprint(), label, f"{change.id}: {change.kind}", f"{style} ghost"))
    return outlines


def _trajectory(side: SideView, reader: MapReader) -> FloatArray:
    """The robot's trajectory (n, 2) in a traversal, metres; empty for a plain time."""
    if side.traversal is None:
        return np.zeros((0, 2))
    traversal = next(traversal for traversal in reader.traversals if traversal.number == side.traversal.number)
    return reader.trajectory(traversal.id)[1][:, :2]
