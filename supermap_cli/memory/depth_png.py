"""Whether a stored depth image is whole, told from its container: no pixel is decoded."""

from __future__ import annotations

import struct
import zlib

from supermap_cli.errors import MemoryStoreError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = struct.Struct(">I4s")
_HEADER = struct.Struct(">IIBB")
_DEPTH = (16, 0)
"""Bits, and the colour type of grey."""


def depth_shape(png: bytes) -> tuple[int, int]:
    """(h, w) of a 16-bit grey PNG with all its chunks and their checksums. Raises `MemoryStoreError` for others."""
    if not png.startswith(_SIGNATURE):
        raise MemoryStoreError("is no PNG")
    shape, at, kind = None, len(_SIGNATURE), b""
    while kind != b"IEND":
        if at + _CHUNK.size > len(png):
            raise MemoryStoreError("ends too early")
        length, kind = _CHUNK.unpack_from(png, at)
        end = at + _CHUNK.size + length
        if png[end : end + 4] != zlib.crc32(png[at + 4 : end]).to_bytes(4, "big"):
            raise MemoryStoreError("is damaged or ends too early")
        if kind == b"IHDR" and length >= _HEADER.size:
            width, height, *pixels = _HEADER.unpack_from(png, at + _CHUNK.size)
            shape = (height, width) if tuple(pixels) == _DEPTH else None
        at = end + 4
    if shape is None:
        raise MemoryStoreError("is no 16-bit grey image")
    return shape
