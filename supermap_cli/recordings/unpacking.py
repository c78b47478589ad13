"""Files that are compressed as a whole (rosbag2's `--compression-mode file`, or by hand), unpacked into a folder."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import zlib
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import IO, Protocol

import lz4.frame
import zstandard

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.file_kinds import FileKind
from supermap_cli.recordings.limits import Limits, most_unpacked
from supermap_cli.recordings.notes import Notes

_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""How a zstd frame begins (RFC 8878)."""

_PIECE_BYTES = 1 << 20
"""Bytes that are unpacked at a time."""

_SMALL_BYTES, _LARGEST_RATIO = 1 << 30, 200
"""Beyond 1 GiB a recording that unpacks to more than 200 times its size is none: images compress 100 times at best."""

_SPARE_BYTES = 1 << 30
"""Bytes that unpacking leaves free on the disk."""


class _Reader(Protocol):
    """A decompressing stream, to be closed."""

    def read(self, size: int = -1, /) -> bytes:
        """The next bytes, none at the end."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


def _zstd(file: IO[bytes]) -> _Reader:
    return zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)


def _gzip(file: IO[bytes]) -> _Reader:
    return gzip.GzipFile(fileobj=file)


_OPENERS: Mapping[FileKind, Callable[[IO[bytes]], _Reader]] = {
    "zstd": _zstd,
    "gzip": _gzip,
    "bzip2": bz2.BZ2File,
    "lz4": lz4.frame.LZ4FrameFile,
    "xz": lzma.LZMAFile,
}

_FAULTS = (zstandard.ZstdError, zlib.error, lzma.LZMAError, RuntimeError, EOFError, OSError, ValueError)
"""What the decompressors raise on damaged data."""


def unpacked_message(data: bytes | memoryview, limits: Limits) -> bytes | memoryview:
    """A message as it was sent: rosbag2's `--compression-mode message` packs each with zstd, whose first bytes no CDR
    message has. Raises `ValueError` where it cannot be unpacked, or is beyond the limits.
    """
    if bytes(data[:4]) == _ZSTD_MAGIC:
        data = unpacked_zstd(data, 0, limits)
    if len(data) > limits.message_bytes:
        raise ValueError(f"{len(data)} bytes, the limit message_bytes allows {limits.message_bytes}")
    return data


def unpacked_zstd(packed: bytes | memoryview, declared_bytes: int, limits: Limits) -> bytes:
    """What a zstd frame holds; as much as there is where it is cut off. `declared_bytes` is 0 where nothing says it.

    Raises `ValueError` where it is damaged or beyond the limits.
    """
    most = most_unpacked(len(packed), limits.chunk_bytes)
    try:
        size = zstandard.get_frame_parameters(packed).content_size
        declared = declared_bytes or (0 if size == zstandard.CONTENTSIZE_UNKNOWN else size)
        if declared > most:
            raise ValueError(f"it would unpack to {declared} bytes, the limit chunk_bytes allows {most}")
        if 0 < size <= most:
            with suppress(zstandard.ZstdError):  # one that is cut off goes the other way, as far as it goes
                return zstandard.ZstdDecompressor().decompress(packed)  # without a second copy
        with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
            pieces, total = [], 0
            while piece := reader.read(_PIECE_BYTES):
                pieces.append(piece)
                total += len(piece)
                if total > most:
                    raise ValueError(f"it unpacks to more than {most} bytes, the limit chunk_bytes")
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error
    return b"".join(pieces)


def unpack(path: Path, kind: FileKind, folder: Path, limits: Limits, notes: Notes) -> Path:
    """Unpack a file into `folder`; what is damaged or cut off is unpacked as far as it goes (noted).

    Raises `RecordingError` where nothing can be unpacked, or more than the disk or the limits allow.
    """
    target = folder / f"{len(list(folder.iterdir()))}-{path.stem}"
    packed_bytes = path.stat().st_size
    most = min(limits.file_bytes, max(_SMALL_BYTES, _LARGEST_RATIO * packed_bytes))
    written, fault = 0, None
    with path.open("rb") as source, target.open("wb") as out, closing(_OPENERS[kind](source)) as unpacked:
        while True:
            try:
                piece = unpacked.read(_PIECE_BYTES)
            except _FAULTS as error:
                fault = error
                break
            if not piece:
                break
            written += len(piece)
            _check(path, kind, written, most, folder)
            out.write(piece)
    if not written:
        raise RecordingError(
            f"the {kind} file cannot be unpacked: {fault or 'it is empty'}",
            where=str(path),
            cure="record or copy it again",
        )
    if fault is not None:
        notes.note(
            f"unpacked {path}",
            f"{path}: the {kind} file is damaged or cut off ({fault}); what comes before, {written} bytes, is read",
        )
    return target


def _check(path: Path, kind: FileKind, written: int, most: int, folder: Path) -> None:
    if written > most:
        raise RecordingError(
            f"the {kind} file unpacks to more than {most / 2**30:.0f} GiB, as no recording of its size does",
            where=str(path),
            cure="unpack it yourself if it is right, and give the unpacked file",
        )
    if shutil.disk_usage(folder).free < _SPARE_BYTES:
        raise RecordingError(
            f"no room to unpack it in {folder.parent}",
            where=str(path),
            cure="free space there or set TMPDIR to another folder, or unpack it yourself and give the unpacked file",
        )
