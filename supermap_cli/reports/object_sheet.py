"""A sheet about one thing as a picture: its first, best and last view, its place in the plan, its life as a bar."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from supermap_cli.drawing.life_bar import TraversalViews, draw_life, life
from supermap_cli.drawing.map_plan import MapPlan, PlanThing, PlanWay
from supermap_cli.drawing.observed_floor import floor_about
from supermap_cli.drawing.plan_picture import draw_plan
from supermap_cli.drawing.text import figure_style, plain
from supermap_cli.errors import QueryError, SupermapError
from supermap_cli.geometry.arrays import UInt8Array
from supermap_cli.geometry.boxes import Reach
from supermap_cli.geometry.pictures import decode_bgr
from supermap_cli.memory.images import crop_jpegs, crops_of, thumbnails_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.output_files import check_output, replace_file
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.reports.pictures import crop_around_box

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SUFFIXES = (".png", ".svg", ".pdf")
_OTHERS = 40
"""Things about it whose views tell of the floor (chosen)."""
AROUND_M = 3.0
"""m; how far around a thing the plan reaches (chosen: a room)."""
_SIZE_IN, _DPI, _FONT_PT = (12.0, 7.6), 150, 8.0
"""Width and height of the sheet in inches, pixels per inch of a PNG, letters in points."""


@dataclass(frozen=True)
class View:
    """A picture of the thing (h, w, 3) uint8 RGB, or none, and what is said below it."""

    title: str
    words: str
    rgb: UInt8Array | None


def check_sheet(path: Path) -> None:
    """Raises `SupermapError` for an unsupported image suffix or a file of another kind, before anything is read."""
    if path.suffix.lower() not in SUFFIXES:
        raise SupermapError("a picture of an unknown kind", where=str(path), cure="name a .png, .svg or .pdf file")
    check_output(path, path.suffix.lower().removeprefix("."), option="--picture")


def write_object_sheet(reader: MapReader, text_id: str, path: Path) -> None:
    """Draw the sheet of the instance with an id. Raises `QueryError` if there is none, `SupermapError` if it cannot be
    written.
    """
    instance = reader.instance(text_id)
    if instance is None:
        raise QueryError(f"there is no object {text_id!r} in the map", cure="`supermap show` lists them")
    content = _sheet(reader, instance, path.suffix.lower().removeprefix("."))
    check_sheet(path)
    replace_file(path, content)


def _sheet(reader: MapReader, instance: StoredInstance, image_format: str) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415 - keeps start-up light
    from matplotlib.figure import Figure  # noqa: PLC0415

    clock = clock_of(reader)
    width, height = _SIZE_IN
    with figure_style():
        figure = Figure(figsize=_SIZE_IN)
        FigureCanvasAgg(figure)
        figure.text(0.03, 0.955, plain(instance.id), fontsize=15, weight="bold", parse_math=False)
        figure.text(0.03, 0.915, _facts(instance, clock), fontsize=_FONT_PT, color="#475569", parse_math=False)
        plan_axes: Any = figure.add_axes((0.03, 0.26, 0.42, 0.63))
        draw_plan(plan_axes, _plan(reader, instance), np.array([0.42 * width, 0.63 * height]), only=instance.id)
        plan_axes.tick_params(labelsize=6.5)
        for number, view in enumerate(views_of(reader, instance, clock)):
            _draw_view(figure.add_axes((0.475 + 0.172 * number, 0.33, 0.16, 0.5)), view)
        first_ns = min((traversal.start_ns for traversal in reader.traversals), default=0)
        stretches = life(instance.states, first_ns, reader.now_ns)
        draw_life(figure.add_axes((0.03, 0.05, 0.94, 0.16)), stretches, _visits(reader, instance), _FONT_PT)
        content = BytesIO()
        metadata = {"Date": None} if image_format == "svg" else {}
        figure.savefig(content, dpi=_DPI, format=image_format, metadata=metadata)
    return content.getvalue()


def _facts(instance: StoredInstance, clock: Clock) -> str:
    x, y, z = instance.centroid_map.tolist()
    size = " x ".join(f"{value:.2f}" for value in instance.box.size.tolist())
    believed = sorted(instance.label_belief.items(), key=lambda item: -item[1])[:3]
    labels = ", ".join(f"{label} {share:.0%}" for label, share in believed)
    seen = clock.span(instance.first_seen_ns, instance.last_seen_ns)
    return plain(labels) + f"  ·  {instance.presence}  ·  at {x:.2f} {y:.2f} {z:.2f} m, {size} m  ·  {seen}"


def views_of(reader: MapReader, instance: StoredInstance, clock: Clock) -> list[View]:
    """The first, the best (by score) and the last view: its crop, or where none is kept, the place in the keyframe."""
    observations = reader.observations(instance)
    if not observations:
        return [View("no view", "no observation is kept", None)]
    crops = {crop.observation for crop in crops_of(reader, [instance.number]).get(instance.number, [])}
    best = max(observations, key=lambda found: (found.id in crops, found.score))
    chosen = {"first view": observations[0], "best view": best, "last view": observations[-1]}
    jpegs = crop_jpegs(reader, [found.id for found in chosen.values() if found.id in crops])
    names = {traversal.id: traversal.name for traversal in reader.traversals}
    views = []
    for title, found in chosen.items():
        jpeg = jpegs.get(found.id)
        place = "" if jpeg is not None else "its place, no crop is kept\n"
        jpeg = _place_in_keyframe(reader, instance, found.keyframe_id, found.stamp_ns) if jpeg is None else jpeg
        bgr = None if jpeg is None else decode_bgr(jpeg)
        words = f"{clock.text(found.stamp_ns)}\n{names[found.traversal_id]}\n{found.label} {found.score:.2f}"
        if bgr is None:
            place = "no picture is kept\n"
        views.append(View(title, place + words, None if bgr is None else np.ascontiguousarray(bgr[..., ::-1])))
    return views


def _place_in_keyframe(reader: MapReader, instance: StoredInstance, keyframe_id: int, stamp_ns: int) -> bytes | None:
    """The part of a keyframe's thumbnail where the thing stood then."""
    state = next((state for state in reversed(instance.states) if state.first_seen_ns <= stamp_ns), instance.states[0])
    images = thumbnails_of(reader, [stamp_ns]).get(stamp_ns, [])
    image = next((image for image in images if image.keyframe_id == keyframe_id), None)
    return None if image is None else crop_around_box(image, state.box)


