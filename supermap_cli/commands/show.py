"""`supermap show`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import AtOption, DbOption, JsonOption, LimitOption, database_url, err, out, print_json
from supermap_cli.commands.tables import evidence_text, id_text, position_text, print_table, size_text

if TYPE_CHECKING:
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.details import CalledView, ObjectDetails
    from supermap_cli.query.overview import Overview
    from supermap_cli.query.views import EvidenceView, TraversalView


EXAMPLES = """
Examples:

    supermap show

    supermap show chair-1 --db office.db

    supermap show --at 10:21

    supermap show chair-1 --at monday

    supermap show chair-1 --picture chair.png
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(show)


def show(  # noqa: PLR0917 - the options of the command
    text_id: Annotated[str | None, typer.Argument(metavar="ID", help="an object's id, e.g. chair-7")] = None,
    at: AtOption = None,
    limit: LimitOption = 50,
    db: DbOption = None,
    json: JsonOption = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Draw a sheet about one object (.png, .svg, .pdf): first, best and last view, place, life.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show all current objects, or everything about one; with --at, as it was at a time.

    What was last seen before that time and found gone after it is "unknown": nobody can say when it left.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.details import details, details_at  # noqa: PLC0415
    from supermap_cli.query.overview import Overview, overview, overview_at  # noqa: PLC0415
    from supermap_cli.query.time_points import parse_time_point  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    if picture is not None:
        _check_picture(picture, text_id, at)
    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        clock = clock_of(reader)
        if picture is not None and text_id is not None:
            from supermap_cli.output_files import refuse_files_of  # noqa: PLC0415
            from supermap_cli.reports.object_sheet import write_object_sheet  # noqa: PLC0415 - draws with matplotlib

            if store.file is not None:
                refuse_files_of(store.file, picture, option="--picture")
            write_object_sheet(reader, text_id, picture)
            err().print(f"wrote {picture}", markup=False)
        shown: Overview | ObjectDetails
        if at is None:
            shown = overview(reader, limit) if text_id is None else details(reader, text_id)
        else:
            time_point = parse_time_point(at, reader, clock)
            if text_id is None:
                shown = overview_at(reader, time_point, clock, limit)
            else:
                shown = details_at(reader, text_id, time_point, clock)
    if json:
        print_json(to_document(shown))
    elif isinstance(shown, Overview):
        _print_overview(shown, clock)
    else:
        _print_details(shown, clock)


def _check_picture(picture: Path, text_id: str | None, at: str | None) -> None:
    if text_id is None:
        raise typer.BadParameter("is about one object: say which", param_hint="--picture")
    if at is not None:
        raise typer.BadParameter("shows the whole life of an object, not a time", param_hint="--picture")
    from supermap_cli.reports.object_sheet import check_sheet  # noqa: PLC0415

    check_sheet(picture)


def _print_overview(shown: Overview, clock: Clock) -> None:
    console = out()
    rows = [
        (
            id_text(instance.id, instance.label),
            instance.label,
            position_text(instance.position),
            size_text(instance.box),
            f"{instance.confidence:.2f}",
            clock.brief(instance.intervals[-1].last_seen_ns),
            str(instance.evidence.observation_count),
        )
        for instance in shown.instances
    ]
    columns = ("id", "label", "position (m)", "size (m)", "confidence#", "last seen", "observations#")
    when = "" if shown.as_of is None else f" as of {shown.as_of}"
    listed = f", the {len(rows)} seen last" if shown.more else ""
    print_table(console, f"{len(rows) + shown.more} objects{when}{listed}", columns, rows)
    if shown.counts:
        console.print(", ".join(f"{count} {label}" for label, count in shown.counts.items()), markup=False)
    if shown.unknown:
        unknown_rows = [
            (id_text(instance.id, instance.label), position_text(instance.position), instance.standing.words)
            for instance in shown.unknown
            if instance.standing
        ]
        of = f"{len(unknown_rows) + shown.more_unknown} of which nobody can say"
        print_table(console, of, ("id", "position (m)", "why"), unknown_rows)
    if shown.doubted:
        doubted = f"{len(shown.doubted) + shown.more_doubted} doubted: once believed in, and more likely not real"
        doubted_rows = [
            (
                id_text(instance.id, instance.label),
                position_text(instance.position),
                f"{instance.confidence:.2f}",
                clock.brief(instance.intervals[-1].last_seen_ns),
                _doubt_text(instance.evidence),
            )
            for instance in shown.doubted
        ]
        print_table(
            console, doubted, ("id", "position (m)", "confidence#", "last seen", "for and against"), doubted_rows
        )
    if shown.absent and shown.as_of is not None:
        console.print(f"{shown.absent} more had left by then, or came later", markup=False)
    elif shown.absent:
        more = "`supermap diff`" if len(shown.traversals) > 1 else "`supermap db sql 'SELECT * FROM object_history'`"
        console.print(f"{shown.absent} more stood there once: see {more}", markup=False)
    print_traversals(shown.traversals, clock)


def _doubt_text(evidence: EvidenceView) -> str:
    """What speaks for and against an object."""
    empty = f"seen empty in {evidence.contradicted}" if evidence.contradicted else "never seen empty"
    return f"found in {evidence.supported} of {evidence.in_view} keyframes with its place in view, {empty}"


def print_traversals(traversals: tuple[TraversalView, ...], clock: Clock) -> None:
    """The table of traversals, with columns for shifted clocks where there are any, and for detectors that differ."""
    from supermap_cli.memory.time_order import duration_text  # noqa: PLC0415 - keeps start-up light

    shifted = any(traversal.clock_shift_ns for traversal in traversals)
    several = len({traversal.detector for traversal in traversals}) > 1
    columns = (
        "#",
        "traversal",
        "recording",
        "from",
        "to",
        "keyframes#",
        "status",
        *(("detector",) if several else ()),
        *(("shifted by",) if shifted else ()),
    )
    rows = [
        (
            str(traversal.number),
            traversal.name,
            traversal.recording,
            clock.text(traversal.start_ns),
            clock.text(traversal.end_ns),
            str(traversal.keyframes),
            traversal.status,
            *((traversal.detector or "-",) if several else ()),
            *(
                (f"+ {duration_text(traversal.clock_shift_ns)}" if traversal.clock_shift_ns else "-",)
                if shifted
                else ()
            ),
        )
        for traversal in traversals
    ]
    print_table(out(), f"{len(traversals)} traversals", columns, rows)
    if shifted:
        out().print("shifted: its clock starts before what was built earlier ends; the order of building is kept, and")
        out().print("its times in the database and in JSON are those of its recording plus that much")
    for traversal in traversals:
        for warning in traversal.warnings:
            out().print(f"{traversal.name}: warning: {warning}", markup=False)


def _called_text(called: tuple[CalledView, ...]) -> str:
    """What each traversal called it, with its detector where these differ; empty where all called it the same."""
    if len({view.label for view in called}) < 2:
        return ""
    several = len({view.detector for view in called}) > 1
    return "; ".join(
        f"{view.label} in {view.traversal}" + (f" (by {view.detector or 'an unknown detector'})" if several else "")
        for view in called
    )


def _print_details(shown: ObjectDetails, clock: Clock) -> None:
    console = out()
    if shown.merged_ids:
        console.print(f"{shown.id} (with {', '.join(shown.merged_ids)} merged into it)", markup=False)
    seen = shown.evidence
    beliefs = sorted(shown.label_belief.items(), key=lambda item: -item[1])[:5]
    facts = [
        ("id", id_text(shown.id, shown.label)),
        ("label", ", ".join(f"{label} {share:.0%}" for label, share in beliefs)),
        *([("called", called)] if (called := _called_text(shown.called)) else []),
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
                relation.subject,
                relation.name,
                relation.object,
                clock.brief(relation.since_ns),
                f"{relation.distance_m:.2f}",
                f"{relation.confidence:.2f}",
            )
            for relation in shown.relations
        ),
    )
