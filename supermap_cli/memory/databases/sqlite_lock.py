"""The write lock of an SQLite map: an advisory file lock that the system releases when its process dies."""

from __future__ import annotations

import atexit
import errno
import fcntl
import os
import struct
from pathlib import Path

from sqlalchemy import Connection

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.databases.sqlite_errors import gone

_OFD_SETLK = 37
"""`F_OFD_SETLK` of Linux, see fcntl(2): a lock of the open file, not of the process."""
_FLOCK = struct.Struct("@hhqqi4x")
"""`struct flock` of 64-bit Linux: type, whence, start, length, process."""
_LOCKED_BYTE = 1 << 62
"""An offset that no database reaches: SQLite's files end at 281 TB (2^48 bytes), its own locks lie at 1 GiB."""


class FileLock:
    """Holds ``<database>.lock`` (flock) from `acquire` to `release`; the file contains the builder's process id.

    SQLite's own locks are POSIX record locks on the database, so that this one does not affect readers. The lock file
    is beside the database with links resolved. A database that exists has other names where it has hard links, so one
    byte of the file itself is locked, too, far behind its contents: an open file description lock, which goes over NFS
    and is not lost when SQLite closes the file.
    """

    def __init__(self, database: Path) -> None:
        self._database = database
        file = database.resolve()
        self._path = file.with_name(file.name + ".lock")
        self._descriptor: int | None = None
        self._file: int | None = None

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
            self._lock_file()
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, f"{os.getpid()}\n".encode("ascii"), 0)
        except OSError as error:
            self.release()
            raise MemoryStoreError(
                f"the map database cannot be written: {error.strerror}",
                where=str(self._database),
                cure="free space, or choose another folder with --db",
            ) from error
        except MemoryStoreError:
            self.release()
            raise

    def check(self, connection: Connection) -> None:
        """A file lock cannot be lost, but the file can; one that was created since is locked now."""
        if self._file is None:
            self._lock_file()
        self.check_place()

    def check_place(self) -> None:
        """Raise `MemoryStoreError` if the database was removed, moved, or replaced by another file."""
        if self._file is None:
            return
        try:
            there = os.path.samestat(os.fstat(self._file), self._database.stat())
        except OSError as error:
            raise gone(str(self._database)) from error
        if not there:
            raise MemoryStoreError(
                "another file was put in the place of the map database while it was being written",
                where=str(self._database),
                cure="put the file back, with the -wal that lies beside it, or build anew",
            )

    def leave_file(self) -> None:
        """The database is about to be removed by the holder, who may create it anew."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def release(self) -> None:
        """Release the lock and remove its file; does nothing if it is not held."""
        if self._descriptor is None:
            return
        self.leave_file()
        self._path.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = None
        atexit.unregister(self.release)

    def _lock_file(self) -> None:
        """Lock a byte of the database, if it exists. It stays open until `release`, after SQLite has closed it: closing
        a file gives up all record locks of the process on it.
        """
        try:
            descriptor = os.open(self._database, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            return
        try:
            fcntl.fcntl(descriptor, _OFD_SETLK, _FLOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, _LOCKED_BYTE, 1, 0))
        except OSError as error:
            if error.errno in {errno.EAGAIN, errno.EACCES}:
                os.close(descriptor)
                raise MemoryStoreError(
                    "another build is writing this map under another name",
                    where=str(self._database),
                    cure="wait for it, or give another --db",
                ) from error
        self._file = descriptor  # where the file system knows no such locks, the lock of the name has to do

    def _is_current(self, descriptor: int) -> bool:
        """Whether the locked file still has that name: the previous holder may have removed it."""
        try:
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        except FileNotFoundError:
            return False
