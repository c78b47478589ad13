"""`supermap history`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import (
    AtOption,
    DbOption,
    JsonOption,
    check_outputs,
    database_url,
    err,
    out,
    print_json,
)
from supermap_cli.commands.tables import evidence_text, position_text, print_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from supermap_cli.query.clock import Clock
    from supermap_cli.query.object_history import FrameView, ObjectHistory
    from supermap_cli.query.views import RelationView

MAX_ROWS = 40
"""A longer table is cut in the middle."""

EXAMPLES = """
Examples:

    supermap history chair-1

    supermap history chair-1 --at monday

    supermap history chair-1 --html chair-1.html --crops crops
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(history)


def history(  # noqa: PLR0917 - a command line has many options
    text_id: Annotated[str, typer.Argument(metavar="ID", help="an object's id, e.g. chair-7")],
    at: AtOption = None,
    crops: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Save the pictures that are kept of it as JPEGs.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a page, complete in one file, with its pictures.")
    ] = None,
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Tell the life of one object: where it stood when and next to what, what happened, who saw it, what it was called.

    With --at its life until then.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory.images import crop_jpegs  # noqa: PLC0415
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.object_history import object_history  # noqa: PLC0415
    from supermap_cli.query.time_points import parse_time_point  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        check_outputs(store, {"--html": (html, "html")})
        clock = clock_of(reader)
        history = object_history(reader, text_id, None if at is None else parse_time_point(at, reader, clock), clock)
        if crops is not None:
            _save_pictures(
                history.frames, crop_jpegs(reader, [frame.observation for frame in history.frames]), history.id, crops
            )
        if html is not None:
            from supermap_cli.reports.history_page import write_history_page  # noqa: PLC0415

            write_history_page(history, reader, html)
            err().print(f"wrote {html}", markup=False)
    if json:
        print_json(to_document(history))
    else:
        _print(history, clock)


def _save_pictures(frames: Sequence[FrameView], jpegs: dict[int, bytes], text_id: str, folder: Path) -> None:
    """Write one file per picture, named after the object, its state and the keyframe's stamp."""
    from supermap_cli.reports.files import write_file  # noqa: PLC0415 - keeps start-up light

    saved = 0
    for frame in frames:
        if frame.observation in jpegs:
            state = "x" if frame.state is None else frame.state
            name = f"{text_id.replace('/', '-')}-state{state}-{frame.stamp_ns}.jpg"
            write_file(folder / name, jpegs[frame.observation], "jpeg", option="--crops")
            saved += 1
    err().print(f"{saved} pictures saved in {folder}", markup=False)


def _print(history: ObjectHistory, clock: Clock) -> None:
    from supermap_cli.query.history_text import history_sentences  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.retention_policy import pruned_evidence_notes  # noqa: PLC0415 - keeps start-up light

    console = out()
    merged = f", asked as {history.asked_id}" if history.asked_id.casefold() != history.id.casefold() else ""
    when = "" if history.as_of is None else f" as of {history.as_of}"
    console.print(
        f"{history.id} ({history.label}), {history.presence}{when}{merged}; "
        f"observations: {evidence_text(history.evidence)}",
        markup=False,
    )
    for note in pruned_evidence_notes([history.evidence], clock):
        console.print(f"note: {note}", markup=False)
    for sentence in history_sentences(history, clock):
        console.print(f"- {sentence}", markup=False)
    console.print()
    _print_states(history, clock)
    _print_events(history, clock)
    _print_sightings(history, clock)


def _print_states(history: ObjectHistory, clock: Clock) -> None:
    by_state = {surroundings.state: surroundings for surroundings in history.surroundings}
    columns = ("state#", "place seen empty", "first seen", "last seen", "gone by", "position (m)", "label", "next to")
    rows = [
        (
            str(interval.state),
            clock.brief(interval.empty_before_ns),
            clock.brief(interval.first_seen_ns),
            clock.brief(interval.last_seen_ns),
            clock.brief(interval.gone_ns),
            position_text(interval.position),
            interval.label,
            _relations_text(history.id, by_state[interval.state].relations) if interval.state in by_state else "-",
        )
        for interval in history.intervals
    ]
    print_table(out(), f"{len(rows)} states", columns, _shorten_rows(rows))


def _print_events(history: ObjectHistory, clock: Clock) -> None:
    rows = [
        (
            event.kind,
            _state_text(event.from_id, event.from_state),
            _state_text(event.to_id, event.to_state),
            clock.span(event.not_before_ns, event.not_after_ns),
            "" if event.distance_m is None else f"{event.distance_m:.2f}",
            f"{event.probability:.2f}",
        )
        for event in history.events
    ]
    columns = ("event", "from", "to", "when", "distance (m)#", "probability#")
    print_table(out(), f"{len(rows)} events", columns, _shorten_rows(rows))


def _print_sightings(history: ObjectHistory, clock: Clock) -> None:
    pictures = {frame.traversal for frame in history.frames}
    rows = [
        (
            sighting.traversal,
            str(sighting.supported),
            str(sighting.in_view),
            str(sighting.contradicted),
            clock.brief(sighting.first_support_ns),
            clock.brief(sighting.last_support_ns),
            str(sighting.observation_count),
            ", ".join(f"{label} {share:.0%}" for label, share in list(sighting.labels.items())[:3]) or "-",
            "yes" if sighting.traversal in pictures else "-",
        )
        for sighting in history.sightings
    ]
    columns = (
        "traversal",
        "supported#",
        "in view#",
        "seen empty#",
        "first",
        "last",
        "observations#",
        "called",
        "picture",
    )
    print_table(out(), "sightings, in keyframes", columns, _shorten_rows(rows))


def _shorten_rows(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The first and last rows of a long table, and how many are left out; `--json` has all."""
    if len(rows) <= MAX_ROWS:
        return list(rows)
    half = MAX_ROWS // 2
    left_out = (f"... {len(rows) - 2 * half} more ...", *("" for _ in rows[0][1:]))
    return [*rows[:half], left_out, *rows[-half:]]


def _relations_text(own: str, relations: Sequence[RelationView]) -> str:
    """The three highest-ranked relations, with the object as the subject."""
    shown = [
        f"{relation.name} {relation.object}" if relation.subject == own else f"{relation.subject} {relation.name} it"
        for relation in relations
    ]
    return ", ".join(shown[:3]) or "-"


def _state_text(text_id: str, state: int | None) -> str:
    return text_id if state is None else f"{text_id} state {state}"
