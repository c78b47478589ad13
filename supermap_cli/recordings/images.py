"""Decoding of images: colour to RGB, depth to metres, instance masks to numbers.

Sources: sensor_msgs/image_encodings.h (Image), image_transport_plugins (CompressedImage, compressedDepth).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import Float32Array, UInt8Array, UInt16Array
from supermap_cli.geometry.image_header import image_size
from supermap_cli.recordings.image_size import check_pixels, check_size
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.messages import ImageMessage
from supermap_cli.recordings.rvl import decode_rvl

_DEFAULT = Limits()

_PNG = b"\x89PNG"
"""How every PNG begins (RFC 2083, section 3.1)."""

_DEPTH_HEADER = struct.Struct("<iff")
"""compressed_depth_image_transport's ConfigHeader: format, depthParam[0], depthParam[1]."""

_RVL_SIZE = struct.Struct("<ii")
"""Width and height in pixels before an RVL stream (compressed_depth_image_transport, rvl_codec)."""


class _PixelLayout(NamedTuple):
    """How an encoding lies in memory, and the OpenCV conversion to RGB (`None`: it is RGB).

    `half_lines` are the lines of its planes together, in halves of the image's height.
    """

    dtype: str
    channels: int
    to_rgb: int | None
    half_lines: int = 2


_COLOR = {
    "rgb8": _PixelLayout("u1", 3, None),
    "bgr8": _PixelLayout("u1", 3, cv2.COLOR_BGR2RGB),
    "8UC3": _PixelLayout("u1", 3, cv2.COLOR_BGR2RGB),
    "rgba8": _PixelLayout("u1", 4, cv2.COLOR_RGBA2RGB),
    "bgra8": _PixelLayout("u1", 4, cv2.COLOR_BGRA2RGB),
    "8UC4": _PixelLayout("u1", 4, cv2.COLOR_BGRA2RGB),
    "mono8": _PixelLayout("u1", 1, cv2.COLOR_GRAY2RGB),
    "8UC1": _PixelLayout("u1", 1, cv2.COLOR_GRAY2RGB),
    "mono16": _PixelLayout("u2", 1, cv2.COLOR_GRAY2RGB),
    "rgb16": _PixelLayout("u2", 3, None),
    "bgr16": _PixelLayout("u2", 3, cv2.COLOR_BGR2RGB),
    "rgba16": _PixelLayout("u2", 4, cv2.COLOR_RGBA2RGB),
    "bgra16": _PixelLayout("u2", 4, cv2.COLOR_BGRA2RGB),
    "yuv422": _PixelLayout("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": _PixelLayout("u1", 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": _PixelLayout("u1", 2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": _PixelLayout("u1", 2, cv2.COLOR_YUV2RGB_YUY2),
    "nv12": _PixelLayout("u1", 1, cv2.COLOR_YUV2RGB_NV12, half_lines=3),
    "nv21": _PixelLayout("u1", 1, cv2.COLOR_YUV2RGB_NV21, half_lines=3),
    "nv24": _PixelLayout("u1", 1, None, half_lines=6),
    **{
        f"bayer_{pattern}{bits}": _PixelLayout(dtype, 1, to_rgb)
        for bits, dtype in ((8, "u1"), (16, "u2"))
        for pattern, to_rgb in (
            ("rggb", cv2.COLOR_BayerRGGB2RGB),
            ("bggr", cv2.COLOR_BayerBGGR2RGB),
            ("gbrg", cv2.COLOR_BayerGBRG2RGB),
            ("grbg", cv2.COLOR_BayerGRBG2RGB),
        )
    },
}
"""Colour encodings (sensor_msgs/image_encodings.h; nv12 is that of decoders, Linux's V4L2_PIX_FMT_NV12)."""

_FLOAT_DEPTH = {"32FC1": "f4", "64FC1": "f8"}
"""Depth encodings in metres."""

COLOR_ENCODINGS = (*_COLOR, "jpeg", "png")
"""What colour images may be encoded in, for error messages."""

DEPTH_ENCODINGS = ("16UC1", "32FC1", "mono16", "64FC1", "compressedDepth (png, rvl)", "png", "tiff")
"""What depth images may be encoded in, for error messages."""


def is_depth_encoding(image: ImageMessage) -> bool:
    """Whether an image's encoding can only be depth (mono16 and png could be either)."""
    encoding = image.encoding.partition(";")[0].strip()
    return "compressedDepth" in image.encoding or encoding in {"16UC1", "32FC1", "64FC1"}


def unknown_encoding(image: ImageMessage, known: tuple[str, ...]) -> RecordingError:
    """The error for an encoding that is not supported; the caller adds where it was."""
    return RecordingError(
        f"unknown image encoding {image.encoding!r}",
        cure=f"re-record or convert it to one of {', '.join(known)}, or name another topic",
    )


def decode_color(image: ImageMessage, limits: Limits = _DEFAULT) -> UInt8Array:
    """(h, w, 3) uint8 RGB.

    Raises `RecordingError` for an unknown encoding, `ValueError` for broken data and beyond the limit of pixels.
    """
    with _broken_data():
        return _decode_compressed_color(image, limits) if image.compressed else _decode_raw_color(image, limits)


@contextmanager
def _broken_data() -> Iterator[None]:
    """Turns what OpenCV and numpy raise on broken data into `ValueError`."""
    try:
        yield
    except (cv2.error, struct.error, MemoryError, OverflowError, TypeError, IndexError) as error:
        raise ValueError(f"an image that cannot be decoded ({type(error).__name__})") from error


def _decode_raw_color(image: ImageMessage, limits: Limits) -> UInt8Array:
    layout = _COLOR.get(image.encoding)
    if layout is None:
        raise unknown_encoding(image, COLOR_ENCODINGS)
    pixels = _pixels(image, layout.dtype, layout.channels, limits, half_lines=layout.half_lines)
    if image.encoding == "nv24":
        return np.ascontiguousarray(_rgb_of_nv24(pixels, image.height))
    if layout.dtype == "u2":
        pixels = (pixels >> 8).astype(np.uint8)
    if layout.to_rgb is not None:
        pixels = np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), layout.to_rgb))
    return np.ascontiguousarray(pixels)


