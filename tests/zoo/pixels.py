"""Colour, depth and masks in the encodings that drivers and image_transport write."""

from __future__ import annotations

import struct

import cv2
import numpy as np

TRANSPORTS = ("compressed", "compressedDepth")
"""What image_transport appends to a topic."""

_COMPRESSED = {
    "jpeg": "jpeg",
    "png": "png",
    "jpeg bgr8": "bgr8; jpeg compressed bgr8",
    "jpeg rgb8": "rgb8; jpeg compressed bgr8",
    "png bgr8": "bgr8; png compressed bgr8",
    "jpeg depth": "jpeg",
    "png depth": "16UC1; png compressed ",
    "tiff depth": "16UC1; tiff compressed",
    "compressedDepth": "16UC1; compressedDepth",
    "compressedDepth png": "16UC1; compressedDepth png",
    "compressedDepth 32FC1": "32FC1; compressedDepth png",
    "compressedDepth rvl": "16UC1; compressedDepth rvl",
    "h264": "h264",
}
"""Our name of an encoding to the `format` of the CompressedImage."""


def format_of(encoding: str) -> str:
    """What a CompressedImage says of itself."""
    return _COMPRESSED[encoding]


def pack(shown: np.ndarray, encoding: str) -> bytes | np.ndarray:
    """The bytes of a compressed image, or the rows (lines, bytes) of a raw one.

    `shown` is rgb (h, w, 3) uint8, depth (h, w) float metres, or numbers (h, w) uint16.
    """
    if encoding in _COMPRESSED:
        return _compress(shown, encoding)
    raw = _COLOR[encoding](shown) if shown.ndim == 3 else _PLAIN[encoding](shown)
    raw = np.ascontiguousarray(raw)
    return raw.view(np.uint8).reshape(len(raw), -1)


def _mm(depth_m: np.ndarray) -> np.ndarray:
    return np.round(depth_m * 1000).astype("<u2")


def _bytes(shown: np.ndarray) -> np.ndarray:
    return (np.clip(shown * 40, 0, 255) if shown.dtype.kind == "f" else shown).astype(np.uint8)


_PLAIN = {
    "16UC1": lambda shown: _mm(shown) if shown.dtype.kind == "f" else shown.astype("<u2"),
    "mono16": lambda shown: _mm(shown) if shown.dtype.kind == "f" else shown.astype("<u2"),
    "32FC1": lambda shown: shown.astype("<f4"),
    "32SC1": lambda shown: shown.astype("<i4"),
    "64FC1": lambda shown: shown.astype("<f8"),
    "mono8": _bytes,
    "8UC1": _bytes,
}  # fmt: skip


def _grey(rgb: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))


def _with_alpha(rgb: np.ndarray) -> np.ndarray:
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])


def _bayer(rgb: np.ndarray, pattern: str) -> np.ndarray:
    channel = {"r": 0, "g": 1, "b": 2}
    mosaic = np.zeros(rgb.shape[:2], np.uint8)
    for place, letter in enumerate(pattern):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = rgb[row::2, column::2, channel[letter]]
    return mosaic


def _yuv422(rgb: np.ndarray, order: str) -> np.ndarray:
    yuv = _video_range(rgb)
    chroma = yuv[:, ::2, 1:].reshape(rgb.shape[:2])
    return np.stack([yuv[..., 0], chroma] if order == "yuyv" else [chroma, yuv[..., 0]], axis=-1)


def _nv(rgb: np.ndarray, order: str) -> np.ndarray:
    planar = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2YUV_I420))
    height, width = rgb.shape[:2]
    luma, rest = planar[:height], planar[height:].ravel()
    u, v = np.split(rest, 2)
    chroma = np.stack([v, u] if order == "vu" else [u, v], axis=-1).reshape(height // 2, width)
    return np.vstack([luma, chroma])


def _nv24(rgb: np.ndarray) -> np.ndarray:
    y, u, v = np.moveaxis(_video_range(rgb), -1, 0)
    height, width = y.shape
    return np.vstack([y, np.stack([u, v], axis=-1).reshape(2 * height, width)])


def _video_range(rgb: np.ndarray) -> np.ndarray:
    """(h, w, 3) of Y, U, V of ITU-R BT.601, 16 to 235 and 16 to 240."""
    yuv = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2YUV)).astype(float)
    scaled = np.dstack([16 + yuv[..., 0] * 219 / 255, 128 + (yuv[..., 1:] - 128) * 224 / 255])
    return np.clip(scaled, 0, 255).astype(np.uint8)


