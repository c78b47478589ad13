"""What a user names as input and the system could hang or stumble over."""

from __future__ import annotations

import stat
from pathlib import Path

from supermap_cli.errors import SupermapError

_SHOWN = 120
"""Characters of a path in a message."""


def check_readable(path: Path, error_type: type[SupermapError], *, what: str, folder: bool = False) -> None:
    """Raise an error of the type where a path is a pipe, a device or (unless `folder`) a folder, or no path at all.

    `what` says what it should be. A path where nothing is passes: who opens it knows what to say.
    """
    text = str(path)
    where = text if len(text) <= _SHOWN else f"{text[:60]}...{text[-20:]}"
    cure = f"name {what}"
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it holds a NUL"
        raise error_type(f"it cannot be read: {reason}", where=where.replace("\0", "\\0"), cure=cure) from error
    if stat.S_ISDIR(mode) and not folder:
        raise error_type("a folder, not a file", where=where, cure=cure)
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise error_type("a device or a pipe, no regular file", where=where, cure=cure)
