"""Opening a recording of any container, told by its first bytes: one file, or the files of a folder as one."""

from __future__ import annotations

import re
import weakref
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path, PurePath

from supermap_cli.errors import RecordingError
from supermap_cli.input_files import check_readable
from supermap_cli.recordings.file_kinds import COMPRESSED, FORMATS, FileKind, kind_of_file, no_recording
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, RawMessage, SplitStorage, Storage
from supermap_cli.recordings.zero_times import from_first_real_time
from supermap_cli.temporary_folders import OwnedFolder, make_temporary_folder, remove_left_behind

Unpack = Callable[[Path, FileKind, Path, Limits, Notes], Path]
"""`supermap_cli.recordings.unpacking.unpack`."""

_NAMES = re.compile(r".+\.(mcap|db3|bag|bag\.active)(\.(zstd|zst|gz|bz2|lz4|xz))?", re.IGNORECASE)
"""Names of a recording's files in a folder without metadata.yaml; a file that is named alone may have any."""

_LARGEST_METADATA = 16 << 20
"""Bytes of a metadata.yaml that are read: ten thousand topics take 5 MB."""


def storage_files(path: Path) -> list[Path]:
    """The files a recording is made of, in order."""
    if path.is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.is_file())


def open_storage(path: Path, notes: Notes, limits: Limits | None = None) -> Storage:
    """Open a recording of any known format, recognised by its first bytes. Raises `RecordingError`."""
    limits = limits or Limits()
    check_readable(path, RecordingError, what="a recording", folder=True)
    remove_left_behind()
    if not path.exists():
        raise RecordingError("no such recording", where=str(path), cure="check the path")
    try:
        if path.is_dir():
            storage = _open_folder(path, notes, limits)
        elif path.is_file():
            storage = _open_file(path, notes, limits)
        else:
            raise RecordingError("neither a file nor a folder", where=str(path), cure=f"give {FORMATS}")
    except PermissionError as error:
        raise RecordingError("no permission to read", where=str(path), cure="check the file's mode") from error
    except OSError as error:
        raise RecordingError(
            f"it cannot be read: {error.strerror or error}", where=str(path), cure="check the disk, or copy it again"
        ) from error
    if len(storage.channels) > limits.topics:
        raise RecordingError(
            f"{len(storage.channels)} topics, the limit is {limits.topics}",
            where=str(path),
            cure=f"raise it with --limit topics={len(storage.channels)} if they are right",
        )
    return from_first_real_time(storage, str(path), notes)


class _UnpackedStorage:
    """A storage of a file that was unpacked into a folder, which goes when the storage does."""

    def __init__(self, storage: Storage, folder: OwnedFolder) -> None:
        self._storage = storage
        weakref.finalize(self, folder.remove)
        self.channels: Sequence[Channel] = storage.channels
        self.start_ns = storage.start_ns
        self.end_ns = storage.end_ns

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        yield from self._storage.messages(topics, start_ns, end_ns)

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        yield from self._storage.log_times(topics, start_ns, end_ns)


def _open_file(path: Path, notes: Notes, limits: Limits) -> Storage:
    kind = kind_of_file(path)
    if kind == "mcap":
        from supermap_cli.recordings.mcap_storage import McapStorage  # noqa: PLC0415 - decompressors load lazily

        return McapStorage(path, notes, limits)
    if kind == "ros1":
        from supermap_cli.recordings.ros1_storage import Ros1Storage  # noqa: PLC0415 - decompressors load lazily

        return Ros1Storage(path, notes, limits)
    if kind == "sqlite":
        from supermap_cli.recordings.sqlite_storage import SqliteStorage  # noqa: PLC0415 - apsw loads lazily

        return SqliteStorage(path, notes, limits)
    if kind in COMPRESSED:
        from supermap_cli.recordings.unpacking import unpack  # noqa: PLC0415 - decompressors load lazily

        return _open_packed(path, kind, unpack, notes, limits)
    raise no_recording(path)


def _open_packed(path: Path, kind: FileKind, unpack: Unpack, notes: Notes, limits: Limits) -> Storage:
    folder = make_temporary_folder()
    try:
        inner = unpack(path, kind, folder.path, limits, notes)
        return _UnpackedStorage(_open_unpacked(inner, path, kind, notes, limits), folder)
    except BaseException:
        folder.remove()
        raise


