"""RVL, the lossless 16-bit depth codec of image_transport's compressedDepth.

A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017: runs of zeros and of non-zeros alternate; a non-zero
pixel is stored as the zigzag difference to the last one; every number is cut into 3-bit groups, lowest first, one a
nibble, whose highest bit says that more follow; nibbles fill 32-bit little-endian words from the top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import IntArray, UInt16Array


def decode_rvl(data: bytes | memoryview, pixels: int) -> UInt16Array:
    """(pixels,) uint16. Raises `ValueError` if the stream ends early or does not fit."""
    numbers = _numbers(_nibbles(data))
    headers, ends = _runs(numbers, pixels)
    is_value = np.ones(len(numbers), bool)
    is_value[headers] = is_value[headers + 1] = False
    is_value[int(headers[-1] + 2 + numbers[headers[-1] + 1]) if len(headers) else 0 :] = False
    zigzag = numbers[is_value]
    values = np.cumsum((zigzag >> 1) ^ -(zigzag & 1))
    lengths = numbers[headers + 1]
    firsts = np.cumsum(lengths) - lengths
    depth = np.zeros(pixels, np.uint16)
    depth[np.arange(len(values)) + np.repeat(ends - lengths - firsts, lengths)] = values.astype(np.uint16)
    return depth


def _runs(numbers: IntArray, pixels: int) -> tuple[IntArray, IntArray]:
    """Where each run's header (zeros, non-zeros) stands in the stream, and the pixel at which the run ends."""
    listed = numbers.tolist()
    headers, ends = [], []
    at = position = 0
    while position < pixels:
        if at + 1 >= len(listed):
            raise ValueError(f"the RVL stream ends at pixel {position} of {pixels}")
        headers.append(at)
        position += listed[at] + listed[at + 1]
        at += 2 + listed[at + 1]
        ends.append(position)
        if at > len(listed) or position > pixels:
            raise ValueError(f"the RVL stream does not fit {pixels} pixels")
    return np.array(headers, np.int64), np.array(ends, np.int64)


def encode_rvl(depth: UInt16Array) -> bytes:
    """The stream of a flat uint16 image."""
    flat = depth.astype(np.int64).ravel()
    filled = flat != 0
    edges = np.flatnonzero(np.diff(filled, prepend=False, append=False))
    starts, ends = edges[::2], edges[1::2]
    zigzag = np.diff(flat[filled], prepend=0)
    zigzag = (zigzag << 1) ^ (zigzag >> 63)
    numbers: list[IntArray] = []
    position, used = 0, 0
    for start, end in zip(starts, ends, strict=True):
        numbers += [np.array([start - position, end - start]), zigzag[used : used + end - start]]
        position, used = end, used + end - start
    if position < len(flat):
        numbers.append(np.array([len(flat) - position, 0]))
    return _pack(np.concatenate(numbers)) if numbers else b""


def _nibbles(data: bytes | memoryview) -> NDArray[np.uint8]:
    words = np.frombuffer(data, "<u4", count=len(data) // 4)
    octets = words.astype(">u4").view(np.uint8)
    return np.column_stack([octets >> 4, octets & 15]).ravel()


def _numbers(nibbles: NDArray[np.uint8]) -> IntArray:
    """The variable-length numbers in a stream of nibbles (an unfinished last one is dropped)."""
    lasts = np.flatnonzero(nibbles < 8)
    if not len(lasts):
        return np.zeros(0, np.int64)
    firsts = np.concatenate([[0], lasts[:-1] + 1])
    nibbles = nibbles[: lasts[-1] + 1]
    place = np.arange(len(nibbles)) - np.repeat(firsts, lasts - firsts + 1)
    parts = (nibbles & 7).astype(np.int64) << (3 * np.minimum(place, 20))
    return np.add.reduceat(parts, firsts)


def _pack(numbers: IntArray) -> bytes:
    groups = np.ones(len(numbers), np.int64)
    for bits in range(3, 33, 3):
        groups += numbers >= 1 << bits
    firsts = np.cumsum(groups) - groups
    place = np.arange(int(groups.sum())) - np.repeat(firsts, groups)
    nibbles = (np.repeat(numbers, groups) >> (3 * place)) & 7
    nibbles |= np.where(place + 1 < np.repeat(groups, groups), 8, 0)
    nibbles = np.concatenate([nibbles, np.zeros(-len(nibbles) % 8, np.int64)]).astype(np.uint8)
    octets = (nibbles[::2] << 4 | nibbles[1::2]).astype(np.uint8)
    return octets.view(">u4").astype("<u4").tobytes()
