"""The size of a compressed image by its header alone, before anything is unpacked."""

from __future__ import annotations

import struct

_PNG, _JPEG, _BMP, _RIFF, _WEBP = b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"BM", b"RIFF", b"WEBP"
_TIFF = {b"II*\0": "<", b"MM\0*": ">"}
"""First bytes: PNG (RFC 2083), JPEG (ITU T.81), BMP, WebP (RFC 9649), TIFF 6.0 (section 2) with its byte order."""

_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_SHORT = 256, 257, 3
"""Tags ImageWidth and ImageLength, and the type of 16 bits, the other being LONG (TIFF 6.0, section 2 and 8)."""

_NO_LENGTH = frozenset({0x01, *range(0xD0, 0xD9)})
"""JPEG markers without a segment behind them (T.81, table B.1)."""

_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG markers of a frame header, which holds the size (T.81, B.2.2)."""

_START_OF_SCAN = 0xDA


def image_size(data: bytes | memoryview) -> tuple[int, int] | None:
    """(width, height) in pixels by the header of a PNG, JPEG, TIFF, BMP or WebP; `None` where it says none."""
    try:
        return _size(bytes(data[:32]), memoryview(data).cast("B"))
    except struct.error:
        return None


def _size(head: bytes, data: memoryview) -> tuple[int, int] | None:
    size: tuple[int, int] | None = None
    if head.startswith(_PNG):
        size = struct.unpack_from(">II", head, 16) if _png_is_whole(data) else None
    elif head.startswith(_JPEG):
        size = _jpeg_size(data)
    elif head[:4] in _TIFF:
        size = _tiff_size(data, _TIFF[head[:4]])
    elif head.startswith(_BMP):
        width, height = struct.unpack_from("<ii", head, 18)
        size = abs(width), abs(height)
    elif head.startswith(_RIFF) and head[8:12] == _WEBP:
        size = _webp_size(head)
    return size


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


def _tiff_size(data: memoryview, order: str) -> tuple[int, int] | None:
    """By the tags of the first image's directory, 12 bytes each."""
    (start,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, start)
    sizes = {}
    for entry in range(start + 2, start + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(f"{order}HH", data, entry)
        if tag in {_TIFF_WIDTH, _TIFF_HEIGHT}:
            (sizes[tag],) = struct.unpack_from(f"{order}{'H' if kind == _TIFF_SHORT else 'I'}", data, entry + 8)
    return (sizes[_TIFF_WIDTH], sizes[_TIFF_HEIGHT]) if len(sizes) == 2 else None


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
