"""The map's tables as Parquet files. Needs pyarrow, which is optional (`supermap-cli[parquet]`)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from types import ModuleType

from supermap_cli.errors import ExportError
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.exporting.tables import TABLES, Cells, Table

FILES = tuple(f"{table.name}.parquet" for table in TABLES)
CHUNK = 20_000
"""Rows per row group, which are held in memory at once."""


def write_parquet_tables(source: ExportSource, folder: Path) -> dict[str, int]:
    """Write a file per table; returns the number of rows of each. Raises `ExportError` without pyarrow."""
    pa, parquet = load_pyarrow()
    return {table.name: _write(table, source, folder / f"{table.name}.parquet", pa, parquet) for table in TABLES}


def load_pyarrow() -> tuple[ModuleType, ModuleType]:
    """Import pyarrow and pyarrow.parquet. Raises `ExportError` if they are not installed."""
    try:
        import pyarrow as pa  # noqa: PLC0415 - optional and heavy
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        raise ExportError(
            "Parquet needs pyarrow, which is not installed", cure='pip install "supermap-cli[parquet]"'
        ) from error
    return pa, parquet


def _write(table: Table, source: ExportSource, path: Path, pa: ModuleType, parquet: ModuleType) -> int:
    columns = table.written_columns
    types = {"text": pa.string(), "integer": pa.int64(), "time": pa.int64(), "real": pa.float64()}
    schema = pa.schema([(column.name, types[column.kind]) for column in columns])
    count = 0
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for chunk in _chunks(source.with_progress(table.name, table.written_rows(source))):
            arrays = [
                pa.array(cells, type=field.type) for cells, field in zip(zip(*chunk, strict=True), schema, strict=True)
            ]
            writer.write_batch(pa.record_batch(arrays, schema=schema))
            count += len(chunk)
    return count


def _chunks(rows: Iterator[Cells]) -> Iterator[list[Cells]]:
    while chunk := list(islice(rows, CHUNK)):
        yield chunk
