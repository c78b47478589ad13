"""MCAP files (https://mcap.dev/spec), by their index where there is one and by a scan where there is none.

A file that was cut off (no footer, the last chunk incomplete) is read up to the cut; a chunk whose content does not fit
its checksum is left out.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from mcap.summary import Summary

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.file_kinds import MCAP_MAGIC
from supermap_cli.recordings.limits import Limits, most_unpacked
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, LeftOut, RawMessage, full_type_name, merge_lazily
from supermap_cli.recordings.unpacking import unpacked_message, unpacked_zstd

_RECORD = struct.Struct("<BQ")
"""Every record's head: opcode, length of its content."""

_MESSAGE = struct.Struct("<HIQQ")
"""A message's head: channel id, sequence, log time, publish time."""

_CHUNK = struct.Struct("<QQQII")
"""A chunk's head: start and end time, uncompressed size, uncompressed CRC, length of the compression's name."""

_UINT32 = struct.Struct("<I")

_FIRST_IMPOSSIBLE_NS = 1 << 62
"""ns; no clock shows more (the year 2116). Times are unsigned in the file, and signed everywhere else."""

_FOOTER = struct.Struct("<BQQQI")
"""The whole record: opcode, length, start of the summary and of its offsets, CRC from the summary's start to here."""

_MESSAGE_INDEX = struct.Struct("<HI")
"""A message index's head: channel id, bytes of its (log time, offset) pairs."""

_LONGEST_NAME = 64
"""Bytes of a compression's name: "zstd" and "lz4" are known."""

_LOOSE_BLOCK_BYTES = 4 << 20
"""Bytes of messages outside of any chunk that are read at a time, about the usual size of a chunk."""


@dataclass(frozen=True)
class _Block:
    """A stretch of the file that holds records: a chunk's content, or records that stand outside of any chunk.

    `channel_ids` is `None` where it is not known which channels are in it; `indexes` holds (channel, offset) of its
    message index records, if it has any. `unpacked_bytes` is what it says of itself, 0 where it says nothing.
    """

    offset: int
    size: int
    compression: str
    start_ns: int
    end_ns: int
    channel_ids: frozenset[int] | None
    indexes: tuple[tuple[int, int], ...] = ()
    unpacked_bytes: int = 0