def _open_unpacked(inner: Path, path: Path, kind: FileKind, notes: Notes, limits: Limits) -> Storage:
    if kind_of_file(inner) in COMPRESSED:
        raise RecordingError("compressed twice", where=str(path), cure="unpack it and give the unpacked file")
    try:
        return _open_file(inner, _Renamed(notes, inner, path), limits)
    except RecordingError as error:
        raise RecordingError(f"in the {kind} file: {error.what}", where=str(path), cure=error.cure) from error


class _Renamed(Notes):
    """Notes on an unpacked file, which the user knows by the name of the packed one."""

    def __init__(self, notes: Notes, unpacked: Path, path: Path) -> None:
        super().__init__()
        self._notes = notes
        self._unpacked = str(unpacked)
        self._path = str(path)

    def note(self, key: str, line: str) -> None:
        """Keep one line under `key`."""
        self._notes.note(key, line.replace(self._unpacked, self._path))


def _open_folder(path: Path, notes: Notes, limits: Limits) -> Storage:
    """The parts of a recording; those that cannot be read are left out with a note, as long as one can."""
    files = _parts(path, notes)
    if not files:
        raise RecordingError("a folder without a recording", where=str(path), cure=f"give {FORMATS}")
    parts: list[Storage] = []
    failures: list[RecordingError] = []
    for file in files:
        try:
            parts.append(_attempt(partial(_open_file, file, notes, limits), file))
        except RecordingError as error:
            failures.append(error)
    if not parts:
        raise failures[0]
    for failure in failures:
        notes.note(
            f"part {failure.where}",
            f"{failure.where}: {failure.what}; this part of {len(files)} is left out",
        )
    return parts[0] if len(parts) == 1 else SplitStorage(parts)


def _attempt(opening: Callable[[], Storage], file: Path) -> Storage:
    try:
        return opening()
    except OSError as error:
        raise RecordingError(
            f"it cannot be read: {error.strerror or error}", where=str(file), cure="check the disk, or copy it again"
        ) from error


def _parts(path: Path, notes: Notes) -> list[Path]:
    """The files of a recording in a folder: those that metadata.yaml names, packed or not; else all by their names, and
    where none is named like a recording, all that are one by their first bytes.
    """
    present = [file for file in storage_files(path) if file.name != "metadata.yaml"]
    named = _named_by_metadata(path)
    listed = [file for name in named if (file := _packed_or_not(path, name)) is not None]
    if listed:
        if missing := [name for name in named if _packed_or_not(path, name) is None]:
            notes.note(
                "missing parts",
                f"{path}: {len(missing)} of {len(named)} files that metadata.yaml names are missing ({missing[0]}), "
                "the others are read",
            )
        return listed
    files = _without_packed_twins([file for file in present if _NAMES.fullmatch(file.name)])
    files = files or [file for file in present if kind_of_file(file) in {"mcap", "ros1", "sqlite"}]
    if files:
        why = "none of the files that metadata.yaml names is there" if named else "no metadata.yaml"
        what = f"{files[0].name} is" if len(files) == 1 else f"its {len(files)} files are"
        notes.note("metadata", f"{path}: {why}, {what} read as one recording")
    return sorted(files, key=_natural_order)


def _named_by_metadata(path: Path) -> list[str]:
    """The file names that metadata.yaml lists, in order; none where there is no such file, or no list in it."""
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        return []
    with metadata.open("rb") as file:
        text = file.read(_LARGEST_METADATA).decode(errors="replace")
    listing = re.search(r"^\s*relative_file_paths:\s*\n((?:\s*-\s.*\n?)+)", text, re.MULTILINE)
    if listing is None:
        flow = re.search(r"relative_file_paths:\s*\[([^\]]*)\]", text)
        names = flow.group(1).split(",") if flow else []
    else:
        names = [line.strip().removeprefix("-") for line in listing.group(1).splitlines()]
    cleaned = [PurePath(name.strip().strip("\"'")).name for name in names]
    return list(dict.fromkeys(name for name in cleaned if name))


def _packed_or_not(folder: Path, name: str) -> Path | None:
    """A file by the name in metadata.yaml, or as it was before or is after it was compressed."""
    stem = re.sub(r"\.(zstd|zst)$", "", name)
    for candidate in (name, stem, f"{stem}.zstd", f"{stem}.zst"):
        if candidate and (folder / candidate).is_file():
            return folder / candidate
    return None


def _without_packed_twins(files: Sequence[Path]) -> list[Path]:
    """The files without those that stand there unpacked as well."""
    names = {file.name for file in files}
    return [file for file in files if not (file.stem in names and _NAMES.fullmatch(file.stem))]


def _natural_order(file: Path) -> list[tuple[int, str]]:
    """run_2 before run_10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]
