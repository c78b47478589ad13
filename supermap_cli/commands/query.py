"""`supermap query`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import AtOption, DbOption, JsonOption, LimitOption, database_url, out, print_json
from supermap_cli.commands.tables import evidence_text, position_text, print_table, size_text

if TYPE_CHECKING:
    from supermap_cli.query.answers import Answer
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.views import InstanceView


EXAMPLES = """
Examples:

    supermap query "chair near the tv"

    supermap query how many cups

    supermap query "cup on the table in monday" --json

    supermap query "how many chairs" --at 10:21
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(query)


def query(
    text: Annotated[list[str], typer.Argument(metavar="TEXT", help="e.g. 'cup on the table', 'how many chairs'")],
    at: AtOption = None,
    limit: LimitOption = 50,
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Ask the map in plain words.

    Things with or without a relation to other things (near, beside, on, under, inside, above, attached to), counting
    ("how many chairs"), and a time (now, earlier, first, last, "in monday", "at 10:21"). Nothing found is an answer,
    too.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.answers import answer  # noqa: PLC0415
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        found = answer(" ".join(text), reader, at, limit)
        clock = clock_of(reader)
    if json:
        print_json(to_document(found))
    else:
        _print(found, clock)


def _print(found: Answer, clock: Clock) -> None:
    console = out()
    console.print(found.message, markup=False)
    for note in found.notes:
        console.print(f"note: {note}", markup=False)
    if found.instances:
        columns = ("id", "label", "position (m)", "size (m)", "presence", "seen", "left", "relation", "observations")
        print_table(console, "", columns, (_row(instance, clock) for instance in found.instances))
    if found.more != 0:
        more = "more fit" if found.more is None else f"{found.more} more fit"
        console.print(f"{more} than are listed: see --limit, or ask 'how many'", markup=False)


def _row(found: InstanceView, clock: Clock) -> tuple[str, ...]:
    newest = found.intervals[-1]
    relations = dict.fromkeys(
        f"{relation.name} {relation.object} ({relation.basis}, {relation.distance_m:.2f} m)"
        for relation in found.relations
    )
    return (
        found.id,
        found.label,
        position_text(found.position),
        size_text(found.box),
        found.presence,
        clock.span(newest.first_seen_ns, newest.last_seen_ns),
        "-" if newest.gone_ns is None else clock.span(newest.last_seen_ns, newest.gone_ns),
        "; ".join(relations) or "-",
        evidence_text(found.evidence),
    )
