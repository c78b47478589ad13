"""Every listed encoding, from bytes to RGB and metres."""

import struct
from dataclasses import replace

import cv2
import numpy as np
import pytest

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.images import decode_color, decode_depth, decode_numbers
from supermap_cli.recordings.messages import ImageMessage
from supermap_cli.recordings.rvl import encode_rvl

RGB = np.random.default_rng(0).integers(0, 255, (6, 10, 3), dtype=np.uint8)
DEPTH_MM = np.array([[0, 500, 1000], [1500, 65535, 1]], np.uint16)


def raw(pixels, encoding, *, padding=0, big_endian=False):
    array = pixels.astype(pixels.dtype.newbyteorder(">")) if big_endian else pixels
    rows = np.ascontiguousarray(array).view(np.uint8).reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=9)
    height, width = pixels.shape[:2]
    return ImageMessage(0, "camera", encoding, rows.tobytes(), width, height, rows.shape[1], big_endian)


def compressed(data, form):
    return ImageMessage(0, "camera", form, data, compressed=True)


def png(pixels):
    return cv2.imencode(".png", pixels)[1].tobytes()


@pytest.mark.parametrize("padding", [0, 7])
@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("rgb8", RGB),
        ("bgr8", RGB[..., ::-1]),
        ("8UC3", RGB[..., ::-1]),
        ("rgba8", np.dstack([RGB, np.full((6, 10), 255, np.uint8)])),
        ("bgra8", np.dstack([RGB[..., ::-1], np.full((6, 10), 255, np.uint8)])),
    ],
)
def test_colour_encodings_give_rgb(encoding, pixels, padding):
    assert np.array_equal(decode_color(raw(pixels, encoding, padding=padding)), RGB)


@pytest.mark.parametrize("padding", [0, 3])
def test_grey_becomes_rgb(padding):
    rgb = decode_color(raw(RGB[..., 0], "mono8", padding=padding))
    assert np.array_equal(rgb, np.repeat(RGB[..., :1], 3, axis=2))


@pytest.mark.parametrize("big_endian", [False, True])
def test_sixteen_bit_grey_keeps_its_high_byte(big_endian):
    grey = RGB[..., 0].astype(np.uint16) * 256 + 3
    assert np.array_equal(decode_color(raw(grey, "mono16", big_endian=big_endian))[..., 1], RGB[..., 0])


@pytest.mark.parametrize("encoding", ["yuv422", "yuv422_yuy2"])
def test_grey_yuv_is_grey(encoding):
    pixels = np.full((4, 6, 2), 128, np.uint8)
    rgb = decode_color(raw(pixels, encoding))
    assert rgb.shape == (4, 6, 3)
    assert np.ptp(rgb) <= 2


@pytest.mark.parametrize(
    ("encoding", "row", "column"),
    [("bayer_rggb8", 0, 0), ("bayer_bggr8", 1, 1), ("bayer_gbrg8", 1, 0), ("bayer_grbg8", 0, 1)],
)
def test_bayer_patterns_find_the_red_pixels(encoding, row, column):
    mosaic = np.zeros((8, 8), np.uint8)
    mosaic[row::2, column::2] = 200
    rgb = decode_color(raw(mosaic, encoding))
    assert rgb[2:6, 2:6, 0].min() > 150
    assert rgb[2:6, 2:6, 1:].max() == 0


def test_jpeg_and_png_are_rgb_too():
    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 220
    for form in ("jpeg", "png"):
        data = cv2.imencode(f".{form}", red[..., ::-1])[1].tobytes()
        rgb = decode_color(compressed(data, f"rgb8; {form} compressed bgr8"))
        assert np.abs(rgb.astype(int) - red).max() < 8


def test_an_unknown_colour_encoding_names_itself_and_a_cure():
    with pytest.raises(RecordingError, match=r"'h265'.*jpeg"):
        decode_color(compressed(b"\0\0\0\1abc", "h265"))
    with pytest.raises(RecordingError, match="'32FC7'"):
        decode_color(raw(RGB, "32FC7"))


@pytest.mark.parametrize("data", [b"", b"\xff\xd8garbage"])
def test_a_broken_jpeg_is_broken_and_not_unknown(data):
    with pytest.raises(ValueError, match="cannot be decoded"):
        decode_color(compressed(data, "jpeg"))


def test_too_few_bytes_are_refused():
    image = raw(RGB, "rgb8")
    with pytest.raises(ValueError, match="do not hold"):
        decode_color(replace(image, data=image.data[:-1]))


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_millimetres_becomes_metres(padding, big_endian):
    depth = decode_depth(raw(DEPTH_MM, "16UC1", padding=padding, big_endian=big_endian))
    assert depth.dtype == np.float32
    assert np.allclose(depth, DEPTH_MM / 1000)


@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_metres_loses_what_is_no_return(big_endian):
    metres = np.array([[np.nan, np.inf, -1.0], [0.0, 1.25, 30.0]], np.float32)
    depth = decode_depth(raw(metres, "32FC1", big_endian=big_endian))
    assert np.allclose(depth, [[0, 0, 0], [0, 1.25, 30]])


