"""Where an export goes: under a temporary name beside it, until it is whole. What was killed leaves nothing half."""

from __future__ import annotations

import os
import re
import shutil
import signal
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

from supermap_cli.errors import ExportError

_PARTIAL, _REPLACED = "partial", "replaced"


@contextmanager
def atomic_file(path: Path, *, force: bool) -> Iterator[Path]:
    """A temporary file beside `path`, which takes its name at the end; nothing is left where that is not reached.

    Raises `ExportError` if there is such a file already (unless `force`), and where it cannot be written.
    """
    with _sigterm_as_interrupt():
        _check_target(path, force=force)
        if path.is_dir():
            raise ExportError("a folder, not a file", where=str(path), cure="name a file with --out")
        partial = _temporary_path(path, _PARTIAL)
        try:
            with _os_errors_as_export_errors(path):
                yield partial
                _sync_to_disk(partial)
                partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path, names: Collection[str], *, force: bool) -> Iterator[Path]:
    """A temporary folder beside `path` for files of the given names, which takes its name at the end.

    With `force` an earlier export there is replaced; a folder with anything else in it never is. Raises `ExportError`
    as `whole_file` does.
    """
    with _sigterm_as_interrupt():
        _check_target(path, force=force)
        if path.exists():
            found = {entry.name for entry in path.iterdir()} if path.is_dir() else {path.name}
            others = sorted(found - set(names))
            if others:
                raise ExportError(
                    f"holds other things than an export: {', '.join(others[:3])}",
                    where=str(path),
                    cure="name a folder of its own with --out",
                )
        partial, replaced = _temporary_path(path, _PARTIAL), _temporary_path(path, _REPLACED)
        try:
            with _os_errors_as_export_errors(path):
                partial.mkdir()
                yield partial
                for file in partial.iterdir():
                    _sync_to_disk(file)
                _swap_folder(partial, replaced, path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def _swap_folder(partial: Path, replaced: Path, path: Path) -> None:
    """Give a whole folder its name. What was there goes only then, and comes back where that fails.

    No system renames a folder over one that is not empty, so for a moment neither has the name. A process killed in it
    leaves both folders, and the next export there puts the old one back first.
    """
    if not path.exists():
        partial.rename(path)
        return
    try:
        path.rename(replaced)
        partial.rename(path)
    except BaseException:
        if replaced.exists() and not path.exists():
            replaced.rename(path)
        raise
    replaced.rename(partial)  # from now on it is litter, whatever happens


def _check_target(path: Path, *, force: bool) -> None:
    if not path.absolute().parent.is_dir():
        raise ExportError("the folder for the export does not exist", where=str(path), cure="make it, or change --out")
    with _os_errors_as_export_errors(path):
        _clear_leftovers(path)
    if path.exists() and not force:
        raise ExportError("is there already", where=str(path), cure="add --force to replace it, or change --out")


def _temporary_path(path: Path, what: str) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{what}")


def _clear_leftovers(path: Path) -> None:
    """Take away what exports to `path` left that were killed; what they had moved aside takes its place again."""
    named = re.compile(rf"\.{re.escape(path.name)}\.(\d+)\.({_PARTIAL}|{_REPLACED})")
    for entry in path.absolute().parent.iterdir():
        found = named.fullmatch(entry.name)
        if found is None or _process_runs(int(found[1])):
            continue
        if found[2] == _REPLACED and not path.exists():
            entry.rename(path)
        elif entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        else:
            entry.unlink(missing_ok=True)


def _process_runs(pid: int) -> bool:
    """Whether another process of this number runs on this machine, whosever it is."""
    if pid == os.getpid():
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass
    return True


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """While it is entered, SIGTERM stops as Ctrl-C does: what is half is taken away on the way out.

    Outside the main thread, which alone gets signals, it changes nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handler = signal.signal(signal.SIGTERM, _raise_interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _raise_interrupt(number: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001 - what a signal's receiver is given
    raise KeyboardInterrupt


def _sync_to_disk(file: Path) -> None:
    """Bring a file's content to the disk before it takes its name."""
    descriptor = os.open(file, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _os_errors_as_export_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ExportError(
            f"the export cannot be written: {error.strerror or error}",
            where=str(path),
            cure="free space, or choose another place with --out",
        ) from error
