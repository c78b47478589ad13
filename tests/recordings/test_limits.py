"""Small hostile files cost little memory: what is beyond a limit is left out, or refused, and the limit is named."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.image_header import image_size
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.decoding import Decoder, MessageError
from supermap_cli.recordings.image_size import PixelLimitError
from supermap_cli.recordings.images import decode_color, decode_depth
from supermap_cli.recordings.messages import ImageMessage, header_of, peek_stamp_ns, read_transforms
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, RawMessage
from supermap_cli.types.limits import RecordingLimits
from support import bags


def png_of_zeros(width: int, height: int) -> bytes:
    """A PNG of a few kB whose header says it is large."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress(bytes(1 << 20), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def json_message(text: bytes, name: str = "foxglove.FrameTransform") -> RawMessage:
    return RawMessage(Channel("/tf", name, "json", b"", "jsonschema", 1), 7, text)


@pytest.mark.parametrize("form", [".png", ".jpg", ".bmp", ".webp"])
def test_the_header_says_the_size_of_an_image(form):
    data = cv2.imencode(form, np.zeros((37, 53, 3), np.uint8))[1].tobytes()
    assert image_size(data) == (53, 37)
    for length in range(min(len(data), 40)):
        assert image_size(data[:length]) in {None, (53, 37)}


def test_a_png_with_a_chunk_longer_than_itself_is_none():
    data = cv2.imencode(".png", np.zeros((9, 9), np.uint16))[1].tobytes()
    at = data.index(b"IDAT") - 4
    assert image_size(data) == (9, 9)
    assert image_size(data[:at] + b"\xee" * 4 + data[at + 4 :]) is None


@pytest.mark.parametrize("decode", [decode_color, decode_depth])
def test_an_image_of_too_many_pixels_is_not_unpacked(decode):
    bomb = ImageMessage(0, "camera", "png", png_of_zeros(30_000, 30_000), compressed=True)
    with pytest.raises(ValueError, match=r"30000 x 30000 pixels.*the limit image_pixels"):
        decode(bomb)
    small = ImageMessage(
        0, "camera", "png", cv2.imencode(".png", np.zeros((9, 9), np.uint8))[1].tobytes(), compressed=True
    )
    with pytest.raises(ValueError, match="allows 80"):
        decode(small, RecordingLimits(image_pixels=80))
    assert decode(small).shape[:2] == (9, 9)


def test_a_depth_stream_of_few_bytes_is_not_taken_for_a_large_image():
    data = bytes(12) + struct.pack("<ii", 16_000, 16_000) + bytes(8)
    with pytest.raises(ValueError, match="16000 x 16000"):
        decode_depth(ImageMessage(0, "camera", "16UC1; compressedDepth rvl", data, compressed=True))


@pytest.mark.parametrize("size", [(0, 4), (4, 0), (-1, 4), (1 << 31, 1 << 31)])
def test_raw_images_of_impossible_sizes_are_broken(size):
    with pytest.raises(ValueError, match="an image of"):
        decode_color(ImageMessage(0, "camera", "rgb8", bytes(48), *size))


