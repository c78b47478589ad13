"""`supermap diff`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import DbOption, JsonOption, check_outputs, database_url, err, out, print_json
from supermap_cli.commands.tables import evidence_text, id_text, print_table

if TYPE_CHECKING:
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.diff import Diff, ObjectChange


MAX_ROWS, MAX_UNCHANGED = 60, 200
"""All changes are printed; undecidable and unchanged instances up to these numbers."""

BRIEF_KINDS = ("unchanged", "not looked at")
"""Of these only ids are printed, but for those that the two sides called differently."""

EXAMPLES = """
Examples:

    supermap diff

    supermap diff monday tuesday --json

    supermap diff 10:21 tuesday

    supermap diff monday tuesday --html report.html --plot changes.png
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(diff)


def diff(  # noqa: PLR0917 - a command line has many options
    before: Annotated[
        str | None,
        typer.Argument(metavar="A", help="a traversal, or a time [default: the last traversal but one]"),
    ] = None,
    after: Annotated[
        str | None, typer.Argument(metavar="B", help="the other one [default: the last traversal]")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a page, complete in one file: plans, pictures of both sides, a table."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the place before and after from above (.png, .svg, .pdf).")
    ] = None,
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Say what changed between two traversals or times, and what nobody can say: every thing of the two has one row.

    A traversal stands for its end; times are those of --at ('10:21', '2026-01-05T10:21:00Z', '12 s', 'now').

    "Not observed again" is not "gone": a thing has disappeared only where its place was seen empty. A new name is a
    change only where another thing stands there; else it is told as another reading.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.diff import diff as compare  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    if plot is not None:
        from supermap_cli.reports.diff_plot import check_plot  # noqa: PLC0415

        check_plot(plot)
    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        check_outputs(store, {"--html": (html, "html"), "--plot": (plot, None)})
        found, clock = compare(reader, before, after), clock_of(reader)
        if html is not None:
            from supermap_cli.reports.diff_page import write_diff_page  # noqa: PLC0415

            write_diff_page(found, reader, html)
            err().print(f"wrote {html}", markup=False)
        if plot is not None:
            from supermap_cli.reports.diff_plot import draw_diff  # noqa: PLC0415

            draw_diff(found, reader, plot)
            err().print(f"wrote {plot}", markup=False)
    if json:
        print_json(to_document(found))
    else:
        _print(found, clock)


def _print(found: Diff, clock: Clock) -> None:
    from supermap_cli.query.diff import CERTAIN_CHANGES  # noqa: PLC0415 - keeps start-up light

    console = out()
    counts = ", ".join(f"{count} {kind}" for kind, count in found.counts.items())
    console.print(f"from {found.before.name} to {found.after.name}: {counts}", markup=False)
    for note in found.notes:
        console.print(f"note: {note}", markup=False)
    columns = ("what", "id", "why", "when", "distance (m)#", "confidence#", "seen before", "seen after")
    changed = [change for change in found.changes if not _is_brief(change)]
    seen_to_change = sum(found.counts[kind] for kind in CERTAIN_CHANGES)
    shown = changed[: max(seen_to_change, MAX_ROWS)]
    if shown:
        print_table(console, "", columns, (_row(change, clock) for change in shown))
    if len(shown) < len(changed):
        console.print(
            f"{len(changed) - len(shown)} more of which nobody can tell; --json and --html have all", markup=False
        )
    for kind in BRIEF_KINDS:
        ids = [
            id_text(change.id, change.label) for change in found.changes if change.kind == kind and _is_brief(change)
        ]
        if ids:
            more = f" and {len(ids) - MAX_UNCHANGED} more" if len(ids) > MAX_UNCHANGED else ""
            console.print(f"{kind}: {'; '.join(ids[:MAX_UNCHANGED])}{more}", markup=False)


def _is_brief(change: ObjectChange) -> bool:
    """Whether its id says all: neither a change nor called differently by the two sides."""
    called = {label for label in (change.label_before, change.label_after) if label is not None}
    return change.kind in BRIEF_KINDS and (change.kind != "unchanged" or len(called) < 2)


def _row(change: ObjectChange, clock: Clock) -> tuple[str, ...]:
    when = clock.span(change.not_before_ns, change.not_after_ns) + (
        " (perhaps before)" if change.perhaps_before else ""
    )
    may_be = "".join(f"; may be {candidate.id} ({candidate.probability:.0%})" for candidate in change.may_be)
    moved = change.kind == "moved" and change.distance_m is not None
    return (
        change.kind,
        id_text(change.id, change.label),
        change.reason + may_be,
        when,
        f"{change.distance_m:.2f}" if moved else "-",
        f"{change.confidence:.2f}",
        evidence_text(change.evidence_before),
        evidence_text(change.evidence_after),
    )
