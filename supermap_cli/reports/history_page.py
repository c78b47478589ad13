"""The history of one object as an HTML page: text, plan, pictures and tables."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from pathlib import Path

import numpy as np

from supermap_cli.memory.images import crop_jpegs
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.history_text import history_sentences, position_text
from supermap_cli.query.object_history import ObjectHistory
from supermap_cli.query.views import box_of
from supermap_cli.reports.files import write_file
from supermap_cli.reports.floor_plan import Arrow, Outline, extent_of, plan_svg
from supermap_cli.reports.page import page, picture, table
from supermap_cli.reports.pictures import data_uri

MAX_PICTURES, MAX_STATES = 60, 60
"""Of a longer history the last ones are shown."""


def write_history_page(history: ObjectHistory, reader: MapReader, path: Path) -> None:
    """Write the page. Raises `SupermapError` if it cannot be written."""
    write_file(path, history_page(history, reader), "html", option="--html")


def history_page(history: ObjectHistory, reader: MapReader) -> str:
    """The page as HTML."""
    clock = clock_of(reader)
    merged = f", with {', '.join(history.merged_ids)}" if history.merged_ids else ""
    when = "" if history.as_of is None else f" as of {history.as_of}"
    summary = f"{history.label}, {history.presence}{when}{merged}"
    sentences = "".join(f"<li>{escape(sentence)}</li>" for sentence in history_sentences(history, clock))
    return page(
        f"supermap history {history.id}",
        [
            f"<h1>The life of {escape(history.id)}</h1>",
            f'<p class="soft">{escape(summary)} · {escape(reader.where)}</p>',
            f'<ol class="story">{sentences}</ol>',
            "<h2>Where it stood</h2>",
            _places_section(history),
            "<h2>Pictures</h2>",
            _pictures_section(history, reader, clock),
            "<h2>States</h2>",
            _states_table(history, clock),
            "<h2>Events</h2>",
            _events_table(history, clock),
            "<h2>Who saw it</h2>",
            _sightings_table(history, clock),
        ],
    )


def _places_section(history: ObjectHistory) -> str:
    shown = history.intervals[-MAX_STATES:]
    corners = [box_of(interval.box).footprint() for interval in shown]
    newest = len(shown) - 1
    outlines = [
        Outline(
            outline,
            f"{interval.state}",
            f"state {interval.state}: {position_text(interval.position)}",
            "moved" if at == newest and history.presence == "present" else "moved ghost",
        )
        for at, (interval, outline) in enumerate(zip(shown, corners, strict=True))
    ]
    arrows = [
        Arrow(np.array(a.box.center[:2]), np.array(b.box.center[:2]))
        for a, b in pairwise(shown)
        if np.hypot(a.box.center[0] - b.box.center[0], a.box.center[1] - b.box.center[1]) > 0.1
    ]
    drawing = plan_svg(extent_of(corners), outlines, arrows, [], f"the places of {history.id}")
    return f'<div class="panels single"><figure><figcaption>Its states from above</figcaption>{drawing}</figure></div>'


def _pictures_section(history: ObjectHistory, reader: MapReader, clock: Clock) -> str:
    frames = history.frames[-MAX_PICTURES:]
    jpegs = crop_jpegs(reader, [frame.observation for frame in frames])
    shown = [
        picture(
            data_uri(jpegs[frame.observation]),
            f"{clock.brief(frame.stamp_ns)}, {frame.traversal}, state {frame.state}, observation {frame.observation}",
        )
        for frame in frames
        if frame.observation in jpegs
    ]
    if not shown:
        return "<p>No picture of it is kept.</p>"
    return f'<div class="cards pictures">{"".join(shown)}</div>'


def _states_table(history: ObjectHistory, clock: Clock) -> str:
    by_state = {surroundings.state: surroundings for surroundings in history.surroundings}
    rows = []
    for interval in history.intervals:
        surroundings = by_state.get(interval.state)
        relations = [] if surroundings is None else [f"{r.subject} {r.name} {r.object}" for r in surroundings.relations]
        if surroundings is not None and surroundings.more:
            relations.append(f"{surroundings.more} more")
        cells = (
            str(interval.state),
            clock.brief(interval.empty_before_ns),
            clock.brief(interval.first_seen_ns),
            clock.brief(interval.last_seen_ns),
            clock.brief(interval.gone_ns),
            position_text(interval.position),
            interval.label,
            f"{interval.confidence:.2f}",
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


def _events_table(history: ObjectHistory, clock: Clock) -> str:
    rows = [
        (
            escape(event.kind),
            escape(event.from_id),
            escape(event.to_id),
            escape(clock.span(event.not_before_ns, event.not_after_ns)),
            "" if event.distance_m is None else f"{event.distance_m:.2f}",
            f"{event.probability:.2f}",
        )
        for event in history.events
    ]
    return table(("event", "from", "to", "between", "distance (m)#", "probability#"), ((row, "") for row in rows))


def _sightings_table(history: ObjectHistory, clock: Clock) -> str:
    rows = [
        (
            escape(sighting.traversal),
            str(sighting.supported),
            str(sighting.in_view),
            str(sighting.contradicted),
            escape(clock.span(sighting.first_support_ns, sighting.last_support_ns)),
            str(sighting.observation_count),
            escape(", ".join(f"{label} {share:.0%}" for label, share in sighting.labels.items())),
        )
        for sighting in history.sightings
    ]
    columns = ("traversal", "supported#", "in view#", "seen empty#", "seen", "observations#", "called")
    return table(columns, ((row, "") for row in rows))
