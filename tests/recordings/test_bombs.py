"""Files of two megabytes that unpack to gigabytes: what reading one costs, measured in a process of its own."""

from __future__ import annotations

import bz2
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from support import bags

MOST_MB = 300
"""MB that a file of two may cost, besides what the program itself takes."""

BOMB_BYTES = 2_000_000

LIMIT_S = 300
"""Seconds; a hundred times what it takes."""


PROGRAM = """
import re, sys
from pathlib import Path
from supermap_cli.main import main
try:
    main()
finally:
    peak_kb = re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text()).group(1)
    Path(sys.argv[-1]).with_name("peak_kb").write_text(peak_kb)
"""


def cost_mb(path: Path) -> float:
    """The most memory that `supermap inspect` holds while it reads a recording, in MB."""
    command = [sys.executable, "-c", PROGRAM, "inspect", str(path)]
    done = subprocess.run(command, capture_output=True, timeout=LIMIT_S, check=False)
    assert done.returncode in {0, 1}, done.stderr
    return int(path.with_name("peak_kb").read_text(encoding="ascii")) / 1000


def write_mcap(path: Path, unpacked: int, chunks: int) -> None:
    """An MCAP of IMU messages of zeros, each in a chunk of its own."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 10, compression=CompressionType.ZSTD)
        writer.start("ros2")
        channel = writer.register_channel("/imu0", "cdr", writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b""))
        for index in range(chunks):
            writer.add_message(channel, index, bytes(unpacked), index)
        writer.finish()


def png(width: int, height: int, padded_to: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer = zlib.compressobj(9)
    rows = b"".join(packer.compress(bytes(width + 1)) for _ in range(height)) + packer.flush()
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    body = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", rows)
    return body + chunk(b"teXt", bytes(max(0, padded_to - len(body)))) + chunk(b"IEND", b"")


def one_large_chunk(path: Path) -> None:
    write_mcap(path, 600_000_000, 1)


def many_chunks(path: Path) -> None:
    write_mcap(path, 60_000_000, 20)


def images(path: Path) -> None:
    content = png(5600, 5600, BOMB_BYTES)
    with bags.BagWriter(path) as bag:
        for index in range(3):
            bag.compressed("/camera/color/image_raw/compressed", bags.stamp(index), "camera", content, "png")
            bag.compressed("/camera/depth/image_raw/compressed", bags.stamp(index), "camera", content, "png")


def packed_as_a_whole(path: Path) -> None:
    packer = zstandard.ZstdCompressor().compressobj()
    with path.open("wb") as file:
        file.write(packer.compress(b"\x89MCAP0\r\n"))
        for _ in range(300):
            file.write(packer.compress(bytes(1 << 20)))
        file.write(packer.flush())


def packed_chunk_of_ros1(path: Path) -> None:
    def record(fields: dict[str, bytes], data: bytes) -> bytes:
        header = b"".join(
            struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
            for name, value in fields.items()
        )
        return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data

    packed = bz2.compress(bytes(200_000_000))
    fields = {"op": b"\5", "compression": b"bz2", "size": struct.pack("<I", 200_000_000)}
    path.write_bytes(b"#ROSBAG V2.0\n" + record(fields, packed))


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("run.mcap", one_large_chunk),
        ("run.mcap", many_chunks),
        ("run.mcap", images),
        ("run.mcap.zstd", packed_as_a_whole),
        ("run.bag", packed_chunk_of_ros1),
    ],
    ids=["one large chunk", "many chunks", "images", "packed as a whole", "a chunk of ROS 1"],
)
def test_a_small_file_costs_little_memory(tmp_path: Path, name: str, write) -> None:
    write(tmp_path / name)
    usual_mb = cost_mb(bags.write_recording(tmp_path / "sound.mcap", frames=2))
    assert cost_mb(tmp_path / name) - usual_mb < MOST_MB
