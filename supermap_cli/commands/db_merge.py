"""`supermap db merge`: two memories of one place become one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import DbOption, JsonOption, WaitOption, database_url, err, out, print_json, waiting
from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from supermap_cli.map_merge.merge import MergeSummary, Progress
    from supermap_cli.map_merge.report import MergeReport

EXAMPLES = """
Examples:

    supermap db merge other-robot.db --into office.db --dry-run

    supermap db merge other-robot.db --into office.db

    supermap db merge tuesday.db --db monday.db --align '2.5 0 0 90' --json
"""


def merge(  # noqa: PLR0917 - a command line has many options
    other: Annotated[str, typer.Argument(metavar="OTHER", help="The map to take in, a path or URL; it is only read.")],
    db: DbOption = None,
    into: Annotated[
        str | None, typer.Option("--into", metavar="PATH_OR_URL", help="The map that grows: the same as --db.")
    ] = None,
    align: Annotated[
        str,
        typer.Option(
            metavar="auto|none|'X Y Z YAW'",
            help="How the other map is placed: by its structure; not at all, where both have one frame; or by where "
            "its origin lies, and its heading in degrees.",
        ),
    ] = "auto",
    again: Annotated[bool, typer.Option("--again", help="Also where both maps hold the same recording.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be, and write nothing.")] = False,
    wait: WaitOption = 30.0,
    json: JsonOption = False,
) -> None:
    """Take another map of the same place into a map: its traversals come after those that are there."""
    from supermap_cli.map_merge.merge import MapMerge  # noqa: PLC0415
    from supermap_cli.map_merge.report import report_of  # noqa: PLC0415
    from supermap_cli.memory import open_store  # noqa: PLC0415 - heavy imports only when a merge starts
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    if db is not None and into is not None:
        raise typer.BadParameter("give --into or --db, not both")
    url = database_url(db if into is None else into)
    with (
        open_store(url, read_only=dry_run, waiting=waiting(wait)) as store,
        open_store(other, read_only=True) as source,
        _progress() as progress,
    ):
        summary = MapMerge(store, source, again=again, progress=progress).run(align, dry_run=dry_run)
        report = report_of(summary, store.where, source.where, store.instance_ids())
    for warning in summary.warnings:
        err().print(f"warning: {warning}", markup=False)
    if json:
        print_json(to_document(report))
    else:
        _print(report, summary)


def _print(report: MergeReport, summary: MergeSummary) -> None:
    console = out()
    done = "merged into" if report.written else "dry run: nothing is written; this would be merged into"
    console.print(f"{report.other}: {done} {report.into}", markup=False)
    console.print(f"  {summary.placement.method}", markup=False)
    for traversal in report.traversals:
        renamed = "" if traversal.name == traversal.other_name else f" as {traversal.name}"
        console.print(f"  traversal {traversal.other_name}{renamed}", markup=False)
    known = [obj for obj in report.objects if obj.how != "new"]
    rows = (
        (
            obj.other_id,
            obj.id,
            obj.label,
            obj.how,
            "-" if obj.distance_m is None else f"{obj.distance_m:.2f}",
            ", ".join(f"{one.id} ({one.probability:.0%})" for one in obj.candidates) or "-",
        )
        for obj in sorted(report.objects, key=lambda obj: obj.how == "new")
    )
    columns = ("there", "here", "label", "is", "moved by (m)#", "perhaps")
    print_table(console, f"{len(report.objects)} objects, {len(known)} of them known here", columns, rows)
    if report.gone:
        console.print(f"seen to be gone: {', '.join(report.gone)}", markup=False)


@contextmanager
def _progress() -> Iterator[Progress]:
    """A bar over the other map's keyframes, on stderr."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    console = err()
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %  left"))
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("holding one map against the other", total=None)
        yield lambda done, count: bar.update(task, completed=done, total=count)