class McapStorage:
    """One MCAP file. Each stream opens the file anew and holds one chunk at a time (more where chunks overlap)."""

    def __init__(self, path: Path, notes: Notes, limits: Limits) -> None:
        self._path = path
        self._limits = limits
        self._left_out = LeftOut(notes, str(path))
        self._checked: set[int] = set()
        with path.open("rb") as file:
            index = _index_from_summary(file) or _Scan(file, path, notes, limits, self._left_out)
        self._blocks = index.blocks
        self._channels = {
            number: _channel(record, index.schemas.get(record.schema_id), index.counts.get(number, 0))
            for number, record in index.channels.items()
        }
        merged: dict[tuple[str, str], list[Channel]] = {}
        for channel in self._channels.values():
            merged.setdefault((channel.topic, channel.msgtype), []).append(channel)
        self.channels = tuple(_merge(merged[key]) for key in sorted(merged))
        self.start_ns = min((block.start_ns for block in self._blocks), default=0)
        if self.start_ns >= _FIRST_IMPOSSIBLE_NS:
            raise RecordingError(
                "all messages were recorded at times that no clock shows",
                where=str(path),
                cure="record or copy it again",
            )
        self.end_ns = min(max((block.end_ns for block in self._blocks), default=0), _FIRST_IMPOSSIBLE_NS)

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        wanted, first, beyond, blocks = self._selection(topics, start_ns, end_ns)
        with self._path.open("rb") as file:

            def reader(block: _Block) -> Callable[[], Iterable[RawMessage]]:
                return lambda: self._read_block(file, block, wanted, first, beyond)

            yield from merge_lazily((block.start_ns, reader(block)) for block in blocks)

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        wanted, first, beyond, blocks = self._selection(topics, start_ns, end_ns)
        with self._path.open("rb") as file:
            for block in sorted(blocks, key=lambda block: block.start_ns):
                yield from self._block_times(file, block, wanted, first, beyond)

    def _block_times(
        self, file: BinaryIO, block: _Block, wanted: dict[int, Channel], first: int, beyond: int
    ) -> list[tuple[str, int]]:
        """(topic, log time) of a block's messages; it is read itself where it has no index, or a damaged one."""
        indexes = [(number, offset) for number, offset in block.indexes if number in wanted]
        try:
            times = [
                (wanted[number].topic, time) for number, offset in indexes for time in _indexed_times(file, offset)
            ]
        except struct.error:
            times, indexes = [], []
        if not indexes:
            found = self._read_block(file, block, wanted, first, beyond)
            return [(message.channel.topic, message.log_ns) for message in found]
        return [(topic, time) for topic, time in times if first <= time < beyond]

    def _selection(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> tuple[dict[int, Channel], int, int, list[_Block]]:
        """The wanted channels, the bounds of time, and the blocks that may hold such messages."""
        first = self.start_ns if start_ns is None else start_ns
        beyond = self.end_ns + 1 if end_ns is None else end_ns
        wanted = {number: channel for number, channel in self._channels.items() if channel.topic in topics}
        blocks = [
            block
            for block in self._blocks
            if block.end_ns >= first
            and block.start_ns < beyond
            and (block.channel_ids is None or not block.channel_ids.isdisjoint(wanted))
        ]
        return wanted, first, beyond, blocks

    def _read_block(
        self, file: BinaryIO, block: _Block, wanted: dict[int, Channel], first: int, beyond: int
    ) -> list[RawMessage]:
        try:
            records = memoryview(_content(file, block, self._limits))
            if block.offset not in self._checked:
                _check_crc(file, block, records)
                self._checked.add(block.offset)
        except _FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return []
        found = []
        for opcode, start, end in _walk(records):
            if opcode == Opcode.MESSAGE:
                number, _, log_ns, _ = _MESSAGE.unpack_from(records, start)
                if log_ns >= _FIRST_IMPOSSIBLE_NS:
                    self._left_out.add("messages", f"a message of time {log_ns} ns, which no clock shows", start)
                elif number in wanted and first <= log_ns < beyond:
                    place = block.offset + start
                    message = self._message(wanted[number], log_ns, records[start + _MESSAGE.size : end], place)
                    found += [] if message is None else [message]
        found.sort(key=lambda message: message.log_ns)
        return found

    def _message(self, channel: Channel, log_ns: int, data: memoryview, place: int) -> RawMessage | None:
        """A message, unpacked; `None` (with a note) where it cannot be."""
        try:
            return RawMessage(channel, log_ns, unpacked_message(data, self._limits))
        except ValueError as error:
            self._left_out.add("messages", f"a message of {channel.topic} cannot be unpacked ({error})", place)
            return None


def _merge(channels: list[Channel]) -> Channel:
    first = channels[0]
    total = sum(channel.count for channel in channels)
    return Channel(first.topic, first.msgtype, first.serialization, first.definition, first.definition_format, total)


def _channel(channel: McapChannel, schema: Schema | None, count: int) -> Channel:
    name, form, definition = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
    return Channel(channel.topic, full_type_name(name), channel.message_encoding, definition, form, count)


_FAULTS = (RuntimeError, ValueError, struct.error, EOFError)
"""What reading a damaged chunk raises."""


def _content(file: BinaryIO, block: _Block, limits: Limits) -> bytes:
    """The records of a block, unpacked; as many as there are where it is cut off. Raises what `_FAULTS` names."""
    file.seek(block.offset)
    packed = file.read(block.size)
    if not block.compression:
        return packed
    most = most_unpacked(len(packed), limits.chunk_bytes)
    if block.unpacked_bytes > most:
        raise ValueError(f"it would unpack to {block.unpacked_bytes} bytes, the limit chunk_bytes allows {most}")
    if block.compression == "zstd":
        return unpacked_zstd(packed, block.unpacked_bytes, limits)
    if block.compression == "lz4":
        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most)
        return unpacked
    raise ValueError(f"unknown compression {block.compression!r}")


def _check_crc(file: BinaryIO, block: _Block, records: memoryview) -> None:
    """Raise `ValueError` where a whole chunk's content does not fit its checksum; 0 is none (MCAP, "Chunk")."""
    if not block.unpacked_bytes or len(records) != block.unpacked_bytes:
        return
    file.seek(block.offset - 8 - len(block.compression) - 4 - _UINT32.size)
    (crc,) = _UINT32.unpack(file.read(_UINT32.size))
    if crc and zlib.crc32(records) != crc:
        raise ValueError("its content does not fit its checksum")


