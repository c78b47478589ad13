"""Atomic writing of exports: under a temporary name beside the target until complete."""

from __future__ import annotations

import os
import re
import shutil
import signal
import stat
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

from supermap_cli.errors import ExportError
from supermap_cli.output_files import check_output

_PARTIAL, _REPLACED = "partial", "replaced"


@contextmanager
def atomic_file(path: Path, kind: str, *, force: bool) -> Iterator[Path]:
    """A temporary file beside `path` that is renamed to it at the end, or removed on any failure.

    Raises `ExportError` if the file exists already (unless `force`, and it is of the `kind` of `output_files.KINDS`),
    and if it cannot be written.
    """
    with _sigterm_as_interrupt():
        _refuse_device(path)
        path = _resolved(path)
        _check_target(path, force=force)
        check_output(path, kind, option="--out")
        partial = _temporary_path(path, _PARTIAL)
        try:
            with _os_errors_as_export_errors(path):
                yield partial
                _sync_to_disk(partial)
                partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path, names: Collection[str], kind: str, *, force: bool) -> Iterator[Path]:
    """A temporary folder beside `path` for files of the given names, renamed to it at the end.

    With `force` an earlier export is replaced; a folder that holds any other file, or one that is not of the `kind`,
    never is. Raises `ExportError` like `atomic_file`.
    """
    with _sigterm_as_interrupt():
        _refuse_device(path)
        path = _resolved(path)
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
            for name in sorted(found):
                check_output(path / name, kind, option="--out")
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
    """Rename the complete folder to its target, moving an existing one aside, and back on failure.

    No system renames a folder over one that is not empty, so for a moment the target does not exist. If the process is
    killed then, both folders remain, and the next export restores the old one first.
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
    replaced.rename(partial)  # removed by the caller


def _resolved(path: Path) -> Path:
    """The path with links resolved: what a link leads to is replaced, not the link."""
    with _os_errors_as_export_errors(path):
        return path.resolve()


def _refuse_device(path: Path) -> None:
    """Before links are resolved: what `/dev/stdout` leads to has no name of its own where it is a pipe."""
    with _os_errors_as_export_errors(path):
        mode = path.stat().st_mode if path.exists() else stat.S_IFREG
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise ExportError(
            "a device or a pipe, no regular file",
            where=str(path),
            cure="name a file with --out; --out - prints json and geojson",
        )


def _check_target(path: Path, *, force: bool) -> None:
    with _os_errors_as_export_errors(path):
        has_folder = path.parent.is_dir()
    if not has_folder:
        raise ExportError("the folder for the export does not exist", where=str(path), cure="make it, or change --out")
    with _os_errors_as_export_errors(path):
        _clear_leftovers(path)
        there = path.exists()
    if there and not force:
        raise ExportError("is there already", where=str(path), cure="add --force to replace it, or change --out")


def _temporary_path(path: Path, what: str) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{what}")


def _clear_leftovers(path: Path) -> None:
    """Remove what killed exports to `path` left behind, and restore a folder that one of them moved aside."""
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


@contextmanager
def _sigterm_as_interrupt() -> Iterator[None]:
    """While entered, SIGTERM raises KeyboardInterrupt, so that partial output is removed.

    It has no effect outside the main thread, which alone receives signals.
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
    """Flush a file to disk before it is renamed."""
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
