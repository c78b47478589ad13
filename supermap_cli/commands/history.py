"""`supermap history`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import DbOption, JsonOption, database_url, out, print_json
from supermap_cli.commands.tables import evidence_text, position_text, print_table

if TYPE_CHECKING:
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.life import History


EXAMPLES = """
Examples:

    supermap history chair-1
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(history)


def history(
    text_id: Annotated[str, typer.Argument(metavar="ID", help="an object's id, e.g. chair-7")],
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Tell the life of one object: where it stood when, what happened, and which traversal saw it."""
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.life import history as life_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        told, clock = life_of(reader, text_id), clock_of(reader)
    if json:
        print_json(to_document(told))
    else:
        _print(told, clock)


def _print(told: History, clock: Clock) -> None:
    from supermap_cli.query.keeping import evidence_notes  # noqa: PLC0415 - keeps start-up light

    console = out()
    merged = f", asked as {told.asked_id}" if told.asked_id.casefold() != told.id.casefold() else ""
    console.print(
        f"{told.id} ({told.label}), {told.presence}{merged}; observations: {evidence_text(told.evidence)}", markup=False
    )
    for note in evidence_notes([told.evidence], clock):
        console.print(f"note: {note}", markup=False)
    print_table(
        console,
        f"{len(told.intervals)} states",
        ("state#", "place seen empty", "first seen", "last seen", "gone by", "position (m)", "label", "confidence#"),
        (
            (
                str(each.state),
                clock.brief(each.empty_before_ns),
                clock.brief(each.first_seen_ns),
                clock.brief(each.last_seen_ns),
                clock.brief(each.gone_ns),
                position_text(each.position),
                each.label,
                f"{each.confidence:.2f}",
            )
            for each in told.intervals
        ),
    )
    print_table(
        console,
        f"{len(told.events)} events",
        ("event", "from", "to", "when", "distance (m)#", "probability#"),
        (
            (
                each.kind,
                _end(each.from_id, each.from_state),
                _end(each.to_id, each.to_state),
                clock.span(each.not_before_ns, each.not_after_ns),
                "" if each.distance_m is None else f"{each.distance_m:.2f}",
                f"{each.probability:.2f}",
            )
            for each in told.events
        ),
    )
    print_table(
        console,
        "sightings, in keyframes",
        ("traversal", "supported#", "in view#", "seen empty#", "first", "last", "observations#"),
        (
            (
                each.traversal,
                str(each.supported),
                str(each.in_view),
                str(each.contradicted),
                clock.brief(each.first_support_ns),
                clock.brief(each.last_support_ns),
                str(each.observation_count),
            )
            for each in told.sightings
        ),
    )


def _end(text_id: str, state: int | None) -> str:
    return text_id if state is None else f"{text_id} state {state}"