def _indexed_times(file: BinaryIO, offset: int) -> list[int]:
    """The log times of one message index record, ascending."""
    file.seek(offset + _RECORD.size)
    _, size = _MESSAGE_INDEX.unpack(file.read(_MESSAGE_INDEX.size))
    pairs = file.read(size)
    return sorted(struct.unpack(f"<{len(pairs) // 8}Q", pairs)[::2])


def _walk(records: bytes | memoryview) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of every whole record."""
    position, size = 0, len(records)
    while position + _RECORD.size <= size:
        opcode, length = _RECORD.unpack_from(records, position)
        start = position + _RECORD.size
        position = start + length
        if position > size:
            return
        if opcode != Opcode.MESSAGE or length >= _MESSAGE.size:
            yield opcode, start, position


@dataclass(frozen=True)
class _Index:
    """Where everything is."""

    schemas: dict[int, Schema]
    channels: dict[int, McapChannel]
    counts: dict[int, int]
    blocks: list[_Block]


def _index_from_summary(file: BinaryIO) -> _Index | None:
    """The index at the file's end, if it is there and complete."""
    summary = _summary(file)
    if summary is None or summary.statistics is None or not summary.channels:
        return None
    if len(summary.chunk_indexes) != summary.statistics.chunk_count or not summary.chunk_indexes:
        return None
    if any(channel.schema_id and channel.schema_id not in summary.schemas for channel in summary.channels.values()):
        return None
    blocks = [
        _Block(
            offset=chunk.chunk_start_offset + _RECORD.size + _CHUNK.size + len(chunk.compression) + 8,
            size=chunk.compressed_size,
            compression=chunk.compression,
            start_ns=chunk.message_start_time,
            end_ns=chunk.message_end_time,
            channel_ids=frozenset(chunk.message_index_offsets) or None,
            indexes=tuple(chunk.message_index_offsets.items()),
            unpacked_bytes=chunk.uncompressed_size,
        )
        for chunk in summary.chunk_indexes
        if chunk.message_end_time or chunk.message_index_offsets
    ]
    return _Index(summary.schemas, summary.channels, summary.statistics.channel_message_counts, blocks)


def _ends_properly(file: BinaryIO) -> bool:
    """Whether the closing magic is there."""
    if file.seek(0, 2) < 2 * len(MCAP_MAGIC):
        return False
    file.seek(-len(MCAP_MAGIC), 2)
    return file.read() == MCAP_MAGIC


def _summary(file: BinaryIO) -> Summary | None:
    if not _ends_properly(file):
        return None
    file.seek(0)
    try:
        return SeekingReader(file).get_summary() if _summary_is_sound(file) else None
    except (McapError, struct.error, ValueError, EOFError, MemoryError, OverflowError):
        return None


def _summary_is_sound(file: BinaryIO) -> bool:
    """Whether the index at the end fits its checksum; 0 is none (MCAP, "Footer")."""
    begin = file.seek(-_FOOTER.size - len(MCAP_MAGIC), 2)
    opcode, _, summary_start, _, crc = _FOOTER.unpack(file.read(_FOOTER.size))
    if opcode != Opcode.FOOTER or not 0 < summary_start <= begin:
        return False
    file.seek(summary_start)
    return not crc or zlib.crc32(file.read(begin + _FOOTER.size - _UINT32.size - summary_start)) == crc


_RECORD_FAULTS = (McapError, struct.error, ValueError, EOFError, KeyError)
"""What parsing a damaged record raises."""


