"""ROS 1 bags (http://wiki.ros.org/Bags/Format/2.0), read by a walk over their records.

An index at the end of the file is not needed: a bag that was never closed (`.bag.active`, unindexed, cut off) is read
up to where it ends, one with a damaged chunk without that chunk.
"""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.limits import Limits, most_unpacked
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, LeftOut, RawMessage, full_type_name, merge_lazily

_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
"""The `op` of a record."""

_LARGEST_HEADER = 1 << 20
"""Bytes of a record's header: a connection's names, some hundred; a longer one is no header."""

_UINT32 = struct.Struct("<I")

_UINT64 = struct.Struct("<Q")

_TIME = struct.Struct("<II")

_INDEX_ENTRY = struct.Struct("<III")
"""Of one message: seconds, nanoseconds, offset in the unpacked chunk."""


@dataclass(frozen=True)
class _BagChunk:
    """A chunk: where its data are in the file, and what is in it. `counts` are by connection."""

    offset: int
    size: int
    compression: str
    unpacked_bytes: int
    start_ns: int
    end_ns: int
    counts: Counter[int]


class Ros1Storage:
    """One ROS 1 bag. Each stream opens the file anew and holds one chunk at a time (more where chunks overlap)."""

    def __init__(self, path: Path, notes: Notes, limits: Limits) -> None:
        self._path = path
        self._limits = limits
        self._left_out = LeftOut(notes, str(path))
        with path.open("rb") as file:
            scan = _BagScan(file, path, limits, self._left_out)
        self._blocks = scan.blocks
        self._by_id = scan.channels()
        self.channels = tuple(sorted(dict.fromkeys(self._by_id.values()), key=lambda each: (each.topic, each.msgtype)))
        if not self._blocks:
            cut = "the bag is cut off before its first message"
            what = f"no messages in the bag{self._left_out.reason}" if scan.closed or self._left_out.reason else cut
            raise RecordingError(what, where=str(path), cure="record or copy it again")
        self.start_ns = min(block.start_ns for block in self._blocks)
        self.end_ns = max(block.end_ns for block in self._blocks)
        if not scan.closed:
            total = sum(channel.count for channel in self.channels)
            notes.note("cut", f"{path}: the bag was not closed, or is cut off; all {total} messages in it are read")

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        first = self.start_ns if start_ns is None else start_ns
        beyond = self.end_ns + 1 if end_ns is None else end_ns
        wanted = {number: channel for number, channel in self._by_id.items() if channel.topic in topics}
        with self._path.open("rb") as file:

            def reader(block: _BagChunk) -> Callable[[], Iterable[RawMessage]]:
                return lambda: self._read_block(file, block, wanted, first, beyond)

            yield from merge_lazily(
                (block.start_ns, reader(block))
                for block in self._blocks
                if block.end_ns >= first and block.start_ns < beyond and not wanted.keys().isdisjoint(block.counts)
            )

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        for message in self.messages(topics, start_ns, end_ns):
            yield message.channel.topic, message.log_ns

    def _read_block(
        self, file: BinaryIO, block: _BagChunk, wanted: dict[int, Channel], first: int, beyond: int
    ) -> list[RawMessage]:
        try:
            records = memoryview(_content(file, block, self._limits))
        except _FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return []
        found = []
        for op, fields, start, end in _walk(records):
            if op != _MESSAGE:
                continue
            number, log_ns = _message_head(fields)
            if number in wanted and first <= log_ns < beyond:
                found.append(RawMessage(wanted[number], log_ns, bytes(records[start:end])))  # keeps no block alive
        found.sort(key=lambda message: message.log_ns)
        return found


_FAULTS = (RuntimeError, OSError, EOFError, ValueError)
"""What unpacking a damaged chunk raises."""


