"""Files that a user names as input: what the system could hang or stumble over is refused, and small texts are read."""

from __future__ import annotations

import stat
from pathlib import Path

from supermap_cli.errors import SupermapError

_SHOWN = 120
"""Characters of a path in a message."""

_MOST_TEXT_BYTES = 1 << 20
"""Bytes of a text that a person writes: the names of 20,000 classes take a third of it."""


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


def read_text(path: Path, error_type: type[SupermapError], *, what: str) -> str:
    """The text of a file that a person writes, UTF-8 with or without a byte order mark.

    Raises an error of the type where there is none, or no text of a sane size; `what` says what it should be.
    """
    check_readable(path, error_type, what=what)
    cure = f"name {what}"
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_TEXT_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise error_type(f"it cannot be read: {error.strerror}", where=str(path), cure=cure) from error
    except UnicodeDecodeError as error:
        raise error_type(
            f"it is no UTF-8 text: {error.reason} at byte {error.start}", where=str(path), cure=cure
        ) from error
    if len(content) > _MOST_TEXT_BYTES:
        raise error_type(f"it is larger than {_MOST_TEXT_BYTES >> 20} MiB", where=str(path), cure=cure)
    if "\0" in text:
        raise error_type("it is no text: it holds a NUL", where=str(path), cure=cure)
    return text


def read_class_names(path: Path, error_type: type[SupermapError], *, option: str) -> tuple[str, ...]:
    """The class names of a file, one a line; empty lines do not count. Raises an error of the type that names the
    option.
    """
    what = f"a file with the detector's class names, one a line, with --option {option}=FILE"
    lines = read_text(path.expanduser(), error_type, what=what).splitlines()
    names = tuple(line.strip() for line in lines if line.strip())
    if not names:
        raise error_type("an empty labels file", where=str(path), cure="write the class names into it, one a line")
    return names
