"""What a file is, by its first bytes and never by its name: a container, something compressed, or no recording."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from supermap_cli.errors import RecordingError

FileKind = Literal["mcap", "ros1", "sqlite", "zstd", "gzip", "bzip2", "lz4", "xz", "other"]

COMPRESSED: frozenset[FileKind] = frozenset({"zstd", "gzip", "bzip2", "lz4", "xz"})
"""Kinds that hold another file, compressed as a whole."""

FORMATS = "a ROS 1 .bag, a ROS 2 .db3 or .mcap file (each also as .zst, .gz, .bz2, .lz4 or .xz), or a rosbag2 folder"
"""What can be read, for error messages."""

MCAP_MAGIC = b"\x89MCAP0\r\n"
"""How an MCAP file begins and ends (https://mcap.dev/spec)."""

_HEAD_BYTES = 512
"""Bytes that are enough to tell every kind: tar's magic, the last of all, stands at 257."""

_MAGIC: tuple[tuple[bytes, FileKind], ...] = (
    (MCAP_MAGIC, "mcap"),
    (b"#ROSBAG V", "ros1"),
    (b"SQLite format 3\0", "sqlite"),
    (b"\x28\xb5\x2f\xfd", "zstd"),
    (b"\x1f\x8b", "gzip"),
    (b"BZh", "bzip2"),
    (b"\x04\x22\x4d\x18", "lz4"),
    (b"\xfd7zXZ\0", "xz"),
)
"""First bytes: http://wiki.ros.org/Bags/Format/2.0, sqlite.org/fileformat2.html, RFC 8878, RFC 1952, lz4's and xz's
frame formats.
"""

_OTHERS: tuple[tuple[int, bytes, str, str], ...] = (
    (
        0,
        b"version https://git-lfs.github.com/spec",
        "a Git LFS pointer, not the recording itself",
        "fetch the file with `git lfs pull`",
    ),
    (0, b"PK\x03\x04", "a zip archive", "unpack it with `unzip` and give the recording in it"),
    (0, b"PK\x05\x06", "an empty zip archive", "download or pack it again"),
    (257, b"ustar", "a tar archive", "unpack it with `tar -xf` and give the recording in it"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it with `7z x` and give the recording in it"),
    (0, b"Rar!", "a rar archive", "unpack it and give the recording in it"),
    (0, b"\x89HDF", "an HDF5 file", f"give {FORMATS}"),
    (0, b"<!DOCTYPE", "a web page", "the download gave a page and not the file: download it again"),
    (0, b"<!doctype", "a web page", "the download gave a page and not the file: download it again"),
    (0, b"<html", "a web page", "the download gave a page and not the file: download it again"),
    (0, b"#ROSRECORD V", "a bag of a ROS older than 1.0", "convert it with `rosbag fix`"),
    (0, b"rosbag2_bagfile_information", "a metadata.yaml", "give the folder that it is in"),
)
"""(offset, bytes, what it is, cure) of files that people give in place of a recording."""


def kind_of_file(path: Path) -> FileKind:
    """The kind of a file. An MCAP file whose head is damaged is known by its end. Raises `OSError`."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        for magic, kind in _MAGIC:
            if head.startswith(magic):
                return kind
        if file.seek(0, 2) > _HEAD_BYTES:
            file.seek(-len(MCAP_MAGIC), 2)
            if file.read() == MCAP_MAGIC:
                return "mcap"
    return "other"


def no_recording(path: Path) -> RecordingError:
    """The error for a file of the kind "other": what it is instead, and what to do."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if not head:
        return RecordingError("an empty file", where=str(path), cure="record or copy it again, or name another file")
    for offset, magic, what, cure in _OTHERS:
        if head[offset : offset + len(magic)] == magic:
            return RecordingError(f"{what}", where=str(path), cure=cure)
    if not head.strip(b"\0"):
        what = "a file that begins with zeros, as one that was never written out"
        return RecordingError(what, where=str(path), cure="record or copy it again")
    return RecordingError("not a recording in a known format", where=str(path), cure=f"give {FORMATS}")
