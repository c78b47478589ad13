"""`supermap db`: check, recover, upgrade, info, sql, vacuum, merge."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands import db_merge, db_sql, db_vacuum
from supermap_cli.commands.common import DbOption, JsonOption, WaitOption, database_url, err, out, print_json, waiting
from supermap_cli.commands.show import print_traversals
from supermap_cli.commands.tables import print_table
from supermap_cli.errors import MemoryStoreError

if TYPE_CHECKING:
    from supermap_cli.query.clock import Clock
    from supermap_cli.query.inventory import Inventory


EXAMPLES = """
Examples:

    supermap db info --db office.db

    supermap db check --json

    supermap db sql "SELECT id, label, x, y, z FROM current_objects"
"""
EXAMPLE = "\nExample:\n\n    supermap db {}\n"


def register(app: typer.Typer) -> None:
    """Add the group to the app."""
    group = typer.Typer(no_args_is_help=True, help="Look after the map database, or ask it in SQL.", epilog=EXAMPLES)
    group.command(epilog=EXAMPLE.format("check --json"))(check)
    group.command(epilog=EXAMPLE.format("recover --db damaged.db --out new.db"))(recover)
    group.command(epilog=EXAMPLE.format("upgrade --db office.db"))(upgrade)
    group.command(epilog=EXAMPLE.format("info --db office.db"))(info)
    group.command(epilog=db_sql.EXAMPLES)(db_sql.sql)
    group.command(epilog=db_vacuum.EXAMPLES)(db_vacuum.vacuum)
    group.command(epilog=db_merge.EXAMPLES)(db_merge.merge)
    app.add_typer(group, name="db")


def check(
    db: DbOption = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="First make indices, views, search tables and counts anew.")
    ] = False,
    wait: WaitOption = 30.0,
    json: JsonOption = False,
) -> None:
    """Verify the map's invariants; exit code 1 if any is broken.

    With --repair what follows from other rows is made anew; what was observed stays as it is.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory.checking import check as problems_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with (
        _file_named(database_url(db)),
        open_store(database_url(db), read_only=not repair, waiting=waiting(wait)) as store,
    ):
        for done in store.repair() if repair else ():
            err().print(f"repaired: {done}", markup=False)
        with store.reader() as reader:
            problems = problems_of(reader)
    if json:
        print_json({"path": store.where, "sound": not problems, "problems": to_document(problems)})
    elif problems:
        rows = ((problem.table, problem.row, problem.what) for problem in problems)
        print_table(out(), f"{len(problems)} problems in {store.where}", ("table", "row", "what is wrong"), rows)
    else:
        out().print(f"{store.where}: sound", markup=False)
    if problems:
        raise typer.Exit(1)


@contextmanager
def _file_named(url: str) -> Iterator[None]:
    """An error that leads to `supermap db check` says instead what is wrong with the file, and what saves the rest."""
    from supermap_cli.memory.databases import database_of  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory.databases.sqlite_pages import header_fault  # noqa: PLC0415

    try:
        yield
    except MemoryStoreError as error:
        if "supermap db check" not in (error.cure or ""):
            raise
        file = database_of(url).file
        fault = header_fault(file) if file is not None and file.is_file() else None
        what = error.what if fault is None else f"{error.what}; {fault}"
        cure = "`supermap db recover --out NEW.db` saves what can be read"
        raise MemoryStoreError(what, where=error.where, cure=cure) from error


def recover(
    out_path: Annotated[Path, typer.Option("--out", metavar="NEW.db", help="The new map; it must not be there yet.")],
    db: DbOption = None,
    json: JsonOption = False,
) -> None:
    """Save what can be read of a damaged map into a new one; exit code 1 if the new one still breaks invariants.

    The damaged file is only read. Rows that cannot be read, and those that contradict what is left, are lost; what
    follows from other rows is made anew.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory.checking import check as problems_of  # noqa: PLC0415
    from supermap_cli.memory.recovering import recover as save  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    found = save(database_url(db), out_path)
    for done in found.repaired:
        if done.startswith("checksum"):
            err().print(f"repaired: {done}", markup=False)
    with open_store(str(out_path), read_only=True) as store, store.reader() as reader:
        problems = problems_of(reader)
    if json:
        problem_documents = to_document(problems)
        print_json({"path": str(out_path), "saved": found.saved, "lost": found.lost, "problems": problem_documents})
    else:
        rows = ((name.replace("_", " "), str(count), str(found.lost[name])) for name, count in found.saved.items())
        print_table(out(), str(out_path), ("table", "saved#", "lost#"), rows)
        out().print(
            f"{len(problems)} problems are left: see `supermap db check`" if problems else "sound", markup=False
        )
    if problems:
        raise typer.Exit(1)


def upgrade(db: DbOption = None, wait: WaitOption = 30.0, json: JsonOption = False) -> None:
    """Bring the database to this program's version, and mend what older versions wrote wrong.

    Relations that went on although one of their ends had left its place end when it did.
    """
    from supermap_cli.memory.databases import database_of  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory.opening import mend_edges, upgrade_database  # noqa: PLC0415

    url = database_url(db)
    before, after = upgrade_database(url, waiting(wait))
    where, ended = database_of(url).where, mend_edges(url, waiting(wait))
    if json:
        print_json({"path": where, "before": before, "after": after, "ended_relations": ended})
        return
    if before == after:
        err().print(f"{where}: has version {after} already", markup=False)
    else:
        err().print(f"{where}: version {before} is now {after}", markup=False)
    if ended:
        what = "relation was" if ended == 1 else "relations were"
        err().print(f"{where}: {ended} {what} of a place that an end had left: ended", markup=False)


def info(
    db: DbOption = None,
    json: JsonOption = False,
    timings: Annotated[bool, typer.Option("--timings/--no-timings", help="Show how long each stage took.")] = True,
) -> None:
    """Show what is in the database, from where, how it was built, and how long that took."""
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.inventory import inventory  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=True) as store, store.reader() as reader:
        found, clock = inventory(reader), clock_of(reader)
    if json:
        print_json(to_document(found))
    else:
        _print(found, clock, timings=timings)


def _print(found: Inventory, clock: Clock, *, timings: bool) -> None:
    console = out()
    size = f"{found.size_bytes / 1e6:.1f} MB"
    console.print(f"{found.path}: version {found.version} (migration {found.revision}), {size}", markup=False)
    rows = ((name.replace("_", " "), str(count)) for name, count in found.counts.items())
    print_table(console, "", ("rows", "count#"), rows)
    print_traversals(found.traversals, clock)
    for traversal in found.traversals if timings else ():
        span_s = (traversal.end_ns - traversal.start_ns) / 1e9
        total_s = traversal.timings_s.get("total", sum(traversal.timings_s.values()))
        factor = f", {span_s / total_s:.1f} x real time" if total_s > 0 else ""
        stages = ((stage, f"{seconds:.2f}") for stage, seconds in traversal.timings_s.items())
        print_table(console, f"{traversal.name}: {span_s:.1f} s recorded{factor}", ("stage", "seconds#"), stages)
