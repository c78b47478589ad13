"""Mutated recordings: whatever the bytes, what comes out is values or an error of one line, within bounded time.

Small real recordings of every format are changed byte by byte, and message by message inside of sound containers.
"""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from support import bags
from support.foxglove_bags import Json, Protobuf, write_foxglove
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input
from support.whole_recordings import read_everything

FORMATS = ("zstd.mcap", "lz4.mcap", "plain.mcap", "run.bag", "run.db3", "json.mcap", "protobuf.mcap")


@cache
def whole(name: str) -> bytes:
    """A small sound recording of a format."""
    path = Path(mkdtemp(prefix="supermap-fuzz-")) / name
    if name.startswith(("json", "protobuf")):
        write_foxglove(path, Json() if name.startswith("json") else Protobuf(), compressed=True)
    elif path.suffix == ".mcap":
        kinds = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "plain": CompressionType.NONE}
        kind = kinds[name.partition(".")[0]]
        bags.write_recording(path, frames=3, lidar=True, color_encoding="jpeg", compression=kind, chunk_size=4000)
    else:
        bags.write_recording(path, frames=3, lidar=True, depth_encoding="compressedDepth")
    return path.read_bytes()


def check(data: bytes, name: str) -> None:
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder, one_input(f"recording {name}"):
        path = Path(folder) / name
        path.write_bytes(data)
        read_everything(path)


@pytest.mark.parametrize("name", FORMATS)
def test_changed_files(name):
    @fuzzing(12)
    @given(MUTATIONS)
    def changed(changes):
        check(mutated(whole(name), changes), name)

    changed()


def rewritten(data: bytes, topic: str, changes: list[Edit], *, definition: bool) -> bytes:
    """A sound MCAP in which the messages of one topic, or the definition of their type, are changed."""
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder:
        source, target = Path(folder) / "source.mcap", Path(folder) / "target.mcap"
        source.write_bytes(data)
        with source.open("rb") as file, target.open("wb") as out:
            writer, known = Writer(out), {}
            writer.start("ros2")
            for schema, channel, message in make_reader(file).iter_messages():
                if channel.id not in known:
                    text = mutated(schema.data, changes) if definition and channel.topic == topic else schema.data
                    number = writer.register_schema(schema.name, schema.encoding, text)
                    known[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
                changed = not definition and channel.topic == topic
                content = mutated(message.data, changes) if changed else message.data
                writer.add_message(known[channel.id], message.log_time, content, message.log_time)
            writer.finish()
        return target.read_bytes()


@cache
def topics_of(name: str) -> tuple[str, ...]:
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder:
        path = Path(folder) / name
        path.write_bytes(whole(name))
        with path.open("rb") as file:
            return tuple(sorted({channel.topic for _, channel, _ in make_reader(file).iter_messages()}))


@pytest.mark.parametrize("definition", [False, True], ids=["messages", "definitions"])
@pytest.mark.parametrize("name", ["plain.mcap", "json.mcap", "protobuf.mcap"])
def test_changed_messages_in_a_sound_container(name, definition):
    @fuzzing(12)
    @given(st.sampled_from(topics_of(name)), MUTATIONS)
    def changed(topic, changes):
        check(rewritten(whole(name), topic, changes, definition=definition), name)

    changed()