def _rgb_of_nv24(planes: NDArray[Any], height: int) -> NDArray[Any]:
    """nv24 has U and V for every pixel: it is every other pixel of an nv12 image of twice the size."""
    luma, chroma = planes[:height], planes[height:].reshape(height, -1)
    doubled = np.vstack([luma.repeat(2, axis=0).repeat(2, axis=1), chroma])
    return np.asarray(cv2.cvtColor(doubled, cv2.COLOR_YUV2RGB_NV12))[::2, ::2]


def _decode_compressed_color(image: ImageMessage, limits: Limits) -> UInt8Array:
    if any(known in image.encoding.lower() for known in ("jpeg", "jpg", "png")) or image_size(image.data):
        check_size(image.data, limits)
    else:
        raise unknown_encoding(image, COLOR_ENCODINGS)
    data = np.frombuffer(image.data, np.uint8)
    bgr = cv2.imdecode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION) if len(data) else None
    if bgr is None:
        raise ValueError("a compressed image that cannot be decoded")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)


def decode_depth(image: ImageMessage, limits: Limits = _DEFAULT) -> Float32Array:
    """(h, w) float32 metres, 0 = no return.

    Raises `RecordingError` for an unknown encoding, `ValueError` for broken data and beyond the limit of pixels.
    """
    with _broken_data():
        return _decode_compressed_depth(image, limits) if image.compressed else _decode_raw_depth(image, limits)


def _decode_raw_depth(image: ImageMessage, limits: Limits) -> Float32Array:
    if image.encoding in {"16UC1", "mono16"}:
        return _millimetres(_pixels(image, "u2", 1, limits))
    if image.encoding in _FLOAT_DEPTH:
        return _returns(_pixels(image, _FLOAT_DEPTH[image.encoding], 1, limits))
    raise unknown_encoding(image, DEPTH_ENCODINGS)


def _millimetres(raw: NDArray[np.unsignedinteger]) -> Float32Array:
    metres: Float32Array = np.multiply(raw, np.float32(1e-3), dtype=np.float32)
    return metres


def _returns(depth_m: NDArray[np.floating]) -> Float32Array:
    """Non-finite and negative depth is no return: 0."""
    return np.where(np.isfinite(depth_m) & (depth_m > 0), depth_m, 0).astype(np.float32, copy=False)


def decode_numbers(image: ImageMessage, limits: Limits = _DEFAULT) -> UInt16Array:
    """(h, w) uint16 of an instance mask image (16UC1, mono16, mono8 or 8UC1; raw or PNG). Raises as `decode_depth`."""
    with _broken_data():
        if image.compressed:
            return _decode_png16(image.data, limits).astype(np.uint16)
        return _decode_raw_numbers(image, limits)


