"""What tells one recording from another, wherever its files lie, and one stretch of a recording from another."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from supermap_cli.recordings.containers import open_storage, storage_files
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel

_END_BYTES = 1 << 18
"""Bytes at either end of a file that go into its fingerprint: enough for the header, the index and some messages."""


def recording_fingerprint(path: Path) -> str:
    """The fingerprint of a whole recording. Raises `RecordingError` where it cannot be read."""
    return content_fingerprint(path, open_storage(path, Notes()).channels)


def content_fingerprint(path: Path, channels: Sequence[Channel]) -> str:
    """Hex digest of the files' sizes, their first and last 256 KiB, and what is in them; not of their names."""
    digest = hashlib.sha256()
    for file_path in storage_files(path):
        size = file_path.stat().st_size
        with file_path.open("rb") as file:
            digest.update(f"{size}\n".encode() + file.read(_END_BYTES))
            file.seek(max(0, size - _END_BYTES))
            digest.update(file.read(_END_BYTES))
    for channel in channels:
        digest.update(f"{channel.topic} {channel.msgtype} {channel.count}\n".encode())
    return digest.hexdigest()


def window_fingerprint(content: str, start_ns: int, end_ns: int) -> str:
    """Hex digest of a stretch of sensor time of the recording that has a fingerprint."""
    return hashlib.sha256(f"{content} {start_ns} {end_ns}".encode()).hexdigest()
