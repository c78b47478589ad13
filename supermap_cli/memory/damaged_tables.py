"""The rows of a damaged SQLite file as those of the map's tables, whatever is left of its schema."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from sqlalchemy import Column, Table

from supermap_cli.memory.databases.sqlite_pages import Cell, PageFile
from supermap_schema import models
from supermap_schema.checksums import HASH_BYTES

_TYPES: dict[type, tuple[type, ...]] = {int: (int,), float: (int, float), str: (str,), bytes: (bytes,)}
"""What SQLite stores for a column; a real without a fraction as an integer."""


class DamagedTables:
    """Read when the first table is asked for."""

    def __init__(self, path: Path) -> None:
        """`path`: a file whose header is sound."""
        self._path = path

    def rows(self, table: Table) -> Iterator[dict[str, Any] | None]:
        """The rows of a table by column, and as "row id"; `None` for one that cannot be read.

        They are those of the table's own pages, then those of pages that nothing leads to and that fit its columns.
        """
        for cell in self._pages.table(table.name):
            yield None if cell is None else _row(table, cell)
        for cell in self._strays.get(table.name, ()):
            yield _row(table, cell)

    @cached_property
    def _pages(self) -> PageFile:
        return PageFile(self._path)

    @cached_property
    def _strays(self) -> dict[str, list[Cell]]:
        found: dict[str, list[Cell]] = {}
        for cell in self._pages.strays():
            table = next((each for each in models.Base.metadata.sorted_tables if _fits(each, cell[1])), None)
            if table is not None:
                found.setdefault(table.name, []).append(cell)
        return found


def _row(table: Table, cell: Cell) -> dict[str, Any]:
    row_id, values = cell
    row = dict(zip(table.columns.keys(), values, strict=False))
    key = _row_id_column(table)
    return row | ({} if key is None else {key: row_id}) | {"row id": row_id}


def _row_id_column(table: Table) -> str | None:
    """The column that is another name of the row id, and is stored as NULL."""
    keys = list(table.primary_key.columns)
    return keys[0].name if len(keys) == 1 and keys[0].type.python_type is int else None


def _fits(table: Table, values: list[Any]) -> bool:
    """Whether the values can be a row of the table; two of them differ by what a digest is."""
    if len(values) != len(table.columns):
        return False
    if not all(_is_of(table, column, value) for column, value in zip(table.columns, values, strict=True)):
        return False
    is_sum = len(str(values[-1])) == 2 * HASH_BYTES and not str(values[-1]).startswith("{")
    return table.name not in {"checksum", "before_image"} or is_sum is (table.name == "checksum")


def _is_of(table: Table, column: Column[Any], value: Any) -> bool:
    if value is None:
        return bool(column.nullable) or column.name == _row_id_column(table)
    return isinstance(value, _TYPES[column.type.python_type])