def _draw_view(axes: Axes, view: View) -> None:
    axes.axis("off")
    axes.set_title(view.title, fontsize=_FONT_PT + 1, loc="left")
    if view.rgb is None:
        axes.set(xlim=(0, 1), ylim=(1, 0))
        axes.text(0.5, 0.45, "-", ha="center", color="#94a3b8", fontsize=20)
    else:
        axes.imshow(view.rgb, interpolation="bicubic")
        axes.set_anchor("NW")
    lines = "\n".join(plain(line) for line in view.words.split("\n"))
    below: Any = axes.text(0.0, -0.04, lines, transform=axes.transAxes, fontsize=_FONT_PT - 1, va="top")
    below.set_parse_math(False)


def _plan(reader: MapReader, instance: StoredInstance) -> MapPlan:
    """The surroundings: what stands there, and all places in which the thing stood."""
    near = {number for _, number in reader.search.near([instance.number], Reach(AROUND_M, 100.0))}
    others = list(reader.instances_by_number(near - {instance.number}).values())
    nearest = sorted(others, key=lambda other: float(np.linalg.norm(other.centroid_map - instance.centroid_map)))
    nearest = nearest[:_OTHERS]
    things = [
        PlanThing(other.id, other.label, other.states[-1].box.footprint(), "present", other.states[-1].box.z_max)
        for other in others
        if other.presence == "present"
    ]
    newest = instance.states[-1]
    for state in instance.states:
        standing = instance.presence if state is newest else "ended"
        things.append(PlanThing(instance.id, instance.label, state.box.footprint(), standing, state.box.z_max))
    places = np.concatenate([state.box.footprint() for state in instance.states])
    window = (places.min(axis=0) - AROUND_M, places.max(axis=0) + AROUND_M)
    seen_in = [traversal for traversal in reader.traversals if instance.visit(traversal.id).supported]
    ways = [
        PlanWay(traversal.name, reader.trajectory(traversal.id)[1][:, :2])
        for traversal in (seen_in if len(seen_in) < 3 else (seen_in[0], seen_in[-1]))
    ]
    floor = floor_about(reader, [instance.number, *(other.number for other in nearest)])
    return MapPlan(instance.id, things, ways, floor=floor, window=window)


def _visits(reader: MapReader, instance: StoredInstance) -> list[TraversalViews]:
    found = [(traversal, instance.visit(traversal.id)) for traversal in reader.traversals]
    return [TraversalViews(t.name, t.start_ns, t.end_ns, visit.supported, visit.in_view) for t, visit in found]