_COLOR = {
    "rgb8": lambda rgb: rgb,
    "bgr8": lambda rgb: rgb[..., ::-1],
    "8UC3": lambda rgb: rgb[..., ::-1],
    "rgba8": _with_alpha,
    "bgra8": lambda rgb: _with_alpha(rgb[..., ::-1]),
    "8UC4": lambda rgb: _with_alpha(rgb[..., ::-1]),
    "mono8": _grey,
    "8UC1": _grey,
    "mono16": lambda rgb: _grey(rgb).astype("<u2") << 8,
    "16UC1": lambda rgb: _grey(rgb).astype("<u2") << 8,
    "rgb16": lambda rgb: rgb.astype("<u2") << 8,
    "bgr16": lambda rgb: rgb[..., ::-1].astype("<u2") << 8,
    "rgba16": lambda rgb: _with_alpha(rgb).astype("<u2") << 8,
    "bgra16": lambda rgb: _with_alpha(rgb[..., ::-1]).astype("<u2") << 8,
    "32FC3": lambda rgb: rgb[..., ::-1].astype("<f4") / 255,
    "yuv422": lambda rgb: _yuv422(rgb, "uyvy"),
    "uyvy": lambda rgb: _yuv422(rgb, "uyvy"),
    "yuv422_yuy2": lambda rgb: _yuv422(rgb, "yuyv"),
    "yuyv": lambda rgb: _yuv422(rgb, "yuyv"),
    "nv12": lambda rgb: _nv(rgb, "uv"),
    "nv21": lambda rgb: _nv(rgb, "vu"),
    "nv24": _nv24,
    **{f"bayer_{p}8": (lambda rgb, p=p: _bayer(rgb, p)) for p in ("rggb", "bggr", "gbrg", "grbg")},
    **{f"bayer_{p}16": (lambda rgb, p=p: _bayer(rgb, p).astype("<u2") << 8) for p in ("rggb", "bggr", "gbrg", "grbg")},
}


def _compress(shown: np.ndarray, encoding: str) -> bytes:
    kind, _, _ = encoding.partition(" ")
    if shown.ndim == 3:
        ending = {"jpeg": ".jpg", "png": ".png", "h264": ".jpg"}[kind]
        data = cv2.imencode(ending, shown[..., ::-1])[1].tobytes()
        return b"\0\0\0\1\x67" + data[:40] if kind == "h264" else data
    if shown.dtype.kind != "f":
        return bytes(cv2.imencode(".png", shown)[1].tobytes())
    if kind == "jpeg":
        return bytes(cv2.imencode(".jpg", np.clip(shown * 40, 0, 255).astype(np.uint8))[1].tobytes())
    if encoding in {"png depth", "tiff depth"}:
        return bytes(cv2.imencode(f".{kind}", _mm(shown))[1].tobytes())
    return _compress_depth(shown, encoding)


def _compress_depth(depth_m: np.ndarray, encoding: str) -> bytes:
    """compressed_depth_image_transport: a header of 12 bytes, then a PNG or an RVL stream."""
    if encoding.endswith("32FC1"):
        a, b = 100.0 * 101.0, 1.0 - 100.0 * 101.0 / 10.0  # depth_quantization 100, depth_max 10 m: its defaults
        quantized = np.round(a / depth_m + b).astype(np.uint16)
        return struct.pack("<iff", 0, a, b) + cv2.imencode(".png", quantized)[1].tobytes()
    if encoding.endswith("rvl"):
        height, width = depth_m.shape
        return struct.pack("<iff", 0, 0, 0) + struct.pack("<ii", width, height) + _rvl(_mm(depth_m).ravel())
    return struct.pack("<iff", 0, 0, 0) + cv2.imencode(".png", _mm(depth_m))[1].tobytes()


def _rvl(values: np.ndarray) -> bytes:
    """RVL (Wilson 2017) of values that are never 0: runs of zeros, runs of others, zig-zag differences in nibbles."""
    nibbles: list[int] = []

    def put(value: int) -> None:
        while True:
            low, value = value & 7, value >> 3
            nibbles.append(low | (8 if value else 0))
            if not value:
                return

    put(0)
    put(len(values))
    before = 0
    for value in values.tolist():
        difference, before = value - before, value
        put((difference << 1) ^ (difference >> 31))
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        sum(nibble << (28 - 4 * k) for k, nibble in enumerate(nibbles[i : i + 8])) for i in range(0, len(nibbles), 8)
    ]
    return struct.pack(f"<{len(words)}I", *words)
