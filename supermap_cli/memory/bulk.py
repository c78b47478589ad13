"""Writes a whole map at once, faster than builds do: without a journal, the largest table's indices last."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine
from sqlalchemy.dialects import sqlite as sqlite_dialect
from sqlalchemy.schema import CreateIndex

from supermap_schema import models, sqlite
from supermap_schema.checksums import store_all_sums

LATE = models.Base.metadata.tables["observation"]
"""Its indices are created after all its rows."""


class BulkWriter:
    """A new SQLite database, open for writing whole tables until `finish`."""

    def __init__(self, path: Path) -> None:
        from supermap_schema.upgrading import upgrade  # noqa: PLC0415 - Alembic is needed only here

        self.path = path
        engine = create_engine(f"sqlite:///{path}")
        with engine.begin() as connection:
            upgrade(connection)
        engine.dispose()
        self._connection = sqlite3.connect(path, isolation_level=None)
        for pragma in ("journal_mode = OFF", "synchronous = OFF", "cache_size = -200000", "temp_store = FILE"):
            self._connection.execute(f"PRAGMA {pragma}")
        for index in LATE.indexes:
            self._connection.execute(f'DROP INDEX "{index.name}"')
        self._connection.execute("BEGIN")

    def add(self, table: str, rows: Iterable[dict[str, Any]]) -> None:
        """Add rows as dictionaries, all with the same columns."""
        columns: tuple[str, ...] | None = None
        values = []
        for row in rows:
            columns = columns or tuple(row)
            values.append(tuple(row.values()))
        if columns is not None:
            self.add_values(table, columns, values)

    def add_values(self, table: str, columns: Sequence[str], values: Iterable[Sequence[Any]]) -> None:
        """Add rows as tuples."""
        names, marks = ", ".join(f'"{name}"' for name in columns), ", ".join("?" * len(columns))
        self._connection.executemany(f'INSERT INTO "{table}" ({names}) VALUES ({marks})', values)  # noqa: S608 - ours

    def finish(self) -> None:
        """Create the indices, store the checksums, and set the pragmas that a build sets."""
        self._connection.execute("COMMIT")
        for index in sorted(LATE.indexes, key=lambda index: str(index.name)):
            self._connection.execute(str(CreateIndex(index).compile(dialect=sqlite_dialect.dialect())))
        for pragma in sqlite.WRITER_PRAGMAS:
            self._connection.execute(pragma)
        self._connection.close()
        engine = create_engine(f"sqlite:///{self.path}")
        with engine.begin() as connection:
            store_all_sums(connection)
        engine.dispose()
