"""The size of a compressed image by its header alone, before anything is unpacked."""

from __future__ import annotations

import struct

_PNG, _JPEG, _BMP, _RIFF, _WEBP = b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM", b"RIFF", b"WEBP"
"""First bytes: PNG (RFC 2083), JPEG (ITU T.81), BMP, WebP (RFC 9649)."""

_NO_LENGTH = frozenset({0x01, *range(0xD0, 0xD9)})
"""JPEG markers without a segment behind them (T.81, table B.1)."""

_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG markers of a frame header, which holds the size (T.81, B.2.2)."""

_START_OF_SCAN = 0xDA


def image_size(data: bytes | memoryview) -> tuple[int, int] | None:
    """(width, height) in pixels by the header of a PNG, JPEG, BMP or WebP; `None` where it says none."""
    head = bytes(data[:32])
    try:
        if head.startswith(_PNG):
            return struct.unpack_from(">II", head, 16) if _png_is_whole(memoryview(data).cast("B")) else None
        if head.startswith(_JPEG):
            return _jpeg_size(memoryview(data).cast("B"))
        if head.startswith(_BMP):
            width, height = struct.unpack_from("<ii", head, 18)
            return abs(width), abs(height)
        if head.startswith(_RIFF) and head[8:12] == _WEBP:
            return _webp_size(head)
    except struct.error:
        return None
    return None


def _png_is_whole(data: memoryview) -> bool:
    """Whether all chunks lie within the data up to the last: decoders take memory for as many bytes as one claims."""
    position, kind = len(_PNG), b""
    while kind != b"IEND" and position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind = bytes(data[position + 4 : position + 8])
        position += 12 + length
    return position <= len(data)


def _jpeg_size(data: memoryview) -> tuple[int, int] | None:
    position = 2
    while position + 4 <= len(data):
        if data[position] != 0xFF:
            return None
        marker = data[position + 1]
        if marker == 0xFF:
            position += 1
            continue
        if marker in _NO_LENGTH:
            position += 2
            continue
        if marker in _FRAME:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        if marker == _START_OF_SCAN:
            return None
        (length,) = struct.unpack_from(">H", data, position + 2)
        position += 2 + length
    return None


def _webp_size(head: bytes) -> tuple[int, int] | None:
    kind = head[12:16]
    if kind == b"VP8X":
        width, height = int.from_bytes(head[24:27], "little"), int.from_bytes(head[27:30], "little")
        return width + 1, height + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", head, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", head, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None
