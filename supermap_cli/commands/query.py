"""`supermap query`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import (
    AtOption,
    DbOption,
    JsonOption,
    LimitOption,
    check_outputs,
    database_url,
    out,
    print_json,
)
from supermap_cli.commands.tables import evidence_text, position_text, print_table, size_text
from supermap_cli.errors import QueryError

if TYPE_CHECKING:
    from supermap_cli.memory.reading import MapReader
    from supermap_cli.query.answers import Answer
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.views import InstanceView


EXAMPLES = """
Examples:

    supermap query "chair near the tv"

    supermap query how many cups are on the table

    supermap query "what changed since monday" --json

    supermap query "is the red chair still there" --crop chair.jpg

    supermap query "how many chairs" --at 10:21

    supermap query -i
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(query)


def query(  # noqa: PLR0917 - typer makes its options of them
    text: Annotated[
        list[str] | None, typer.Argument(metavar="TEXT", help="e.g. 'cup on the table', 'what changed since monday'")
    ] = None,
    at: AtOption = None,
    limit: LimitOption = 50,
    db: DbOption = None,
    json: JsonOption = False,
    interactive: Annotated[
        bool, typer.Option("--interactive", "-i", help="Ask many questions, one a line, until Ctrl-D.")
    ] = False,
    explain: Annotated[
        bool, typer.Option(help="Tell how the question was understood, and why each thing was kept or dropped.")
    ] = False,
    crop: Annotated[
        Path | None, typer.Option(metavar="FILE.jpg", help="Write the stored picture that proves the answer.")
    ] = None,
    loose: Annotated[bool, typer.Option(help="Read an unknown word as the known one that it is most like.")] = False,
    language: Annotated[
        str | None, typer.Option(metavar="CODE", help="The question's language: en, de, es, fr, zh. [default: told]")
    ] = None,
) -> None:
    """Ask the map in plain words.

    Things by name, colour and size, in relations to others ("red chair near the tv"), how many, how far, which is
    closest, what changed, when, since when, where from; at a time ("now", "on monday", "at 10:21"). Nothing found is
    an answer, too; what is not understood is refused.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light

    if interactive == bool(text):
        problem = "a question, or -i for many: one of them" if text else "no question"
        raise QueryError(problem, cure="supermap query 'chair near the tv', or supermap query -i")
    with open_store(database_url(db), read_only=True) as store:
        check_outputs(store, {"--crop": (crop, "jpeg")})
        with store.reader() as reader:

            def ask(question: str) -> None:
                _ask(reader, question, at, limit, language, explain=explain, loose=loose, json=json, crop=crop)

            if text:
                ask(" ".join(text))
            else:
                _session(reader, ask)


def _session(reader: MapReader, ask: Callable[[str], None]) -> None:
    from supermap_cli.commands.query_session import ask_until_the_end  # noqa: PLC0415 - keeps start-up light

    ask_until_the_end(reader, ask)


def _ask(
    reader: MapReader,
    text: str,
    at: str | None,
    limit: int,
    language: str | None,
    *,
    explain: bool,
    loose: bool,
    json: bool,
    crop: Path | None,
) -> None:
    from supermap_cli.query.answers import answer  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    found = answer(text, reader, at, limit, language=language, explain=explain, loose=loose)
    clock = clock_of(reader)
    if json:
        print_json(to_document(found))
    else:
        _print(found, clock)
    if crop is not None:
        _write_picture(found, reader, crop, clock, told=not json)


def _write_picture(found: Answer, reader: MapReader, path: Path, clock: Clock, *, told: bool) -> None:
    from supermap_cli.output_files import replace_file  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.answering.pictures import picture_of  # noqa: PLC0415

    picture = picture_of(found, reader)
    replace_file(path, picture.jpeg)
    if told:
        seen = f"{picture.id}, seen {clock.text(picture.stamp_ns)} (observation {picture.observation})"
        out().print(f"{path}: {seen}", markup=False)


def _print(found: Answer, clock: Clock) -> None:
    console = out()
    console.print(found.message, markup=False)
    for note in found.notes:
        console.print(f"note: {note}", markup=False)
    for reading in found.readings or ():
        console.print(f"it could also be asked: {reading}", markup=False)
    if found.instances:
        columns = ("id", "label", "position (m)", "size (m)", "presence", "seen", "left", "relation", "observations")
        print_table(console, "", columns, (_row(instance, clock) for instance in found.instances))
    if found.more != 0:
        more = "more fit" if found.more is None else f"{found.more} more fit"
        console.print(f"{more} than are listed: see --limit, or ask 'how many'", markup=False)
    if found.explanation is not None:
        console.print(f"understood as: {found.explanation.understood}", markup=False)
        console.print(f"typed: {found.explanation.tree}", markup=False)
        rows = (
            (decision.id, "kept" if decision.kept else "dropped", decision.reason)
            for decision in found.explanation.candidates
        )
        print_table(console, "", ("candidate", "", "why"), rows)


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