class _Scan:
    """The index of a file without one, found by walking over its records; chunks are opened only to learn channels."""

    def __init__(self, file: BinaryIO, path: Path, notes: Notes, limits: Limits, left_out: LeftOut) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, McapChannel] = {}
        self.counts: Counter[int] = Counter()
        self.blocks: list[_Block] = []
        self._file = file
        self._limits = limits
        self._left_out = left_out
        self._size = path.stat().st_size
        self._end = self._size
        self._chunk: _Block | None = None
        self._chunk_indexes: dict[int, tuple[int, int]] = {}
        self._loose: list[tuple[int, int, int, int]] = []
        whole = self._walk_file()
        if not whole:
            self._chunk_indexes.clear()
        self._close_chunk()
        self._close_loose()
        if not self.blocks:
            cut = "the file is cut off before its first message"
            what = f"no messages in the recording{left_out.reason}" if whole or left_out.reason else cut
            raise RecordingError(what, where=str(path), cure="record or copy it again")
        if not whole:
            total = sum(self.counts.values())
            notes.note(
                f"cut {path}",
                f"{path}: the file is cut off, it is read up to the cut at byte {self._end}: {total} messages",
            )
        elif not _ends_properly(file):
            notes.note(
                f"cut {path}", f"{path}: the file is cut off behind its messages (no footer), all of them are read"
            )

    def _walk_file(self) -> bool:
        """Visit every record; False if the file ends before its data does."""
        position = len(MCAP_MAGIC)
        while position + _RECORD.size <= self._size:
            self._file.seek(position)
            opcode, length = _RECORD.unpack(self._file.read(_RECORD.size))
            if opcode in {Opcode.DATA_END, Opcode.FOOTER}:
                return True
            self._end = position if opcode == 0 or length > self._size else self._size
            if not opcode:
                return False
            start, position = position + _RECORD.size, position + _RECORD.size + length
            if position > self._size and opcode != Opcode.CHUNK:
                return False
            try:
                self._visit(opcode, start, min(position, self._size))
            except _RECORD_FAULTS as error:
                self._left_out.add("records", f"the record at byte {start} is damaged ({error})", start)
        return False

    def _visit(self, opcode: int, start: int, end: int) -> None:
        if opcode == Opcode.CHUNK:
            self._visit_chunk(start, end)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._file.seek(start)
            number, size = _MESSAGE_INDEX.unpack(self._file.read(_MESSAGE_INDEX.size))
            if size:
                self._chunk_indexes[number] = (start - _RECORD.size, size // 16)
        elif opcode == Opcode.MESSAGE:
            self._file.seek(start)
            number, _, log_ns, _ = _MESSAGE.unpack(self._file.read(_MESSAGE.size))
            self._visit_loose(number, log_ns, start - _RECORD.size, end)
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            self._file.seek(start)
            self._learn(opcode, self._file.read(end - start))

    def _visit_chunk(self, start: int, end: int) -> None:
        self._close_chunk()
        self._file.seek(start)
        head = self._file.read(_CHUNK.size)
        if len(head) < _CHUNK.size:
            return
        start_ns, end_ns, unpacked_bytes, _, name_length = _CHUNK.unpack(head)
        if name_length > _LONGEST_NAME:
            return
        compression = self._file.read(name_length).decode(errors="replace")
        offset = start + _CHUNK.size + name_length + 8
        if end > offset:
            self._chunk = _Block(
                offset, end - offset, compression, start_ns, end_ns, None, unpacked_bytes=unpacked_bytes
            )

    def _close_chunk(self) -> None:
        """Take the chunk in; without a message index behind it, or with unknown channels in it, it has to be read."""
        if (block := self._chunk) is None:
            return
        found, self._chunk, self._chunk_indexes = self._chunk_indexes, None, {}
        counts = Counter({number: count for number, (_, count) in found.items()})
        if not counts or not counts.keys() <= self.channels.keys():
            counts = self._read_chunk(block)
        counts = Counter({number: count for number, count in counts.items() if number in self.channels})
        if counts:
            indexes = tuple((number, offset) for number, (offset, _) in found.items())
            self.counts.update(counts)
            self.blocks.append(replace(block, channel_ids=frozenset(counts), indexes=indexes))

    def _read_chunk(self, block: _Block) -> Counter[int]:
        counts: Counter[int] = Counter()
        try:
            records = _content(self._file, block, self._limits)
            _check_crc(self._file, block, memoryview(records))
        except _FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return counts
        for opcode, start, end in _walk(records):
            if opcode == Opcode.MESSAGE:
                counts[_MESSAGE.unpack_from(records, start)[0]] += 1
            elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
                self._learn(opcode, records[start:end])
        return counts

    def _visit_loose(self, number: int, log_ns: int, start: int, end: int) -> None:
        self.counts[number] += 1
        self._loose.append((start, end, log_ns, number))
        if end - self._loose[0][0] > _LOOSE_BLOCK_BYTES:
            self._close_loose()

    def _close_loose(self) -> None:
        if not self._loose:
            return
        first, last = self._loose[0][0], self._loose[-1][1]
        times = [log_ns for _, _, log_ns, _ in self._loose]
        numbers = frozenset(number for _, _, _, number in self._loose)
        self.blocks.append(_Block(first, last - first, "", min(times), max(times), numbers))
        self._loose.clear()

    def _learn(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        else:
            channel = McapChannel.read(stream)
            self.channels[channel.id] = channel
