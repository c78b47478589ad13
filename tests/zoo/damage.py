"""What recorders, crashes and people do to a recording's file. Each takes the file and returns what is left of it."""

from __future__ import annotations

import gzip
import shutil
import sqlite3
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame
import zstandard
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import Writer as Ros2Writer

Damage = Callable[[Path], Path]


def cut(share: float) -> Damage:
    """The first part of a file, as a crash or a full disk leaves it."""

    def apply(path: Path) -> Path:
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * share)])
        return path

    return apply


def renamed(name: str) -> Damage:
    """Another name."""
    return lambda path: path.rename(path.with_name(name))


def packed(ending: str, pack: Callable[[bytes], bytes]) -> Damage:
    """Compressed as a whole, with the ending."""

    def apply(path: Path) -> Path:
        target = path.with_name(path.name + ending)
        target.write_bytes(pack(path.read_bytes()))
        path.unlink()
        return target

    return apply


zstd = packed(".zstd", zstandard.ZstdCompressor(level=1).compress)
gz = packed(".gz", gzip.compress)
lz4_file = packed(".lz4", lz4.frame.compress)


def zipped(path: Path) -> Path:
    """In a zip archive."""
    target = path.with_suffix(".zip")
    with zipfile.ZipFile(target, "w") as archive:
        archive.write(path, path.name)
    return target


def tarred(path: Path) -> Path:
    """In a tar archive."""
    target = path.with_suffix(".tar")
    with tarfile.open(target, "w") as archive:
        archive.add(path, path.name)
    return target


def replaced(content: bytes) -> Damage:
    """Something else under its name."""

    def apply(path: Path) -> Path:
        path.write_bytes(content)
        return path

    return apply


def never_closed(path: Path) -> Path:
    """A bag whose recorder was killed: no index, and the name that `rosbag record` gives while it records."""
    data = bytearray(path.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    index = int.from_bytes(data[at : at + 8], "little")
    data[at : at + 8] = bytes(8)
    target = path.with_name("run.bag.active")
    target.write_bytes(data[:index])
    path.unlink()
    return target


def in_folder(*names: str, broken: bytes | None = None, metadata: bool = True) -> Damage:
    """The folder of a recorder that splits: the file under the first name, then parts of zeros or empty ones."""

    def apply(path: Path) -> Path:
        folder = path.with_name("run_split")
        folder.mkdir()
        path.rename(folder / names[0])
        for name in names[1:]:
            (folder / name).write_bytes(broken or b"")
        if metadata:
            listed = "".join(f"    - {name}\n" for name in names)
            text = f"rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n{listed}"
            (folder / "metadata.yaml").write_text(text)
        return folder

    return apply


def without_metadata(path: Path) -> Path:
    """A rosbag2 folder of which metadata.yaml is missing."""
    (path / "metadata.yaml").unlink()
    return path


def without_definitions(path: Path) -> Path:
    """A database as recorders before Iron wrote it: it names types and does not define them."""
    connection = sqlite3.connect(path)
    connection.execute("DELETE FROM message_definitions")
    connection.commit()
    connection.close()
    return path


def with_wal(path: Path) -> Path:
    """A database of a recorder that was killed: what it wrote last stands in the -wal file."""
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 0")
    connection.execute("CREATE TABLE later AS SELECT * FROM messages")
    connection.execute("DELETE FROM messages")
    connection.commit()
    connection.execute("INSERT INTO messages SELECT * FROM later")
    connection.commit()
    folder = path.with_name("killed")
    folder.mkdir()
    for name in (path.name, f"{path.name}-wal"):
        shutil.copy(path.with_name(name), folder / name)
    connection.close()
    return folder / path.name


def compressed(mode: CompressionMode) -> Damage:
    """As `ros2 bag record --compression-mode MODE --compression-format zstd` writes a rosbag2 folder."""

    def apply(path: Path) -> Path:
        target = path.with_name(f"{path.name}_{mode.value}")
        writer = Ros2Writer(target, version=9)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        with Ros2Reader(path) as reader, writer:
            made = {
                each.id: writer.add_connection(each.topic, each.msgtype, msgdef=each.msgdef.data, rihs01=each.digest)
                for each in reader.connections
            }
            for connection, stamp_ns, data in reader.messages():
                writer.write(made[connection.id], stamp_ns, data)
        return target

    return apply


def rewritten(change: Callable[[int, int, str], tuple[int, str]]) -> Damage:
    """An MCAP file with other log times and names of types; `change(number, log time, type)` gives them."""

    def apply(path: Path) -> Path:
        target = path.with_name("rewritten.mcap")
        with path.open("rb") as source, target.open("wb") as file:
            writer = McapWriter(file)
            writer.start(profile="ros2", library="zoo")
            channels: dict[int, int] = {}
            for number, (schema, channel, message) in enumerate(make_reader(source).iter_messages()):
                assert schema is not None
                log_ns, name = change(number, message.log_time, schema.name)
                if channel.id not in channels:
                    made = writer.register_schema(name, schema.encoding, schema.data)
                    channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, made)
                writer.add_message(channels[channel.id], log_ns, message.data, log_ns)
            writer.finish()
        return target

    return apply


def as_mcap(path: Path) -> Path:
    """A ROS 1 bag as `mcap convert` writes it."""
    target = path.with_suffix(".mcap")
    with Ros1Reader(path) as reader, target.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros1", library="mcap go")
        channels = dict(_ros1_channels(writer, reader))
        for connection, stamp_ns, data in reader.messages():
            writer.add_message(channels[connection.id], stamp_ns, bytes(data), stamp_ns)
        writer.finish()
    return target


def _ros1_channels(writer: McapWriter, reader: Ros1Reader) -> Iterator[tuple[int, int]]:
    for each in reader.connections:
        name = each.msgtype.replace("/msg/", "/")
        schema = writer.register_schema(name, "ros1msg", each.msgdef.data.encode())
        yield each.id, writer.register_channel(each.topic, "ros1", schema)
