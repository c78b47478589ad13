"""SQLite's errors as one line with a cure that fits."""

from __future__ import annotations

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases.waiting import another_program_writes

_RECOVER = "see `supermap db check`; `supermap db recover --out NEW.db` saves what can be read"
_CURES = {
    "SQLITE_FULL": "free space and try again",
    "SQLITE_IOERR": "free space on its disk, see that the disk is well, and try again",
    "SQLITE_READONLY": "check the rights of the file and its folder, or change --db",
    "SQLITE_CANTOPEN": "check the rights of the file and its folder, or change --db",
    "SQLITE_PERM": "check the rights of the file and its folder, or change --db",
    "SQLITE_CORRUPT": _RECOVER,
    "SQLITE_NOTADB": _RECOVER,
    "SQLITE_ERROR": _RECOVER,
    "SQLITE_SCHEMA": _RECOVER,
    "SQLITE_TOOBIG": _RECOVER,
    "SQLITE_CONSTRAINT": _RECOVER,
    "SQLITE_NOMEM": "free memory and try again",
}
"""The beginning of the name of SQLite's error code -> cure."""


def is_busy(error: BaseException | None) -> bool:
    """Whether another program holds a lock on the file."""
    return _name(error).startswith(("SQLITE_BUSY", "SQLITE_LOCKED"))


def sqlite_error(error: BaseException, where: str) -> MemoryStoreError:
    """The error of a map in an SQLite file."""
    if is_busy(error):
        return another_program_writes(where)
    name = _name(error)
    cure = next((cure for code, cure in _CURES.items() if name.startswith(code)), _RECOVER)
    what = "cannot be read" if cure is _RECOVER else "failed"
    return MemoryStoreError(f"the map database {what}: {error}", where=where, cure=cure)


def gone(where: str) -> MemoryStoreError:
    """The file is not where it was when its writing began."""
    return MemoryStoreError(
        "the map database was removed or moved while it was being written",
        where=where,
        cure="put the file back, with the -wal that lies beside it, or build anew",
    )


def _name(error: BaseException | None) -> str:
    return str(getattr(error, "sqlite_errorname", "") or "")
