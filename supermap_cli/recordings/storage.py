"""Recordings as stores of raw messages: one interface for every container format."""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.notes import Notes

FORMATS = "a ROS 1 .bag, a ROS 2 .db3 or .mcap file, or a rosbag2 folder"


@dataclass(frozen=True)
class Channel:
    """One topic of one message type.

    `msgtype` is "package/msg/Name" for ROS and "foxglove.Name" for Foxglove schemas; `serialization` is "cdr", "ros1",
    "json" or "protobuf"; `definition` is the schema as it was stored, its format "ros1msg", "ros2msg", "ros2idl",
    "jsonschema", "protobuf" or "" where there is none.
    """

    topic: str
    msgtype: str
    serialization: str
    definition: bytes
    definition_format: str
    count: int


@dataclass(frozen=True)
class RawMessage:
    """One message as stored; `log_ns` is when it was recorded."""

    channel: Channel
    log_ns: int
    data: bytes | memoryview


class Storage(Protocol):
    """An opened container."""

    @property
    def channels(self) -> Sequence[Channel]:
        """What is in it, ordered by topic."""
        ...

    @property
    def start_ns(self) -> int:
        """Log time of the first message."""
        ...

    @property
    def end_ns(self) -> int:
        """Log time of the last message."""
        ...

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Messages of the topics with start_ns <= log time < end_ns, in the order of log time.

        Every call reads anew and independently of all others, a chunk at a time.
        """
        ...

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """(topic, log time) of the same messages, a topic's in order; by the index alone where there is one."""
        ...


def merge_lazily(
    parts: Iterable[tuple[int, Callable[[], Iterable[RawMessage]]]],
) -> Iterator[RawMessage]:
    """Merge ordered parts by log time, opening each only when its start time is reached (parts may overlap)."""
    waiting = sorted(((start, index, part) for index, (start, part) in enumerate(parts)), reverse=True)
    heads: list[tuple[int, int, RawMessage, Iterator[RawMessage]]] = []
    while waiting or heads:
        while waiting and (not heads or waiting[-1][0] <= heads[0][0]):
            _, index, part = waiting.pop()
            stream = iter(part())
            if (first := next(stream, None)) is not None:
                heapq.heappush(heads, (first.log_ns, index, first, stream))
        if not heads:
            continue
        _, index, message, stream = heads[0]
        yield message
        if (following := next(stream, None)) is None:
            heapq.heappop(heads)
        else:
            heapq.heapreplace(heads, (following.log_ns, index, following, stream))


class SplitStorage:
    """A recording split over several files, read as one."""

    def __init__(self, parts: Sequence[Storage]) -> None:
        self._parts = [part for part in parts if part.channels] or list(parts[:1])
        merged: dict[tuple[str, str], Channel] = {}
        for channel in (channel for part in self._parts for channel in part.channels):
            key = (channel.topic, channel.msgtype)
            known = merged.get(key)
            merged[key] = channel if known is None else replace(known, count=known.count + channel.count)
        self.channels = tuple(merged[key] for key in sorted(merged))
        self.start_ns = min(part.start_ns for part in self._parts)
        self.end_ns = max(part.end_ns for part in self._parts)

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""

        def reader(part: Storage) -> Callable[[], Iterator[RawMessage]]:
            return lambda: part.messages(topics, start_ns, end_ns)

        return merge_lazily((part.start_ns, reader(part)) for part in self._within(start_ns, end_ns))

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        for part in sorted(self._within(start_ns, end_ns), key=lambda part: part.start_ns):
            yield from part.log_times(topics, start_ns, end_ns)

    def _within(self, start_ns: int | None, end_ns: int | None) -> list[Storage]:
        return [
            part
            for part in self._parts
            if (start_ns is None or part.end_ns >= start_ns) and (end_ns is None or part.start_ns < end_ns)
        ]


def storage_files(path: Path) -> list[Path]:
    """The files a recording is made of, in order."""
    if path.is_file():
        return [path]
    return sorted(each for each in path.iterdir() if each.is_file())


def open_storage(path: Path, notes: Notes) -> Storage:
    """Open a recording of any known format, recognised by its first bytes. Raises `RecordingError`."""
    if not path.exists():
        raise RecordingError("no such recording", where=str(path), cure="check the path")
    try:
        return _open_folder(path, notes) if path.is_dir() else _open_file(path, notes)
    except PermissionError as error:
        raise RecordingError("no permission to read", where=str(path), cure="check the file's mode") from error


def _open_file(path: Path, notes: Notes) -> Storage:
    from supermap_cli.recordings.mcap_storage import MAGIC, McapStorage  # noqa: PLC0415 - decompressors load lazily
    from supermap_cli.recordings.ros_storage import Ros1Storage, Ros2Storage  # noqa: PLC0415 - rosbags loads lazily

    with path.open("rb") as file:
        head = file.read(16)
    if not head:
        raise RecordingError("an empty file", where=str(path), cure="record again, or name another file")
    if head.startswith(MAGIC):
        return McapStorage(path, notes)
    if head.startswith(b"#ROSBAG V"):
        return Ros1Storage(path)
    if head.startswith(b"SQLite format 3\0"):
        return Ros2Storage(path)
    raise RecordingError("not a recording in a known format", where=str(path), cure=f"give {FORMATS}")


def _open_folder(path: Path, notes: Notes) -> Storage:
    from supermap_cli.recordings.ros_storage import Ros2Storage  # noqa: PLC0415 - rosbags loads lazily

    files = sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        described = metadata.read_text(encoding="utf-8", errors="replace")
        if re.search(r"compression_mode:\s*[\"']?(file|message)", described, re.IGNORECASE):
            return Ros2Storage(path)
        files = [each for each in files if each.name in described]
    elif files:
        notes.note("metadata", f"{path}: no metadata.yaml, its {len(files)} files are read as one recording")
    if not files:
        raise RecordingError("a folder without a recording", where=str(path), cure=f"give {FORMATS}")
    return SplitStorage([_open_file(each, notes) for each in files])
