"""Mutated recordings: whatever the bytes, what comes out is values or an error of one line, within bounded time.

Small real recordings of every format are changed byte by byte, and message by message inside of sound containers.
`SUPERMAP_FUZZ_EXAMPLES` sets how many examples each test tries (`make fuzz`).
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from supermap_cli.errors import SupermapError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from support import bags
from support.foxglove_bags import Json, Protobuf, write_foxglove

EXAMPLES = int(os.environ.get("SUPERMAP_FUZZ_EXAMPLES", "12"))
"""Of each test. Twelve take some seconds; `make fuzz` tries thousands."""

LONGEST_S = 20
"""Seconds that one example may take."""

FORMATS = ("zstd.mcap", "lz4.mcap", "plain.mcap", "run.bag", "run.db3", "json.mcap", "protobuf.mcap")

FUZZING = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize="SUPERMAP_FUZZ_EXAMPLES" not in os.environ,
    suppress_health_check=list(HealthCheck),
    database=None,
)


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


@dataclass(frozen=True)
class Edit:
    """A change of bytes at a place, given as a share of the whole."""

    kind: str
    share: float
    data: bytes

    def apply(self, data: bytes) -> bytes:
        """The changed bytes."""
        at = int(self.share * len(data))
        if self.kind == "cut":
            return data[:at]
        if self.kind == "insert":
            return data[:at] + self.data + data[at:]
        if self.kind == "remove":
            return data[:at] + data[at + len(self.data) :]
        return data[:at] + self.data + data[at + len(self.data) :]


extremes = st.sampled_from(
    [
        *(b"\0" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0", b"\0\0\0\x10"),
        *(b"\0" * 8, b"\xff" * 8, b"\xff" * 7 + b"\x7f", b"\0\0\0\0\0\0\xf0\x7f", b"\0\0\0\0\0\0\xf8\x7f"),
        *(b"\0\0\0\0\0\0\xe0\x7f", b"\0" * 64),
    ]
)
edits = st.builds(
    Edit,
    st.sampled_from(["overwrite", "overwrite", "overwrite", "cut", "insert", "remove"]),
    st.floats(0, 1, exclude_max=True),
    st.one_of(extremes, st.binary(min_size=1, max_size=12)),
)
mutations = st.lists(edits, min_size=1, max_size=4)


def mutated(data: bytes, changes: list[Edit]) -> bytes:
    for change in changes:
        data = change.apply(data)
    return data


class TooLongError(BaseException):
    """An example takes too long; nothing that reads a recording may catch it."""


@contextmanager
def time_limit() -> Iterator[None]:
    def too_long(*_: object) -> None:
        raise TooLongError(f"longer than {LONGEST_S} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def read_everything(path: Path) -> None:
    """Inspect a recording and read all its streams; errors that the user can mend have one line."""
    for read in (_inspect, _read_streams):
        try:
            read(path)
        except SupermapError as error:
            assert "\n" not in str(error)  # noqa: PT017 - an error is as right as values


def _inspect(path: Path) -> None:
    inspect_recording(path, RecordingRequest())


def _read_streams(path: Path) -> None:
    recording = open_bag_recording(path, RecordingRequest())
    recording.fingerprint()
    streams = [recording.frames, recording.sweeps, recording.imu]
    streams += [recording.poses] * ("poses" in recording.streams)
    streams += [recording.detection_stamps_ns, recording.detections] * ("detections" in recording.streams)
    for stream in streams:
        try:
            for _ in islice(iter(stream()), 100):
                pass
        except SupermapError as error:
            assert "\n" not in str(error)  # noqa: PT017 - an error is as right as values
    assert all("\n" not in line for line in recording.warnings)


def check(data: bytes, name: str) -> None:
    with TemporaryDirectory(prefix="supermap-fuzz-") as folder, time_limit():
        path = Path(folder) / name
        path.write_bytes(data)
        read_everything(path)


@pytest.mark.parametrize("name", FORMATS)
def test_changed_files(name):
    @FUZZING
    @given(mutations)
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
    @FUZZING
    @given(st.sampled_from(topics_of(name)), mutations)
    def changed(topic, changes):
        check(rewritten(whole(name), topic, changes, definition=definition), name)

    changed()