def _decode_raw_numbers(image: ImageMessage, limits: Limits) -> UInt16Array:
    dtype = {"16UC1": "u2", "mono16": "u2", "8UC1": "u1", "mono8": "u1"}.get(image.encoding)
    if dtype is None:
        raise unknown_encoding(image, ("16UC1", "mono16", "mono8", "8UC1"))
    return _pixels(image, dtype, 1, limits).astype(np.uint16)


def _pixels(image: ImageMessage, dtype: str, channels: int, limits: Limits, *, half_lines: int = 2) -> NDArray[Any]:
    """The rows without their padding, (h, w) or (h, w, channels), in the machine's byte order; of planes one below the
    other, whose lines are given in halves of the height, all.
    """
    check_pixels(image.width, image.height, len(image.data), limits)
    lines = image.height * half_lines // 2
    kind = np.dtype(dtype).newbyteorder(">" if image.big_endian else "<")
    row = image.width * channels * kind.itemsize
    step = image.step or row
    if step < row or len(image.data) < step * (lines - 1) + row:
        raise ValueError(
            f"{len(image.data)} bytes do not hold {image.width} x {image.height} {image.encoding} rows of {step} bytes"
        )
    padded = np.zeros(step * lines, np.uint8)
    data = np.frombuffer(image.data, np.uint8)[: len(padded)]
    rows = data if len(data) == len(padded) else padded
    if rows is padded:
        padded[: len(data)] = data
    packed = np.ascontiguousarray(rows.reshape(lines, step)[:, :row]).view(kind)
    shaped = packed.reshape((lines, image.width) if channels == 1 else (lines, image.width, channels))
    return shaped.astype(kind.newbyteorder("="), copy=False)


def _decode_compressed_depth(image: ImageMessage, limits: Limits) -> Float32Array:
    """A CompressedImage of depth: plain PNG or TIFF (16 bits: mm; floats: m), or compressedDepth with its 12-byte
    ConfigHeader.

    Inverse quantisation of 32FC1: depth = depthParam[0] / (raw - depthParam[1])  (compressed_depth_image_transport).
    """
    if "compressedDepth" not in image.encoding or bytes(image.data[:4]) == _PNG:
        return _metres(_decode_grey(image.data, limits))
    if len(image.data) <= _DEPTH_HEADER.size:
        raise ValueError("a compressedDepth image without content")
    _, a, b = _DEPTH_HEADER.unpack_from(image.data)
    body = image.data[_DEPTH_HEADER.size :]
    raw = _decode_png16(body, limits) if bytes(body[:4]) == _PNG else _decode_rvl_image(image, body, limits)
    if not image.encoding.strip().startswith("32FC1"):
        return _millimetres(raw)
    with np.errstate(divide="ignore", invalid="ignore"):
        return _returns(np.where(raw > 0, np.float32(a) / (raw.astype(np.float32) - np.float32(b)), np.float32(0)))


def _decode_rvl_image(image: ImageMessage, body: bytes | memoryview, limits: Limits) -> UInt16Array:
    if "rvl" not in image.encoding.lower() or len(body) < _RVL_SIZE.size:
        raise unknown_encoding(image, DEPTH_ENCODINGS)
    width, height = _RVL_SIZE.unpack_from(body)
    check_pixels(width, height, len(body), limits)
    return decode_rvl(body[_RVL_SIZE.size :], width * height).reshape(height, width)


def _decode_png16(body: bytes | memoryview, limits: Limits) -> NDArray[np.unsignedinteger]:
    pixels = _decode_grey(body, limits)
    if pixels.dtype.kind != "u":
        raise ValueError(f"an image of {pixels.dtype} where 16 bits were expected")
    return pixels


def _decode_grey(body: bytes | memoryview, limits: Limits) -> NDArray[Any]:
    """(h, w) of a PNG or TIFF with one channel of 8 or 16 bits, or of floats."""
    if not len(body):
        raise ValueError("a PNG that cannot be decoded")
    check_size(body, limits)
    pixels: NDArray[Any] | None = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("a PNG or TIFF that cannot be decoded")
    if pixels.ndim != 2 or pixels.dtype not in {np.dtype(kind) for kind in ("u1", "u2", "f4", "f8")}:
        raise ValueError(f"an image of {pixels.dtype} with shape {pixels.shape} where one 16-bit channel was expected")
    return pixels


def _metres(pixels: NDArray[Any]) -> Float32Array:
    """Whole numbers are millimetres, floats metres (REP-118)."""
    return _returns(pixels) if pixels.dtype.kind == "f" else _millimetres(pixels)