def _content(file: BinaryIO, block: _BagChunk, limits: Limits) -> bytes:
    """The records of a chunk, unpacked; as many as there are where it is cut off. Raises what `_FAULTS` names."""
    file.seek(block.offset)
    packed = file.read(block.size)
    most = most_unpacked(len(packed), limits.chunk_bytes)
    if block.compression == "none":
        return packed
    if block.unpacked_bytes > most:
        raise ValueError(f"it would unpack to {block.unpacked_bytes} bytes, the limit chunk_bytes allows {most}")
    if block.compression == "bz2":
        return bz2.BZ2Decompressor().decompress(packed, max_length=most)
    if block.compression == "lz4":
        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most)
        return unpacked
    raise ValueError(f"unknown compression {block.compression!r}")


def _fields(header: bytes | memoryview) -> dict[str, bytes]:
    """The fields of a record's header. Raises `ValueError` where it is damaged."""
    fields, position, data = {}, 0, bytes(header)
    while position < len(data):
        if position + 4 > len(data):
            raise ValueError("a damaged header")
        (size,) = _UINT32.unpack_from(data, position)
        name, equals, value = data[position + 4 : position + 4 + size].partition(b"=")
        if not equals or position + 4 + size > len(data):
            raise ValueError("a damaged header")
        fields[name.decode("ascii", "replace")] = value
        position += 4 + size
    return fields


def _message_head(fields: dict[str, bytes]) -> tuple[int, int]:
    """(connection, log time in ns) of a message record; (-1, 0) where they are missing."""
    number, time = fields.get("conn", b""), fields.get("time", b"")
    if len(number) != _UINT32.size or len(time) != _TIME.size:
        return -1, 0
    seconds, nanoseconds = _TIME.unpack(time)
    return _UINT32.unpack(number)[0], seconds * 1_000_000_000 + nanoseconds


def _walk(records: memoryview) -> Iterator[tuple[int, dict[str, bytes], int, int]]:
    """(op, header's fields, start and end of the data) of every whole record, up to the first damaged one."""
    position, size = 0, len(records)
    while position + 8 <= size:
        (header_bytes,) = _UINT32.unpack_from(records, position)
        start = position + 4 + header_bytes + 4
        if start > size:
            return
        try:
            fields = _fields(records[position + 4 : start - 4])
        except ValueError:
            return
        (data_bytes,) = _UINT32.unpack_from(records, start - 4)
        position = start + data_bytes
        if position > size:
            return
        yield (fields.get("op") or b"\0")[0], fields, start, position


