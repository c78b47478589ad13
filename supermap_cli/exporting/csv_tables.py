"""The map's tables as CSV files (RFC 4180, UTF-8, header line; unknown values are empty)."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TextIO

from supermap_cli.exporting.selection import ExportSource
from supermap_cli.exporting.tables import INSTANCES, TABLES, Table

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""How texts begin that spreadsheets run, see OWASP's "CSV Injection"."""
FILES = tuple(f"{table.name}.csv" for table in TABLES)


def write_csv_tables(source: ExportSource, folder: Path) -> dict[str, int]:
    """Write a file per table; returns the number of rows of each."""
    return {table.name: _write(table, source, folder / f"{table.name}.csv") for table in TABLES}


def write_objects_csv(source: ExportSource, file: TextIO) -> int:
    """Write the table of instances alone; returns its number of rows."""
    return _write_rows(INSTANCES, source, file)


def _write(table: Table, source: ExportSource, path: Path) -> int:
    with path.open("w", encoding="utf-8", newline="") as file:
        return _write_rows(table, source, file)


def _write_rows(table: Table, source: ExportSource, file: TextIO) -> int:
    count = 0
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(column.name for column in table.written_columns)
    for row in source.with_progress(table.name, table.written_rows(source)):
        writer.writerow(map(_guarded, row))
        count += 1
    return count


def _guarded(cell: object) -> object:
    """A text that a spreadsheet would take for a formula begins with an apostrophe; numbers stay numbers."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell
