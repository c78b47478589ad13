"""Where everything is in an MCAP file: by the index at its end, or found by a scan where there is none."""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel as McapChannel
from mcap.records import Schema
from mcap.summary import Summary

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.file_kinds import MCAP_MAGIC
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.mcap_blocks import (
    CHUNK,
    CHUNK_FAULTS,
    MESSAGE,
    MESSAGE_INDEX,
    RECORD,
    UINT32,
    McapBlock,
    block_content,
    check_crc,
    walk_records,
)
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import LeftOut

_FOOTER = struct.Struct("<BQQQI")
"""The whole record: opcode, length, start of the summary and of its offsets, CRC from the summary's start to here."""

_LONGEST_NAME = 64
"""Bytes of a compression's name: "zstd" and "lz4" are known."""

_LOOSE_BLOCK_BYTES = 4 << 20
"""Bytes of messages outside of any chunk that are read at a time, about the usual size of a chunk."""


@dataclass(frozen=True)
class McapIndex:
    """Where everything is."""

    schemas: dict[int, Schema]
    channels: dict[int, McapChannel]
    counts: dict[int, int]
    blocks: list[McapBlock]


def index_from_summary(file: BinaryIO) -> McapIndex | None:
    """The index at the file's end, if it is there and complete."""
    summary = _summary(file)
    if summary is None or summary.statistics is None or not summary.channels:
        return None
    if len(summary.chunk_indexes) != summary.statistics.chunk_count or not summary.chunk_indexes:
        return None
    if any(channel.schema_id and channel.schema_id not in summary.schemas for channel in summary.channels.values()):
        return None
    blocks = [
        McapBlock(
            offset=chunk.chunk_start_offset + RECORD.size + CHUNK.size + len(chunk.compression) + 8,
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
    return McapIndex(summary.schemas, summary.channels, summary.statistics.channel_message_counts, blocks)


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
    return not crc or zlib.crc32(file.read(begin + _FOOTER.size - UINT32.size - summary_start)) == crc


_RECORD_FAULTS = (McapError, struct.error, ValueError, EOFError, KeyError)
"""What parsing a damaged record raises."""


class McapScan:
    """The index of a file without one, found by walking over its records; chunks are opened only to learn channels."""

    def __init__(self, file: BinaryIO, path: Path, notes: Notes, limits: Limits, left_out: LeftOut) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, McapChannel] = {}
        self.counts: Counter[int] = Counter()
        self.blocks: list[McapBlock] = []
        self._file = file
        self._limits = limits
        self._left_out = left_out
        self._size = path.stat().st_size
        self._end = self._size
        self._chunk: McapBlock | None = None
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
        while position + RECORD.size <= self._size:
            self._file.seek(position)
            opcode, length = RECORD.unpack(self._file.read(RECORD.size))
            if opcode in {Opcode.DATA_END, Opcode.FOOTER}:
                return True
            self._end = position if opcode == 0 or length > self._size else self._size
            if not opcode:
                return False
            start, position = position + RECORD.size, position + RECORD.size + length
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
            number, size = MESSAGE_INDEX.unpack(self._file.read(MESSAGE_INDEX.size))
            if size:
                self._chunk_indexes[number] = (start - RECORD.size, size // 16)
        elif opcode == Opcode.MESSAGE:
            self._file.seek(start)
            number, _, log_ns, _ = MESSAGE.unpack(self._file.read(MESSAGE.size))
            self._visit_loose(number, log_ns, start - RECORD.size, end)
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            self._file.seek(start)
            self._learn(opcode, self._file.read(end - start))

    def _visit_chunk(self, start: int, end: int) -> None:
        self._close_chunk()
        self._file.seek(start)
        head = self._file.read(CHUNK.size)
        if len(head) < CHUNK.size:
            return
        start_ns, end_ns, unpacked_bytes, _, name_length = CHUNK.unpack(head)
        if name_length > _LONGEST_NAME:
            return
        compression = self._file.read(name_length).decode(errors="replace")
        offset = start + CHUNK.size + name_length + 8
        if end > offset:
            self._chunk = McapBlock(
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

    def _read_chunk(self, block: McapBlock) -> Counter[int]:
        counts: Counter[int] = Counter()
        try:
            records = block_content(self._file, block, self._limits)
            check_crc(self._file, block, memoryview(records))
        except CHUNK_FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return counts
        for opcode, start, end in walk_records(records):
            if opcode == Opcode.MESSAGE:
                counts[MESSAGE.unpack_from(records, start)[0]] += 1
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
        self.blocks.append(McapBlock(first, last - first, "", min(times), max(times), numbers))
        self._loose.clear()

    def _learn(self, opcode: int, content: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        else:
            channel = McapChannel.read(stream)
            self.channels[channel.id] = channel
