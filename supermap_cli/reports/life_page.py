"""The life of one object as a page: in words, its places from above, its pictures, and tables."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from pathlib import Path

import numpy as np

from supermap_cli.memory.images import crop_jpegs
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.life import History
from supermap_cli.query.story import place, story
from supermap_cli.query.views import box_of
from supermap_cli.reports.files import write_file
from supermap_cli.reports.page import page, picture, table
from supermap_cli.reports.pictures import data_uri
from supermap_cli.reports.plan import Arrow, Outline, extent_of, plan_svg

MOST_PICTURES, MOST_PLACES = 60, 60
"""Of a longer life the last ones are shown."""


def write_life_page(told: History, reader: MapReader, path: Path) -> None:
    """Write the page. Raises `SupermapError` where it cannot be written."""
    write_file(path, life_page(told, reader))


def life_page(told: History, reader: MapReader) -> str:
    """The page as HTML."""
    clock = clock_of(reader)
    merged = f", with {', '.join(told.merged_ids)}" if told.merged_ids else ""
    when = "" if told.as_of is None else f" as of {told.as_of}"
    sentences = "".join(f"<li>{escape(each)}</li>" for each in story(told, clock))
    return page(
        f"supermap history {told.id}",
        [
            f"<h1>The life of {escape(told.id)}</h1>",
            f'<p class="soft">{escape(f"{told.label}, {told.presence}{when}{merged}")} · {escape(reader.where)}</p>',
            f'<ol class="story">{sentences}</ol>',
            "<h2>Where it stood</h2>",
            _places(told),
            "<h2>Pictures</h2>",
            _pictures(told, reader, clock),
            "<h2>States</h2>",
            _states(told, clock),
            "<h2>Events</h2>",
            _events(told, clock),
            "<h2>Who saw it</h2>",
            _sightings(told, clock),
        ],
    )


def _places(told: History) -> str:
    shown = told.intervals[-MOST_PLACES:]
    corners = [box_of(each.box).footprint() for each in shown]
    newest = len(shown) - 1
    outlines = [
        Outline(
            outline,
            f"{each.state}",
            f"state {each.state}: {place(each.position)}",
            "moved" if at == newest and told.presence == "present" else "moved ghost",
        )
        for at, (each, outline) in enumerate(zip(shown, corners, strict=True))
    ]
    arrows = [
        Arrow(np.array(a.box.center[:2]), np.array(b.box.center[:2]))
        for a, b in pairwise(shown)
        if np.hypot(a.box.center[0] - b.box.center[0], a.box.center[1] - b.box.center[1]) > 0.1
    ]
    drawing = plan_svg(extent_of(corners), outlines, arrows, [], f"the places of {told.id}")
    return f'<div class="panels single"><figure><figcaption>Its states from above</figcaption>{drawing}</figure></div>'


def _pictures(told: History, reader: MapReader, clock: Clock) -> str:
    frames = told.frames[-MOST_PICTURES:]
    jpegs = crop_jpegs(reader, [each.observation for each in frames])
    shown = [
        picture(
            data_uri(jpegs[each.observation]),
            f"{clock.brief(each.stamp_ns)}, {each.traversal}, state {each.state}, observation {each.observation}",
        )
        for each in frames
        if each.observation in jpegs
    ]
    if not shown:
        return "<p>No picture of it is kept.</p>"
    return f'<div class="cards pictures">{"".join(shown)}</div>'


def _states(told: History, clock: Clock) -> str:
    around = {each.state: each for each in told.surroundings}
    rows = []
    for each in told.intervals:
        beside = around.get(each.state)
        relations = [] if beside is None else [f"{r.subject} {r.name} {r.object}" for r in beside.relations]
        if beside is not None and beside.more:
            relations.append(f"{beside.more} more")
        cells = (
            str(each.state),
            clock.brief(each.empty_before_ns),
            clock.brief(each.first_seen_ns),
            clock.brief(each.last_seen_ns),
            clock.brief(each.gone_ns),
            place(each.position),
            each.label,
            f"{each.confidence:.2f}",
        )
        rows.append((tuple(map(escape, cells)), escape("; ".join(relations))))
    columns = (
        "state#",
        "place seen empty",
        "first seen",
        "last seen",
        "gone by",
        "position (m)",
        "label",
        "confidence#",
    )
    return table(columns, rows)


def _events(told: History, clock: Clock) -> str:
    rows = [
        (
            escape(each.kind),
            escape(each.from_id),
            escape(each.to_id),
            escape(clock.span(each.not_before_ns, each.not_after_ns)),
            "" if each.distance_m is None else f"{each.distance_m:.2f}",
            f"{each.probability:.2f}",
        )
        for each in told.events
    ]
    return table(("event", "from", "to", "between", "distance (m)#", "probability#"), ((row, "") for row in rows))


def _sightings(told: History, clock: Clock) -> str:
    rows = [
        (
            escape(each.traversal),
            str(each.supported),
            str(each.in_view),
            str(each.contradicted),
            escape(clock.span(each.first_support_ns, each.last_support_ns)),
            str(each.observation_count),
            escape(", ".join(f"{label} {share:.0%}" for label, share in each.labels.items())),
        )
        for each in told.sightings
    ]
    columns = ("traversal", "supported#", "in view#", "seen empty#", "seen", "observations#", "called")
    return table(columns, ((row, "") for row in rows))