@pytest.mark.parametrize(
    "data", [struct.pack("<iff", 0, 0, 0) + png(DEPTH_MM), png(DEPTH_MM)], ids=["with header", "bare png"]
)
def test_compressed_depth_png(data):
    assert np.allclose(decode_depth(compressed(data, "16UC1; compressedDepth png")), DEPTH_MM / 1000)
    assert np.allclose(decode_depth(compressed(data, "16UC1; compressedDepth")), DEPTH_MM / 1000)


def test_compressed_depth_rvl():
    data = struct.pack("<iffii", 0, 0, 0, 3, 2) + encode_rvl(DEPTH_MM)
    assert np.allclose(decode_depth(compressed(data, "16UC1; compressedDepth rvl")), DEPTH_MM / 1000)


@pytest.mark.parametrize("codec", ["png", "rvl"])
def test_float_depth_is_quantised_inversely(codec):
    """compressed_depth_image_transport: raw = A / depth + B, with depth_quantization 100 and depth_max 10."""
    depth = np.array([[0, 0.5, 1.0], [2.0, 5.0, 9.0]])
    a = 100.0 * (100.0 + 1)
    b = 1.0 - a / 10.0
    with np.errstate(divide="ignore"):
        raw16 = np.where(depth > 0, np.rint(a / depth + b), 0).astype(np.uint16)
    header = struct.pack("<iff", 1, a, b)
    data = header + (png(raw16) if codec == "png" else struct.pack("<ii", 3, 2) + encode_rvl(raw16))
    found = decode_depth(compressed(data, f"32FC1; compressedDepth {codec}"))
    assert np.allclose(found, depth, rtol=0.01)


def test_plain_png_depth_is_millimetres():
    assert np.allclose(decode_depth(compressed(png(DEPTH_MM), "16UC1; png compressed ")), DEPTH_MM / 1000)


@pytest.mark.parametrize("data", [b"", b"123", struct.pack("<iff", 0, 0, 0)])
def test_empty_compressed_depth_is_broken(data):
    with pytest.raises(ValueError, match="content"):
        decode_depth(compressed(data, "16UC1; compressedDepth png"))


def test_an_unknown_depth_encoding_is_named():
    with pytest.raises(RecordingError, match="'rgb8'"):
        decode_depth(raw(RGB, "rgb8"))


@pytest.mark.parametrize("image", [raw(DEPTH_MM, "16UC1"), compressed(png(DEPTH_MM), "16UC1; png compressed")])
def test_instance_masks_keep_their_numbers(image):
    assert np.array_equal(decode_numbers(image), DEPTH_MM)


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize(("pattern", "colour"), [("rggb", 0), ("bggr", 2)])
def test_sixteen_bit_mosaics_keep_their_high_bytes(pattern, colour, big_endian):
    mosaic = np.zeros((6, 10), np.uint16)
    mosaic[::2, ::2] = 200 << 8
    rgb = decode_color(raw(mosaic, f"bayer_{pattern}16", big_endian=big_endian))
    assert rgb[2:4, 2:8].reshape(-1, 3).max(axis=0)[colour] == 200
    assert rgb[2:4, 2:8].reshape(-1, 3).max(axis=0)[2 - colour] == 0


@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize(("encoding", "order"), [("nv12", (0, 1)), ("nv21", (1, 0)), ("nv24", (0, 1))])
def test_planes_below_each_other_give_rgb(encoding, order, padding):
    luma, chroma = np.full((6, 10), 81, np.uint8), np.array([90, 240], np.uint8)[list(order)]
    lines = 12 if encoding == "nv24" else 3
    image = raw(np.vstack([luma, np.tile(chroma, (lines, 5))]), encoding, padding=padding)
    rgb = decode_color(replace(image, height=6))
    assert rgb.shape == (6, 10, 3)
    assert np.abs(rgb.astype(int) - [255, 0, 0]).max() <= 3


@pytest.mark.parametrize("encoding", ["nv12", "nv21", "nv24"])
def test_planes_that_are_cut_off_or_odd_are_broken(encoding):
    with pytest.raises(ValueError, match="do not hold"):
        decode_color(ImageMessage(0, "camera", encoding, bytes(70), 10, 6, 10))
    odd = ImageMessage(0, "camera", encoding, bytes(200), 5, 5, 5)
    if encoding == "nv24":
        assert decode_color(odd).shape == (5, 5, 3)
    else:
        with pytest.raises(ValueError, match="cannot be decoded"):
            decode_color(odd)


def test_depth_as_tiff_is_millimetres_or_metres():
    metres = np.where(DEPTH_MM > 0, DEPTH_MM / 1000, np.nan).astype(np.float32)
    for pixels, form in ((DEPTH_MM, "16UC1; tiff compressed"), (metres, "32FC1; tiff compressed")):
        depth_m = decode_depth(compressed(cv2.imencode(".tiff", pixels)[1].tobytes(), form))
        assert np.allclose(depth_m, DEPTH_MM / 1000, rtol=1e-6)
    with pytest.raises(ValueError, match="cannot be decoded"):
        decode_depth(compressed(b"II*\0\x08\0\0\0\xff\xff", "16UC1; tiff compressed"))