def test_clouds_and_lists_beyond_a_limit_are_left_out(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", frames=3, lidar=True, without=("depth",))
    few = RecordingLimits(cloud_points=100)
    recording = open_bag_recording(path, RecordingRequest(limits=few))
    assert list(recording.sweeps()) == []
    assert any("the limit cloud_points allows 100" in line and "3 message(s)" in line for line in recording.warnings)
    assert len(list(open_bag_recording(path, RecordingRequest()).sweeps())) == 3


def test_a_message_compressed_on_its_own_is_bounded(tmp_path):
    import zstandard

    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2")
        channel = writer.register_channel("/imu", "cdr", writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b""))
        for data in (bytes(80 << 20), b"\0\1\0\0" + bytes(8)):
            writer.add_message(channel, 5, zstandard.ZstdCompressor().compress(data), 5)
        writer.finish()
    notes = Notes()
    assert [bytes(raw.data[:4]) for raw in open_storage(path, notes).messages(["/imu"])] == [b"\0\1\0\0"]
    assert "the limit chunk_bytes" in notes.lines[0]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (b'{"timestamp":' + b"[" * 5000 + b"]" * 5000 + b"}", "the limit nesting"),
        (b'{"timestamp": {"sec": 1e400, "nsec": 0}}', "cannot convert float infinity"),
        (b'{"timestamp": {"sec": NaN, "nsec": 0}}', "cannot convert float NaN"),
        (b'{"timestamp": {"sec": 99999999999999999999, "nsec": 0}}', "which no clock shows"),
        (b'{"timestamp": {"sec": -99999999999, "nsec": 0}}', "which no clock shows"),
        (b'{"timestamp": {}}', "does not fit its definition"),
        (b'{"timestamp": 7}', "does not fit its definition"),
        (b"[]", "does not fit its definition"),
        (b"\xff\xfe", "cannot be decoded"),
        (b"", "cannot be decoded"),
    ],
)
def test_whatever_json_says_it_is_a_value_or_an_error_of_one_line(text, what):
    decoder = Decoder("run")
    with pytest.raises(MessageError, match=what) as caught:
        decoder.read_strictly(json_message(text), header_of)
    assert "\n" not in str(caught.value)
    assert decoder.read(json_message(text), header_of) is None
    assert decoder.read(json_message(text), read_transforms) in {None, ()}


def test_what_is_left_out_is_counted_once_and_named_once():
    notes = Notes()
    decoder = Decoder("run", notes)
    raws = [RawMessage(Channel("/a", "std_msgs/msg/String", "cdr", b"", "", 3), at, b"\0") for at in (1, 2, 3)]
    for _ in range(2):
        assert list(decoder.stamped(raws, peek_stamp_ns)) == []
        assert list(decoder.each(raws, header_of)) == []
    (line,) = notes.lines
    assert "3 message(s) left out" in line
    assert "/a at 0.000 s" in line


@pytest.mark.parametrize(
    ("definition", "what"),
    [
        ("uint8[100000000] data\n", "the limit list_items"),
        ("x/Self again\n" + "=" * 80 + "\nMSG: x/Self\nx/Self again\n", "nested deeper"),
        ("x/Missing field\n", "no definition of"),
        ("not a definition ]", "cannot be decoded"),
        ("int32 import\n", "cannot be decoded"),
        ("int32 a\n" * 200_000, "a message definition of"),
    ],
)
def test_definitions_that_cannot_be_are_an_error_of_one_line(definition, what):
    raw = RawMessage(Channel("/a", "x/msg/A", "cdr", definition.encode(), "ros2msg", 1), 1, b"\0\1\0\0")
    with pytest.raises(RecordingError, match=what) as caught:
        Decoder("run").decode(raw)
    assert "\n" not in str(caught.value)


def test_a_huge_message_of_small_parts_is_not_decoded():
    raw = RawMessage(Channel("/tf", "tf2_msgs/msg/TFMessage", "cdr", b"", "", 1), 1, b"\0\1\0\0" + bytes(9 << 20))
    with pytest.raises(MessageError, match="the limit structure_bytes allows"):
        Decoder("run").decode(raw)


def test_messages_of_times_that_no_clock_shows_are_left_out(tmp_path):
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channel = writer.register_channel("/imu", "cdr", writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b""))
        for at in (5, 6, (1 << 64) - 1):
            writer.add_message(channel, at, b"\0\1\0\0", at)
        writer.finish()
    notes = Notes()
    storage = open_storage(path, notes)
    assert [raw.log_ns for raw in storage.messages(["/imu"])] == [5, 6]
    assert "which no clock shows" in notes.lines[0]


def test_an_image_beyond_the_users_limit_says_what_limit_would_do():
    raw = ImageMessage(0, "camera", "rgb8", bytes(4 * 3 * 3), width=4, height=3, step=12)
    with pytest.raises(PixelLimitError) as refused:
        decode_color(raw, RecordingLimits(image_pixels=11))
    assert decode_color(raw, RecordingLimits(image_pixels=refused.value.pixels)).shape == (3, 4, 3)
