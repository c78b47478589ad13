"""`supermap db sql`."""

from __future__ import annotations

import json as json_module
import math
import shutil
import sys
from base64 import b64encode
from collections.abc import Callable, Iterator
from itertools import islice
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import DbOption, JsonOption, database_url, err, out, sane
from supermap_cli.commands.from_plugins import add_sql_functions
from supermap_cli.commands.tables import print_table
from supermap_cli.commands.whole_numbers import whole

if TYPE_CHECKING:
    from supermap_cli.memory.databases import SqlRows, SqlValue

EXAMPLES = """
Examples:

    supermap db sql "SELECT id, x, y, z FROM current_objects WHERE label = 'chair'"

    supermap db sql "SELECT * FROM object_history WHERE id = 'chair-1'"

    supermap db sql "SELECT kind, count(*) FROM changes GROUP BY kind" --json
"""
TABLE_LIMIT = 100
MAX_IN_MEMORY = 1 << 24
"""Bytes of a JSON document that are kept in memory before it is printed; a larger one waits in a file."""
SQL_LIMIT_S = 15.0
"""Seconds of computing; the views take far less on the largest maps of docs/benchmarks.md. Chosen."""


def sql(
    statement: Annotated[str, typer.Argument(metavar="SQL", help="One SELECT, in SQLite's words.", show_default=False)],
    db: DbOption = None,
    limit: Annotated[
        int | None,
        typer.Option(
            min=0,
            callback=whole,
            help=f"Most rows to show, 0 = all. [default: {TABLE_LIMIT}, with --json all]",
            show_default=False,
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(min=0, max=86400, callback=sane, metavar="SECONDS", help="How long it may compute, 0 = any time."),
    ] = SQL_LIMIT_S,
    json: JsonOption = False,
) -> None:
    """Ask the database in SQL; nothing can be changed.

    The views `current_objects`, `object_history`, `changes` and `trajectory` hold what is mostly asked for. Plugins may
    add functions.
    """
    from supermap_cli.memory.opening import read_sql  # noqa: PLC0415 - keeps start-up light

    most = limit if limit is not None else (0 if json else TABLE_LIMIT)
    with read_sql(database_url(db), statement, add_sql_functions, timeout) as found:
        shown = islice(found.rows, most or None)
        if json:
            _print_json(found, shown)
        else:
            _print(found, shown)


def _print(found: SqlRows, shown: Iterator[tuple[SqlValue, ...]]) -> None:
    rows = list(shown)
    numeric = [all(isinstance(value, int | float | None) for value in column) for column in zip(*rows, strict=True)]
    columns = [name + "#" * right for name, right in zip(found.columns, numeric, strict=True)] if rows else []
    print_table(out(), "" if rows else "no rows", columns, ([_cell(value) for value in row] for row in rows))
    if next(found.rows, None) is not None:
        err().print(f"only the first {len(rows)} rows are shown: --limit 0 shows all", markup=False)


def _print_json(found: SqlRows, shown: Iterator[tuple[SqlValue, ...]]) -> None:
    """The document, a row a line, written while the rows are read."""
    with SpooledTemporaryFile(MAX_IN_MEMORY, "w+", encoding="utf-8", newline="") as document:
        _write_json(found, shown, document.write)
        document.seek(0)
        shutil.copyfileobj(document, sys.stdout)  # only now, so that a statement that fails prints nothing


def _write_json(found: SqlRows, shown: Iterator[tuple[SqlValue, ...]], write: Callable[[str], object]) -> None:
    write(f'{{\n  "columns": {_dumps(found.columns)},\n  "rows": [')
    for index, row in enumerate(shown):
        write(f"{',' if index else ''}\n    {_dumps([_json_value(value) for value in row])}")
    write(f'\n  ],\n  "complete": {_dumps(next(found.rows, None) is None)}\n}}\n')


def _cell(value: SqlValue) -> str:
    if value is None:
        return "-"
    return f"<{len(value)} bytes>" if isinstance(value, bytes) else str(value)


def _json_value(value: SqlValue) -> object:
    """JSON has neither bytes nor infinity."""
    if isinstance(value, bytes):
        return {"base64": b64encode(value).decode()}
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _dumps(value: object) -> str:
    return json_module.dumps(value, ensure_ascii=False, allow_nan=False)
