"""The write lock of an SQLite map: an advisory file lock that the system releases when its process dies."""

from __future__ import annotations

import atexit
import fcntl
import os
from pathlib import Path

from sqlalchemy import Connection

from supermap_cli.errors import MemoryStoreError


class FileLock:
    """Holds ``<database>.lock`` (flock) from `acquire` to `release`; the file contains the builder's process id.

    SQLite's own locks are POSIX record locks on the database, so that this one does not affect readers. The lock file
    is beside the database with links resolved.
    """

    def __init__(self, database: Path) -> None:
        self._database = database
        file = database.resolve()
        self._path = file.with_name(file.name + ".lock")
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Take the lock. Raises `MemoryStoreError` if another build holds it or the folder is not writable."""
        while self._descriptor is None:
            try:
                descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            except OSError as error:
                raise MemoryStoreError(
                    f"the map database cannot be written: {error.strerror}",
                    where=str(self._database),
                    cure="choose a writable folder with --db",
                ) from error
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                owner = os.pread(descriptor, 32, 0).decode("ascii", "replace").strip()
                os.close(descriptor)
                raise MemoryStoreError(
                    f"another build is writing this map (process {owner or 'unknown'})",
                    where=str(self._database),
                    cure="wait for it, or give another --db",
                ) from error
            if self._is_current(descriptor):
                self._descriptor = descriptor
            else:
                os.close(descriptor)
        atexit.register(self.release)
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, f"{os.getpid()}\n".encode("ascii"), 0)
        except OSError as error:
            self.release()
            raise MemoryStoreError(
                f"the map database cannot be written: {error.strerror}",
                where=str(self._database),
                cure="free space, or choose another folder with --db",
            ) from error

    def check(self, connection: Connection) -> None:
        """Nothing to check: a file lock cannot be lost."""

    def release(self) -> None:
        """Release the lock and remove its file; does nothing if it is not held."""
        if self._descriptor is None:
            return
        self._path.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = None
        atexit.unregister(self.release)

    def _is_current(self, descriptor: int) -> bool:
        """Whether the locked file still has that name: the previous holder may have removed it."""
        try:
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        except FileNotFoundError:
            return False
