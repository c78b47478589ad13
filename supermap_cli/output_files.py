"""The one gate for every file that a user names as output: only an older file of its kind is written over."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from supermap_cli.errors import ExportError

DATABASE_SUFFIXES = ("", "-wal", "-shm", "-journal", ".lock")
"""What SQLite and the build lock call their files: the database's name and one of these."""

NAME_BYTES = 255
"""Bytes; the longest file name of Linux's file systems (`NAME_MAX`)."""
_HEAD_BYTES = 1024
"""Bytes of a file by which its kind is told; any of the marks below lies within them."""


def _starts(*marks: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(marks)


def _is_text(head: bytes) -> bool:
    return b"\x00" not in head and not head.startswith((b"{", b"<", b"%PDF", b"PAR1"))


KINDS: Mapping[str, tuple[str, Callable[[bytes], bool]]] = {
    "html": ("HTML page", _starts(b"<!doctype html", b"<html")),
    "png": ("PNG picture", lambda head: head.startswith(b"\x89PNG")),
    "svg": ("SVG picture", lambda head: b"<svg" in head or head.startswith(b"<?xml")),
    "pdf": ("PDF picture", lambda head: head.startswith(b"%PDF")),
    "jpeg": ("JPEG picture", lambda head: head.startswith(b"\xff\xd8")),
    "json": ("export as JSON", lambda head: b'"supermap-export"' in head),
    "geojson": ("GeoJSON", lambda head: b'"FeatureCollection"' in head),
    "ply": ("PLY point cloud", lambda head: head.startswith(b"ply")),
    "glb": ("GLB scene", lambda head: head.startswith(b"glTF")),
    "graphml": ("GraphML graph", lambda head: b"<graphml" in head),
    "dot": ("DOT graph", _starts(b"digraph", b"graph", b"strict")),
    "map recording": (
        "exported map recording",
        lambda head: head.startswith(b"\x89MCAP") and b"supermap export" in head,
    ),
    "rrd": ("recording for Rerun", lambda head: head.startswith((b"RRF", b"RRIO"))),
    "layout": ("layout for Foxglove", lambda head: b'"configById"' in head),
    "csv": ("CSV table", _is_text),
    "parquet": ("Parquet table", lambda head: head.startswith(b"PAR1")),
    "truth": ("ground truth", lambda head: b'"supermap truth"' in head),
    "simulated recording": ("simulated recording", lambda head: head.startswith(b"\x89MCAP") and b"supermap" in head),
    "nav2": ("goals for nav2", lambda head: b"poses:" in head and _is_text(head)),
    "map_server": ("map for nav2's map_server", lambda head: b"occupied_thresh" in head and _is_text(head)),
    "pgm": ("PGM picture", lambda head: head.startswith(b"P5")),
    "route": ("recording of a route", lambda head: head.startswith(b"\x89MCAP") and b"supermap navigate" in head),
    "scores": ("scores of a world", lambda head: b'"axis"' in head),
    "toml": ("configuration", _is_text),
}
"""The kind of an output -> what it is called, and whether a file of this head may be replaced by one of this kind."""

OutputError = ExportError
"""What is raised here; the errors of commands that write reports, plots and exports."""


def check_output(path: Path, kind: str, *, option: str, database: Path | None = None) -> None:
    """Raise `ExportError` where a file must not be written: over a map, a recording, a model, a file that is not of
    this kind (of `KINDS`), a folder, a device, or where the system refuses the name.

    Files are told by what they hold, so that hard and symbolic links do not matter. `database` is the map that is read:
    its own files are refused even where they are empty. Nothing is made.
    """
    cure = f"name another file with {option}"
    if database is not None:
        refuse_files_of(database, path, option=option)
    if len(os.fsencode(path.name)) > NAME_BYTES:
        raise OutputError(f"a name of more than {NAME_BYTES} bytes", where=_short(path), cure=cure)
    try:
        if not os.path.lexists(path):
            return
        found = path.stat() if path.exists() else None  # a link that leads nowhere has no file yet
        if found is None or (stat.S_ISREG(found.st_mode) and found.st_size == 0):
            return
        if stat.S_ISDIR(found.st_mode):
            raise OutputError("a folder, not a file", where=str(path), cure=cure)
        if not stat.S_ISREG(found.st_mode):
            raise OutputError("a device or a pipe, no regular file", where=str(path), cure=cure)
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise OutputError(f"the file cannot be written: {reason or error}", where=_short(path), cure=cure) from error
    name, is_kind = KINDS[kind]
    if not is_kind(head):
        raise OutputError(f"there is another file, no {name}: it is not written over", where=str(path), cure=cure)


def refuse_files_of(database: Path, path: Path, *, option: str) -> None:
    """Raise `ExportError` where a path leads to a file of an SQLite database: by inode, or by name if there is none."""
    try:
        resolved = database.resolve()
        for suffix in DATABASE_SUFFIXES:
            own = resolved.with_name(resolved.name + suffix)
            if path.resolve() == own or (path.exists() and own.exists() and path.samefile(own)):
                what = "this file belongs to the map and is never written over"
                raise OutputError(what, where=str(path), cure=f"name another file with {option}")
    except (OSError, ValueError):
        return  # a name that the system refuses is no file of the map; writing it says what is wrong


def replace_file(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all: under a name of its own beside it, then renamed; links are followed.

    Call `check_output` before. Its folder is made. Raises `ExportError` where that fails.
    """
    target = path
    try:
        target = path.resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(prefix=".supermap-", suffix=".partial", dir=target.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                os.fchmod(file.fileno(), 0o666 & ~_umask())
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        what = f"it cannot be written: {error.strerror or error}"
        raise OutputError(what, where=_short(path), cure="name another file, or make room") from error


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _short(path: Path) -> str:
    """A path for a message; a very long one is cut."""
    text = str(path)
    return text if len(text) <= NAME_BYTES else f"{text[:60]}...{text[-20:]}"
