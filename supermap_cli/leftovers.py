"""What killed programs left behind: files and folders that are named after a process, and go when it does."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from pathlib import Path


def process_runs(pid: int) -> bool:
    """Whether another process with this id is running on this machine."""
    if pid == os.getpid():
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


def new_temporary_folder(purpose: str) -> Path:
    """A folder for a recording's unpacked files or the like, which may be large: those for the same purpose that killed
    processes of this user left behind are removed first.
    """
    named = re.compile(rf"supermap-{re.escape(purpose)}-(\d+)-\w+")
    for entry in os.scandir(tempfile.gettempdir()):
        found = named.fullmatch(entry.name)
        if found is None or int(found[1]) == os.getpid() or process_runs(int(found[1])):
            continue
        if entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_uid == os.getuid():
            shutil.rmtree(entry.path, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"supermap-{purpose}-{os.getpid()}-"))
