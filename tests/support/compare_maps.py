"""Compares two maps row by row, in every table and column but the timings of their builds.

    python tests/support/compare_maps.py before.db after.db

Either may be a SQLite file of an older schema: columns that only one of them has are named and left out, renamed ones
are given with `--renamed table.old=new`. Exits with 1 where rows differ.
"""

from __future__ import annotations

import argparse
import sqlite3
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

VOLATILE = {("traversal", "timings"), ("traversal", "versions"), ("traversal", "config"), ("traversal", "recording")}
"""Columns that say how, where and by which version a map was built, not what is in it."""

UNCOMPARED_TABLES = {"alembic_version", "checkpoint", "before_image"}

Row = tuple[object, ...]


def tables(connection: sqlite3.Connection) -> dict[str, list[str]]:
    """Table -> its columns, without indices' own tables."""
    found = {}
    names = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' ORDER BY name")
    for name, sql in names.fetchall():
        shadow = "state_box" in name or "instance_label" in name or name.startswith("sqlite_") or "VIRTUAL" in sql
        if not shadow and name not in UNCOMPARED_TABLES:
            found[name] = [column[1] for column in connection.execute(f"PRAGMA table_info('{name}')")]
    return found


def rows(connection: sqlite3.Connection, table: str, columns: Sequence[str]) -> list[Row]:
    """All rows of a table, in one order for both maps."""
    listed = ", ".join(f'"{column}"' for column in columns)
    return sorted(connection.execute(f"SELECT {listed} FROM {table}").fetchall(), key=repr)


def compare(before: Path, after: Path, renamed: Mapping[str, str]) -> list[str]:
    """What differs, a line each; nothing where the maps are the same. `renamed` maps "table.old" to "new"."""
    differences = []
    with closing(sqlite3.connect(before)) as first, closing(sqlite3.connect(after)) as second:
        old, new = tables(first), tables(second)
        for table in sorted(old.keys() | new.keys()):
            if table not in old or table not in new:
                print(f"{table}: only in {after if table in new else before}")
                continue
            pairs = [(column, renamed.get(f"{table}.{column}", column)) for column in old[table]]
            shared = [(a, b) for a, b in pairs if b in new[table] and (table, b) not in VOLATILE]
            added = sorted(set(new[table]) - {b for _, b in pairs})
            lost = sorted(a for a, b in pairs if b not in new[table])
            if added or lost:
                print(f"{table}: not compared: {', '.join([*lost, *added])}")
            left = rows(first, table, [a for a, _ in shared])
            right = rows(second, table, [b for _, b in shared])
            if left != right:
                differences.append(_described(table, [b for _, b in shared], left, right))
            else:
                print(f"{table}: {len(left)} rows equal")
    return differences


def _described(table: str, columns: Sequence[str], left: list[Row], right: list[Row]) -> str:
    if len(left) != len(right):
        return f"{table}: {len(left)} rows before, {len(right)} after"
    differing = [(a, b) for a, b in zip(left, right, strict=True) if a != b]
    named = sorted({column for a, b in differing for column, x, y in zip(columns, a, b, strict=True) if x != y})
    return f"{table}: {len(differing)} of {len(left)} rows differ, in {', '.join(named)}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--renamed", action="append", default=[], metavar="TABLE.OLD=NEW")
    given = parser.parse_args()
    differences = compare(given.before, given.after, dict(pair.split("=", 1) for pair in given.renamed))
    print("\n".join(differences) if differences else "the maps are the same")
    return bool(differences)


if __name__ == "__main__":
    sys.exit(main())
