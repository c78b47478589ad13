"""`supermap history`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import AtOption, DbOption, JsonOption, database_url, err, out, print_json
from supermap_cli.commands.tables import evidence_text, position_text, print_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from supermap_cli.query.clock import Clock
    from supermap_cli.query.life import FrameView, History
    from supermap_cli.query.views import RelationView

MOST_ROWS = 40
"""A longer table is printed from its beginning and its end."""

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
    from supermap_cli.query.instants import instant_of  # noqa: PLC0415
    from supermap_cli.query.life import history as life_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        clock = clock_of(reader)
        told = life_of(reader, text_id, None if at is None else instant_of(at, reader, clock), clock)
        if crops is not None:
            _save(told.frames, crop_jpegs(reader, [each.observation for each in told.frames]), told.id, crops)
        if html is not None:
            from supermap_cli.reports.life_page import write_life_page  # noqa: PLC0415

            write_life_page(told, reader, html)
            err().print(f"wrote {html}", markup=False)
    if json:
        print_json(to_document(told))
    else:
        _print(told, clock)


def _save(frames: Sequence[FrameView], jpegs: dict[int, bytes], text_id: str, folder: Path) -> None:
    """One file for each picture, named after the object, its state and the keyframe."""
    from supermap_cli.reports.files import write_file  # noqa: PLC0415 - keeps start-up light

    saved = 0
    for frame in frames:
        if frame.observation in jpegs:
            state = "x" if frame.state is None else frame.state
            name = f"{text_id.replace('/', '-')}-state{state}-{frame.stamp_ns}.jpg"
            write_file(folder / name, jpegs[frame.observation])
            saved += 1
    err().print(f"{saved} pictures saved in {folder}", markup=False)


def _print(told: History, clock: Clock) -> None:
    from supermap_cli.query.keeping import evidence_notes  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.story import story  # noqa: PLC0415 - keeps start-up light

    console = out()
    merged = f", asked as {told.asked_id}" if told.asked_id.casefold() != told.id.casefold() else ""
    when = "" if told.as_of is None else f" as of {told.as_of}"
    console.print(
        f"{told.id} ({told.label}), {told.presence}{when}{merged}; observations: {evidence_text(told.evidence)}",
        markup=False,
    )
    for note in evidence_notes([told.evidence], clock):
        console.print(f"note: {note}", markup=False)
    for sentence in story(told, clock):
        console.print(f"- {sentence}", markup=False)
    console.print()
    around = {each.state: each for each in told.surroundings}
    columns = ("state#", "place seen empty", "first seen", "last seen", "gone by", "position (m)", "label", "next to")
    rows = [
        (
            str(each.state),
            clock.brief(each.empty_before_ns),
            clock.brief(each.first_seen_ns),
            clock.brief(each.last_seen_ns),
            clock.brief(each.gone_ns),
            position_text(each.position),
            each.label,
            _next_to(told.id, around[each.state].relations) if each.state in around else "-",
        )
        for each in told.intervals
    ]
    print_table(console, f"{len(rows)} states", columns, _shortened(rows))
    events = [
        (
            each.kind,
            _end(each.from_id, each.from_state),
            _end(each.to_id, each.to_state),
            clock.span(each.not_before_ns, each.not_after_ns),
            "" if each.distance_m is None else f"{each.distance_m:.2f}",
            f"{each.probability:.2f}",
        )
        for each in told.events
    ]
    of_events = ("event", "from", "to", "when", "distance (m)#", "probability#")
    print_table(console, f"{len(events)} events", of_events, _shortened(events))
    _print_sightings(told, clock)


def _print_sightings(told: History, clock: Clock) -> None:
    pictures = {each.traversal for each in told.frames}
    rows = [
        (
            each.traversal,
            str(each.supported),
            str(each.in_view),
            str(each.contradicted),
            clock.brief(each.first_support_ns),
            clock.brief(each.last_support_ns),
            str(each.observation_count),
            ", ".join(f"{label} {share:.0%}" for label, share in list(each.labels.items())[:3]) or "-",
            "yes" if each.traversal in pictures else "-",
        )
        for each in told.sightings
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
    print_table(out(), "sightings, in keyframes", columns, _shortened(rows))


def _shortened(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The first and the last rows of a long table, and how many are left out; `--json` has all."""
    if len(rows) <= MOST_ROWS:
        return list(rows)
    half = MOST_ROWS // 2
    left_out = (f"... {len(rows) - 2 * half} more ...", *("" for _ in rows[0][1:]))
    return [*rows[:half], left_out, *rows[-half:]]


def _next_to(own: str, relations: Sequence[RelationView]) -> str:
    """The three relations that say most, from its own side."""
    shown = [
        f"{each.name} {each.object}" if each.subject == own else f"{each.subject} {each.name} it" for each in relations
    ]
    return ", ".join(shown[:3]) or "-"


def _end(text_id: str, state: int | None) -> str:
    return text_id if state is None else f"{text_id} state {state}"
