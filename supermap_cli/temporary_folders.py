"""Folders for what is needed only while a program runs. Those of programs that were killed go with the next one.

Each holds a file that its owner keeps locked: the system takes the lock away when the owner is gone, however it ended,
so that the number of a process that another one has now tells nothing wrong.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

PREFIX = "supermap-"
"""What the names of all such folders begin with in the system's folder for temporary files."""

_OWNER = ".owner"
"""The file that the owner keeps locked."""

_ATTEMPTS = 3
"""How often a folder is made anew, where another program takes it for one left behind before it is locked."""


@dataclass(frozen=True)
class OwnedFolder:
    """A temporary folder and the descriptor that locks it."""

    path: Path
    descriptor: int

    def remove(self) -> None:
        """Remove it with all that is in it; what cannot be removed stays."""
        shutil.rmtree(self.path, ignore_errors=True)
        with suppress(OSError):
            os.close(self.descriptor)


def make_temporary_folder(prefix: str = PREFIX, parent: Path | None = None) -> OwnedFolder:
    """A new folder, in the system's folder for temporary files or in `parent`. Those with this prefix that were left
    behind there are removed first. Raises `OSError`.
    """
    remove_left_behind(prefix, parent)
    for attempt in range(_ATTEMPTS):
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
        try:
            descriptor = os.open(path / _OWNER, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError:
            shutil.rmtree(path, ignore_errors=True)
            raise
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            if attempt == _ATTEMPTS - 1:
                raise
            continue
        return OwnedFolder(path, descriptor)
    raise AssertionError


@contextmanager
def temporary_folder(prefix: str = PREFIX, parent: Path | None = None) -> Iterator[Path]:
    """The same for a `with` statement."""
    folder = make_temporary_folder(prefix, parent)
    try:
        yield folder.path
    finally:
        folder.remove()


def remove_left_behind(prefix: str = PREFIX, parent: Path | None = None) -> int:
    """Remove this user's folders of that prefix whose owner is gone; returns how many. What is no such folder, is
    another user's, or has no owner's file, stays.
    """
    removed = 0
    folder = Path(tempfile.gettempdir()) if parent is None else parent
    with suppress(OSError):
        for entry in os.scandir(folder):
            if entry.name.startswith(prefix) and _is_left_behind(Path(entry.path)):
                shutil.rmtree(entry.path, ignore_errors=True)
                removed += 1
    return removed


def _is_left_behind(folder: Path) -> bool:
    try:
        status = folder.lstat()
        if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
            return False
        descriptor = os.open(folder / _OWNER, os.O_RDWR | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True
