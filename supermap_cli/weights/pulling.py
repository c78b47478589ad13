"""Gets the files of a model into its folder, tells later whether they are still right, and removes them."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import quote, urlsplit

from supermap_cli.errors import ModelError
from supermap_cli.input_files import check_readable
from supermap_cli.weights.catalogue import CatalogueFile, CatalogueModel
from supermap_cli.weights.download import Expected, Progress, Received, check, digest_of, download
from supermap_cli.weights.folder import models_folder

RECORD = "supermap-model.json"
"""The file in a model's folder that says where its files came from, and what they were like."""
_LOCK = ".supermap-pull.lock"

FileState = Literal["right", "not checked", "changed", "missing"]
"""`right`: as the catalogue says; `not checked`: the catalogue has no digest, it is as it was when it came."""
Watch = Callable[[CatalogueFile], Progress | None]
"""Called before a file is got; what it returns follows the transfer."""


@dataclass(frozen=True)
class PulledFile:
    """A file of a model that is there now. `checked`: its digest is the catalogue's; `fetched`: it was not there."""

    path: Path
    received: Received
    source: str
    checked: bool
    fetched: bool


@dataclass(frozen=True)
class FileCheck:
    """What became of one file of a model."""

    path: Path
    state: FileState
    what: str = ""


def pull(model: CatalogueModel, origin: str | None = None, watch: Watch | None = None) -> tuple[PulledFile, ...]:
    """Get the files of a model that are not there yet; those that are there and right stay.

    `origin`: a folder or the address of a mirror that stands in for the catalogue's addresses; the file is at
    NAME/FILE below it, or at FILE. Raises `ModelError`; files that were got before it stay.
    """
    folder = models_folder() / model.name
    with _alone(folder):
        record = _read_record(folder)
        pulled = []
        for file in model.file:
            pulled.append(_pull_file(model, file, folder, origin, record, watch))
            record = record | {file.path: {"source": pulled[-1].source, **asdict(pulled[-1].received)}}
            _write_record(folder, model, record)
    return tuple(pulled)


def verify(model: CatalogueModel) -> tuple[FileCheck, ...]:
    """Compare every file of a model with the catalogue, or with what it was like when it came."""
    folder = models_folder() / model.name
    record = _read_record(folder)
    return tuple(_checked(folder / file.path, file, record.get(file.path)) for file in model.file)


def remove(model: CatalogueModel) -> tuple[int, Path]:
    """Remove a model's files, also those that were begun. Tells how many bytes that were, and from which folder.

    Raises `ModelError` where there is none of them. Files that are not the model's stay.
    """
    folder = models_folder() / model.name
    own = [folder / file.path for file in model.file]
    begun = [path.with_name(path.name + suffix) for path in own for suffix in (".partial", ".partial.json")]
    there = [path for path in (*own, *begun) if path.is_file()]
    if not there:
        raise ModelError(f"the model {model.name} is not here", where=str(folder), cure="see `supermap models list`")
    with _alone(folder):
        freed = 0
        for path in (*there, folder / RECORD):
            try:
                freed += path.stat().st_size
                path.unlink()
            except FileNotFoundError:
                continue
            except OSError as error:
                raise _unwritable(path, error) from error
    with suppress(OSError):
        (folder / _LOCK).unlink()
        folder.rmdir()  # only where nothing else is in it
    return freed, folder


def _pull_file(  # noqa: PLR0917 - what a transfer is made of
    model: CatalogueModel,
    file: CatalogueFile,
    folder: Path,
    origin: str | None,
    record: Mapping[str, Mapping[str, object]],
    watch: Watch | None,
) -> PulledFile:
    target, expected = folder / file.path, Expected(file.size, file.sha256)
    checked = file.sha256 is not None
    if _checked(target, file, record.get(file.path)).state in {"right", "not checked"}:
        source = str(record.get(file.path, {}).get("source", "was there"))
        return PulledFile(target, digest_of(target), source, checked, fetched=False)
    progress = None if watch is None else watch(file)
    if origin is not None and not _is_address(origin):
        found = _in_folder(Path(origin).expanduser(), model, file)
        return PulledFile(target, _copy(found, target, expected, progress), str(found), checked, fetched=True)
    url = file.url if origin is None else f"{origin.rstrip('/')}/{quote(model.name)}/{quote(file.path)}"
    return PulledFile(target, download(url, target, expected, progress), url, checked, fetched=True)