class _BagScan:
    """All chunks and connections of a bag. `closed` says that the bag's recorder wrote it to its end."""

    def __init__(self, file: BinaryIO, path: Path, limits: Limits, left_out: LeftOut) -> None:
        self.blocks: list[_BagChunk] = []
        self.closed = False
        self._connections: dict[int, tuple[str, str, str]] = {}
        self._file = file
        self._path = path
        self._size = path.stat().st_size
        self._limits = limits
        self._left_out = left_out
        self._chunk: _BagChunk | None = None
        self._index: Counter[int] = Counter()
        self._times: list[int] = []
        self._walk_file()

    def channels(self) -> dict[int, Channel]:
        """A channel for each connection id; several publishers of one topic share one channel."""
        counts: Counter[int] = Counter()
        for block in self.blocks:
            counts.update(block.counts)
        totals: Counter[tuple[str, str]] = Counter()
        texts: dict[tuple[str, str], str] = {}
        for number, (topic, msgtype, text) in self._connections.items():
            totals[topic, msgtype] += counts[number]
            texts.setdefault((topic, msgtype), text)
        return {
            number: Channel(
                topic,
                msgtype,
                "ros1",
                texts[topic, msgtype].encode(),
                "ros1msg",
                totals[topic, msgtype],
            )
            for number, (topic, msgtype, _) in self._connections.items()
        }

    def _walk_file(self) -> None:
        """Visit every record of the file, up to its end or to the first damaged one."""
        version = self._file.readline(64)
        if not version.startswith(b"#ROSBAG V2.0"):
            raise RecordingError(
                f"a bag of the version {version[8:20].decode('ascii', 'replace').strip()!r}, not V2.0",
                where=str(self._path),
                cure="convert it with `rosbag fix`, or record it again",
            )
        position = self._file.tell()
        while (head := self._record_head(position)) is not None:
            fields, start, size = head
            op = (fields.get("op") or b"\0")[0]
            self._visit(op, fields, start, min(size, self._size - start))
            position = start + size
            if position > self._size:
                self._index.clear()
                break
        self._close_chunk()

    def _record_head(self, position: int) -> tuple[dict[str, bytes], int, int] | None:
        """(fields, start of the data, bytes of data) of a record; `None` where there is no whole head."""
        self._file.seek(position)
        sizes = self._file.read(4)
        if len(sizes) < 4 or (header_bytes := _UINT32.unpack(sizes)[0]) > _LARGEST_HEADER or not header_bytes:
            return None
        header = self._file.read(header_bytes + 4)
        if len(header) < header_bytes + 4:
            return None
        try:
            fields = _fields(header[:-4])
        except ValueError:
            return None
        return fields, position + 8 + header_bytes, _UINT32.unpack(header[-4:])[0]

    def _visit(self, op: int, fields: dict[str, bytes], start: int, size: int) -> None:
        if op == _BAG_HEADER:
            index = fields.get("index_pos", b"")
            self.closed = len(index) == _UINT64.size and 0 < _UINT64.unpack(index)[0] <= self._size
        elif op == _CHUNK:
            self._close_chunk()
            unpacked = fields.get("size", b"\0\0\0\0")[:4].ljust(4, b"\0")
            compression = fields.get("compression", b"none").decode("ascii", "replace")
            self._chunk = _BagChunk(start, size, compression, _UINT32.unpack(unpacked)[0], 0, 0, Counter())
        elif op == _INDEX:
            number = fields.get("conn", b"")[:4].ljust(4, b"\0")
            self._file.seek(start)
            entries = self._file.read(size)
            times = [
                seconds * 1_000_000_000 + nanoseconds
                for seconds, nanoseconds, _ in _INDEX_ENTRY.iter_unpack(entries[: len(entries) // 12 * 12])
            ]
            self._index[_UINT32.unpack(number)[0]] += len(times)
            self._times += [min(times), max(times)] if times else []
        elif op == _CONNECTION:
            self._file.seek(start)
            self._learn(fields, self._file.read(size))
        elif op == _CHUNK_INFO:
            self._close_chunk()

    def _close_chunk(self) -> None:
        """Take the last chunk in; without an index behind it, or with unknown connections, it has to be read."""
        block, counts, times = self._chunk, self._index, self._times
        self._chunk, self._index, self._times = None, Counter(), []
        if block is None:
            return
        if not counts or not counts.keys() <= self._connections.keys():
            counts, times = self._read_chunk(block)
        if counts:
            self.blocks.append(
                _BagChunk(
                    block.offset,
                    block.size,
                    block.compression,
                    block.unpacked_bytes,
                    min(times),
                    max(times),
                    counts,
                )
            )

    def _read_chunk(self, block: _BagChunk) -> tuple[Counter[int], list[int]]:
        counts: Counter[int] = Counter()
        times: list[int] = []
        try:
            records = memoryview(_content(self._file, block, self._limits))
        except _FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return counts, times
        for op, fields, start, end in _walk(records):
            if op == _CONNECTION:
                self._learn(fields, bytes(records[start:end]))
            elif op == _MESSAGE:
                number, log_ns = _message_head(fields)
                counts[number] += 1
                times.append(log_ns)
        known = {number: count for number, count in counts.items() if number in self._connections}
        return Counter(known), times

    def _learn(self, fields: dict[str, bytes], data: bytes) -> None:
        """A connection: its number and topic are in the record's header, its type in another header, the data."""
        number = fields.get("conn", b"")
        try:
            inner = _fields(data)
        except ValueError:
            return
        if len(number) != _UINT32.size or len(self._connections) >= self._limits.topics:
            return
        topic = fields.get("topic", b"").decode(errors="replace")
        normal = ("/" if topic.startswith("/") else "") + "/".join(part for part in topic.split("/") if part)
        msgtype = full_type_name(inner.get("type", b"").decode(errors="replace"))
        text = inner.get("message_definition", b"").decode(errors="replace")
        self._connections.setdefault(_UINT32.unpack(number)[0], (normal, msgtype, text))
