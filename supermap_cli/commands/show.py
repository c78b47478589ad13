"""`supermap show`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import AtOption, DbOption, JsonOption, LimitOption, database_url, out, print_json
from supermap_cli.commands.tables import evidence_text, position_text, print_table, size_text

if TYPE_CHECKING:
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.details import ObjectDetails
    from supermap_cli.query.overview import Overview
    from supermap_cli.query.views import TraversalView


EXAMPLES = """
Examples:

    supermap show

    supermap show chair-1 --db office.db

    supermap show --at 10:21

    supermap show chair-1 --at monday
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(show)


def show(
    text_id: Annotated[str | None, typer.Argument(metavar="ID", help="an object's id, e.g. chair-7")] = None,
    at: AtOption = None,
    limit: LimitOption = 50,
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Show all current objects, or everything about one; with --at, as it was at a time.

    What was last seen before that time and found gone after it is "unknown": nobody can say when it left.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.details import details, details_at  # noqa: PLC0415
    from supermap_cli.query.instants import instant_of  # noqa: PLC0415
    from supermap_cli.query.overview import Overview, overview, overview_at  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        clock = clock_of(reader)
        shown: Overview | ObjectDetails
        if at is None:
            shown = overview(reader, limit) if text_id is None else details(reader, text_id)
        else:
            instant = instant_of(at, reader, clock)
            if text_id is None:
                shown = overview_at(reader, instant, clock, limit)
            else:
                shown = details_at(reader, text_id, instant, clock)
    if json:
        print_json(to_document(shown))
    elif isinstance(shown, Overview):
        _print_overview(shown, clock)
    else:
        _print_details(shown, clock)


def _print_overview(shown: Overview, clock: Clock) -> None:
    console = out()
    rows = [
        (
            each.id,
            each.label,
            position_text(each.position),
            size_text(each.box),
            f"{each.confidence:.2f}",
            clock.brief(each.intervals[-1].last_seen_ns),
            str(each.evidence.observation_count),
        )
        for each in shown.instances
    ]
    columns = ("id", "label", "position (m)", "size (m)", "confidence#", "last seen", "observations#")
    when = "" if shown.as_of is None else f" as of {shown.as_of}"
    listed = f", the {len(rows)} seen last" if shown.more else ""
    print_table(console, f"{len(rows) + shown.more} objects{when}{listed}", columns, rows)
    if shown.counts:
        console.print(", ".join(f"{count} {label}" for label, count in shown.counts.items()), markup=False)
    if shown.unknown:
        told = [(each.id, position_text(each.position), each.standing.words) for each in shown.unknown if each.standing]
        of = f"{len(told) + shown.more_unknown} of which nobody can say"
        print_table(console, of, ("id", "position (m)", "why"), told)
    if shown.absent and shown.as_of is not None:
        console.print(f"{shown.absent} more had left by then, or came later", markup=False)
    elif shown.absent:
        console.print(f"{shown.absent} more stood there once: see `supermap diff`", markup=False)
    print_traversals(shown.traversals, clock)


def print_traversals(traversals: tuple[TraversalView, ...], clock: Clock) -> None:
    """The table of traversals, with a column for shifted clocks where there are any."""
    from supermap_cli.building.time_order import duration_text  # noqa: PLC0415 - keeps start-up light

    shifted = any(each.clock_shift_ns for each in traversals)
    columns = (
        "#",
        "traversal",
        "recording",
        "from",
        "to",
        "keyframes#",
        "status",
        *(("shifted by",) if shifted else ()),
    )
    rows = [
        (
            str(each.number),
            each.name,
            each.recording,
            clock.text(each.start_ns),
            clock.text(each.end_ns),
            str(each.keyframes),
            each.status,
            *((f"+ {duration_text(each.clock_shift_ns)}" if each.clock_shift_ns else "-",) if shifted else ()),
        )
        for each in traversals
    ]
    print_table(out(), f"{len(traversals)} traversals", columns, rows)
    if shifted:
        out().print("shifted: its clock starts before what was built earlier ends; the order of building is kept, and")
        out().print("its times in the database and in JSON are those of its recording plus that much")
    for traversal in traversals:
        for warning in traversal.warnings:
            out().print(f"{traversal.name}: warning: {warning}", markup=False)


def _print_details(shown: ObjectDetails, clock: Clock) -> None:
    console = out()
    if shown.merged_ids:
        console.print(f"{shown.id} (with {', '.join(shown.merged_ids)} merged into it)", markup=False)
    seen = shown.evidence
    beliefs = sorted(shown.label_belief.items(), key=lambda item: -item[1])[:5]
    facts = [
        ("id", shown.id),
        ("label", ", ".join(f"{label} {share:.0%}" for label, share in beliefs)),
        ("presence", f"{shown.presence} (log-odds {shown.existence_log_odds:.1f})"),
        *([] if shown.standing is None else [(f"as of {shown.as_of}", shown.standing.words)]),
        ("position (m)", position_text(shown.position)),
        ("size (m)", f"{size_text(shown.box)}, yaw {shown.box.yaw:.2f} rad"),
        ("seen", clock.span(shown.first_seen_ns, shown.last_seen_ns)),
        (
            "keyframes",
            f"{seen.supported} support it, {seen.in_view} had its place in view, {seen.contradicted} found it empty",
        ),
        ("observations", evidence_text(seen)),
    ]
    print_table(console, "", ("", ""), facts)
    print_table(
        console,
        f"{len(shown.relations)} relations",
        ("subject", "relation", "object", "since", "distance (m)#", "confidence#"),
        (
            (
                each.subject,
                each.name,
                each.object,
                clock.brief(each.since_ns),
                f"{each.distance_m:.2f}",
                f"{each.confidence:.2f}",
            )
            for each in shown.relations
        ),
    )
