"""Pictures that a map keeps: pixels, or nothing."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
import pytest

from supermap_cli.geometry.pictures import decode_bgr, decode_grey16

DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 1000


def png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels)[1].tobytes()


def test_pictures_are_decoded() -> None:
    colour = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    assert (decode_bgr(png(colour)) == colour).all()
    assert (decode_grey16(png(DEPTH)) == DEPTH).all()


def large() -> bytes:
    """A PNG whose header says 134 million pixels."""
    head = b"IHDR" + struct.pack(">IIBBBBB", 1 << 14, 1 << 13, 16, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head)) + png(DEPTH)[33:]


@pytest.mark.parametrize("content", [b"", b"\xff\xd8", b"\xff\xd8\xff", png(DEPTH)[:40], large(), b"<svg/>"])
def test_bytes_that_are_no_picture_give_nothing(content: bytes) -> None:
    assert decode_bgr(content) is None
    assert decode_grey16(content) is None


def test_a_colour_picture_is_no_depth() -> None:
    assert decode_grey16(png(np.zeros((3, 4, 3), np.uint8))) is None
    assert decode_grey16(png(np.zeros((3, 4), np.uint8))) is None
