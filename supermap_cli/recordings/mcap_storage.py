"""MCAP files (https://mcap.dev/spec), by their index where there is one and by a scan where there is none.

A file that was cut off (no footer, the last chunk incomplete) is read up to the cut; a chunk whose content does not fit
its checksum is left out.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.mcap_blocks import (
    CHUNK_FAULTS,
    MESSAGE,
    McapBlock,
    block_content,
    check_crc,
    indexed_times,
    walk_records,
)
from supermap_cli.recordings.mcap_index import McapScan, index_from_summary
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, LeftOut, RawMessage, full_type_name, merge_lazily
from supermap_cli.recordings.unpacking import unpacked_message

_FIRST_IMPOSSIBLE_NS = 1 << 62
"""ns; no clock shows more (the year 2116). Times are unsigned in the file, and signed everywhere else."""


class McapStorage:
    """One MCAP file. Each stream opens the file anew and holds one chunk at a time (more where chunks overlap)."""

    def __init__(self, path: Path, notes: Notes, limits: Limits) -> None:
        self._path = path
        self._limits = limits
        self._left_out = LeftOut(notes, str(path))
        self._checked: set[int] = set()
        with path.open("rb") as file:
            index = index_from_summary(file) or McapScan(file, path, notes, limits, self._left_out)
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

            def reader(block: McapBlock) -> Callable[[], Iterable[RawMessage]]:
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
        self, file: BinaryIO, block: McapBlock, wanted: dict[int, Channel], first: int, beyond: int
    ) -> list[tuple[str, int]]:
        """(topic, log time) of a block's messages; it is read itself where it has no index, or a damaged one."""
        indexes = [(number, offset) for number, offset in block.indexes if number in wanted]
        try:
            times = [(wanted[number].topic, time) for number, offset in indexes for time in indexed_times(file, offset)]
        except struct.error:
            times, indexes = [], []
        if not indexes:
            found = self._read_block(file, block, wanted, first, beyond)
            return [(message.channel.topic, message.log_ns) for message in found]
        return [(topic, time) for topic, time in times if first <= time < beyond]

    def _selection(
        self, topics: Collection[str], start_ns: int | None, end_ns: int | None
    ) -> tuple[dict[int, Channel], int, int, list[McapBlock]]:
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
        self, file: BinaryIO, block: McapBlock, wanted: dict[int, Channel], first: int, beyond: int
    ) -> list[RawMessage]:
        try:
            records = memoryview(block_content(file, block, self._limits))
            if block.offset not in self._checked:
                check_crc(file, block, records)
                self._checked.add(block.offset)
        except CHUNK_FAULTS as error:
            self._left_out.add("chunks", f"the chunk at byte {block.offset} is damaged ({error})", block.offset)
            return []
        found = []
        for opcode, start, end in walk_records(records):
            if opcode == Opcode.MESSAGE:
                number, _, log_ns, _ = MESSAGE.unpack_from(records, start)
                if log_ns >= _FIRST_IMPOSSIBLE_NS:
                    self._left_out.add("messages", f"a message of time {log_ns} ns, which no clock shows", start)
                elif number in wanted and first <= log_ns < beyond:
                    place = block.offset + start
                    message = self._message(wanted[number], log_ns, records[start + MESSAGE.size : end], place)
                    found += [] if message is None else [message]
        found.sort(key=lambda message: message.log_ns)
        return found

    def _message(self, channel: Channel, log_ns: int, data: memoryview, place: int) -> RawMessage | None:
        """A message, unpacked; `None` (with a note) where it cannot be. Its bytes are its own: a small message that is
        kept for long (a detection, a pose) would keep the images of its whole block.
        """
        try:
            return RawMessage(channel, log_ns, bytes(unpacked_message(data, self._limits)))
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
