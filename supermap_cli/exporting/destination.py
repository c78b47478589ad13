"""Where an export goes: under a temporary name beside it, until it is whole. What was killed leaves nothing half."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from supermap_cli.errors import ExportError


@contextmanager
def whole_file(path: Path, *, force: bool) -> Iterator[Path]:
    """A temporary file beside `path`, which takes its name at the end; nothing is left where that is not reached.

    Raises `ExportError` if there is such a file already (unless `force`), and where it cannot be written.
    """
    _check_target(path, force=force)
    if path.is_dir():
        raise ExportError("a folder, not a file", where=str(path), cure="name a file with --out")
    partial = _partial(path)
    try:
        with _refusals_as_export_errors(path):
            yield partial
            _settle(partial)
            partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path, names: Collection[str], *, force: bool) -> Iterator[Path]:
    """A temporary folder beside `path` for files of the given names, which takes its name at the end.

    With `force` an earlier export there is replaced; a folder with anything else in it never is. Raises `ExportError`
    as `whole_file` does.
    """
    _check_target(path, force=force)
    if path.exists():
        found = {each.name for each in path.iterdir()} if path.is_dir() else {path.name}
        others = sorted(found - set(names))
        if others:
            raise ExportError(
                f"holds other things than an export: {', '.join(others[:3])}",
                where=str(path),
                cure="name a folder of its own with --out",
            )
    partial = _partial(path)
    replaced = partial.with_suffix(".replaced")
    try:
        with _refusals_as_export_errors(path):
            partial.mkdir()
            yield partial
            for file in partial.iterdir():
                _settle(file)
            if path.exists():
                path.rename(replaced)
            partial.rename(path)
    finally:
        for leftover in (partial, replaced):
            shutil.rmtree(leftover, ignore_errors=True)


def _check_target(path: Path, *, force: bool) -> None:
    if path.exists() and not force:
        raise ExportError("is there already", where=str(path), cure="add --force to replace it, or change --out")
    if not path.absolute().parent.is_dir():
        raise ExportError("the folder for the export does not exist", where=str(path), cure="make it, or change --out")


def _partial(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.partial")


def _settle(file: Path) -> None:
    """Bring a file's content to the disk before it takes its name."""
    descriptor = os.open(file, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def _refusals_as_export_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ExportError(
            f"the export cannot be written: {error.strerror or error}",
            where=str(path),
            cure="free space, or choose another place with --out",
        ) from error
