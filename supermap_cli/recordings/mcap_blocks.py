"""Blocks of an MCAP file, which hold its records, and the records in them (https://mcap.dev/spec)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import lz4.frame
from mcap.opcode import Opcode

from supermap_cli.recordings.limits import Limits, most_unpacked
from supermap_cli.recordings.unpacking import unpacked_zstd

RECORD = struct.Struct("<BQ")
"""Every record's head: opcode, length of its content."""

MESSAGE = struct.Struct("<HIQQ")
"""A message's head: channel id, sequence, log time, publish time."""

CHUNK = struct.Struct("<QQQII")
"""A chunk's head: start and end time, uncompressed size, uncompressed CRC, length of the compression's name."""

UINT32 = struct.Struct("<I")
"""A CRC."""

MESSAGE_INDEX = struct.Struct("<HI")
"""A message index's head: channel id, bytes of its (log time, offset) pairs."""


@dataclass(frozen=True)
class McapBlock:
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


CHUNK_FAULTS = (RuntimeError, ValueError, struct.error, EOFError)
"""What reading a damaged chunk raises."""


def block_content(file: BinaryIO, block: McapBlock, limits: Limits) -> bytes:
    """The records of a block, unpacked; as many as there are where it is cut off. Raises what `CHUNK_FAULTS` names."""
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


def check_crc(file: BinaryIO, block: McapBlock, records: memoryview) -> None:
    """Raise `ValueError` where a whole chunk's content does not fit its checksum; 0 is none (MCAP, "Chunk")."""
    if not block.unpacked_bytes or len(records) != block.unpacked_bytes:
        return
    file.seek(block.offset - 8 - len(block.compression) - 4 - UINT32.size)
    (crc,) = UINT32.unpack(file.read(UINT32.size))
    if crc and zlib.crc32(records) != crc:
        raise ValueError("its content does not fit its checksum")


def indexed_times(file: BinaryIO, offset: int) -> list[int]:
    """The log times of one message index record, ascending."""
    file.seek(offset + RECORD.size)
    _, size = MESSAGE_INDEX.unpack(file.read(MESSAGE_INDEX.size))
    pairs = file.read(size)
    return sorted(struct.unpack(f"<{len(pairs) // 8}Q", pairs)[::2])


def walk_records(records: bytes | memoryview) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of every whole record."""
    position, size = 0, len(records)
    while position + RECORD.size <= size:
        opcode, length = RECORD.unpack_from(records, position)
        start = position + RECORD.size
        position = start + length
        if position > size:
            return
        if opcode != Opcode.MESSAGE or length >= MESSAGE.size:
            yield opcode, start, position