def _is_address(origin: str) -> bool:
    parts = urlsplit(origin)
    if "://" in origin and parts.scheme not in {"http", "https"}:
        raise ModelError(f"no folder and no web address: {origin}", cure="name a folder, or an http or https address")
    return parts.scheme in {"http", "https"}


def _in_folder(folder: Path, model: CatalogueModel, file: CatalogueFile) -> Path:
    """Where a file of a model lies in a folder of files that somebody has copied there."""
    published = Path(urlsplit(file.url).path).name
    check_readable(folder, ModelError, what="a folder with --from DIR", folder=True)
    places = [folder / model.name / file.path, folder / file.path, folder / model.name / published, folder / published]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise ModelError(
            f"the folder has no {model.name}/{file.path}",
            where=str(folder),
            cure=f"put it there, from {file.url}",
        )
    return found


def _copy(source: Path, target: Path, expected: Expected, progress: Progress | None) -> Received:
    """Copy a file, check the copy, and give it its name."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(prefix=".supermap-", suffix=".partial", dir=target.parent)
        try:
            with source.open("rb") as reader, os.fdopen(descriptor, "wb") as writer:
                shutil.copyfileobj(reader, writer, 1 << 20)
                writer.flush()
                os.fsync(writer.fileno())
            received = digest_of(Path(name))
            check(received, expected, str(source))
            Path(name).chmod(0o644)
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise _unwritable(target, error) from error
    if progress is not None:
        progress(received.size, received.size)
    return received


def _checked(path: Path, file: CatalogueFile, came: Mapping[str, object] | None) -> FileCheck:
    """A file against the catalogue, else against the record of its coming."""
    if not path.is_file():
        return FileCheck(path, "missing")
    now = digest_of(path)
    if file.size not in {None, now.size}:
        return FileCheck(path, "changed", f"{now.size} bytes instead of {file.size}")
    if file.sha256 is not None:
        is_right = now.sha256 == file.sha256
        return FileCheck(path, "right") if is_right else FileCheck(path, "changed", f"its SHA-256 is {now.sha256}")
    if came is not None and came.get("sha256") != now.sha256:
        return FileCheck(path, "changed", "its SHA-256 is another than when it came")
    return FileCheck(path, "not checked", "the catalogue has no digest of it")


def _read_record(folder: Path) -> dict[str, Mapping[str, object]]:
    """File -> where it came from, its size and digest; empty where there is no record."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    files = record.get("files") if isinstance(record, dict) else None
    return {path: came for path, came in files.items() if isinstance(came, dict)} if isinstance(files, dict) else {}


def _write_record(folder: Path, model: CatalogueModel, files: Mapping[str, Mapping[str, object]]) -> None:
    record = {"model": model.name, "licence": model.licence, "licence_url": model.licence_url, "files": files}
    partial = folder / f"{RECORD}.partial"
    try:
        partial.write_text(json.dumps(record, indent=1), encoding="utf-8")
        partial.replace(folder / RECORD)
    except OSError as error:
        raise _unwritable(folder / RECORD, error) from error


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """No two programs change one model at a time."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise _unwritable(folder, error) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ModelError("another program is getting this model", where=str(folder), cure="wait for it") from error
        yield
    finally:
        os.close(descriptor)


def _unwritable(path: Path, error: OSError) -> ModelError:
    return ModelError(
        f"it cannot be written: {error.strerror}",
        where=str(path),
        cure="make room, or name another folder with SUPERMAP_MODELS",
    )
