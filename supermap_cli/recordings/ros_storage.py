"""ROS 1 `.bag` and ROS 2 `.db3` recordings, read by `rosbags`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import apsw
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1 import ReaderError as Ros1ReaderError
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import ReaderError as Ros2ReaderError

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.storage import Channel, RawMessage

_ROS2_FORMATS = {
    MessageDefinitionFormat.NONE: "",
    MessageDefinitionFormat.MSG: "ros2msg",
    MessageDefinitionFormat.IDL: "ros2idl",
}


def _channels(connections: Iterable[Connection], ros1: bool) -> dict[int, Channel]:
    """A channel for each connection id; several publishers of one topic share one channel."""
    grouped: dict[tuple[str, str], list[Connection]] = {}
    for connection in connections:
        grouped.setdefault((connection.topic, connection.msgtype), []).append(connection)
    channels = {}
    for (topic, msgtype), group in sorted(grouped.items()):
        definition = group[0].msgdef
        form = "ros1msg" if ros1 else _ROS2_FORMATS[definition.format]
        count = sum(connection.msgcount for connection in group)
        serialization = "ros1" if ros1 else "cdr"
        channel = Channel(topic, msgtype, serialization, definition.data.encode(), form, count)
        channels.update({connection.id: channel for connection in group})
    return channels


class Ros1Storage:
    """A ROS 1 bag; each stream opens the file anew, so that streams do not evict one another's chunk."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._open() as reader:
            self._by_id = _channels(reader.connections, ros1=True)
            self.start_ns = reader.start_time
            self.end_ns = reader.end_time - 1
        self.channels = tuple(dict.fromkeys(self._by_id.values()))

    @contextmanager
    def _open(self) -> Iterator[Ros1Reader]:
        reader = Ros1Reader(self._path)
        try:
            reader.open()
        except (Ros1ReaderError, AssertionError, ValueError) as error:
            raise RecordingError(
                f"the bag cannot be read: {error}", where=str(self._path), cure="try `rosbag reindex`, or record again"
            ) from error
        try:
            yield reader
        finally:
            reader.close()

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        with self._open() as reader:
            wanted = [connection for connection in reader.connections if connection.topic in topics]
            if not wanted:
                return
            try:
                for connection, log_ns, data in reader.messages(wanted, start_ns, end_ns):
                    yield RawMessage(self._by_id[connection.id], log_ns, data)
            except Ros1ReaderError as error:
                raise RecordingError(
                    f"the bag is damaged: {error}", where=str(self._path), cure="try `rosbag reindex`"
                ) from error

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        with self._open() as reader:
            for connection in reader.connections:
                if connection.topic in topics:
                    for entry in reader.indexes[connection.id]:
                        if (start_ns is None or entry.time >= start_ns) and (end_ns is None or entry.time < end_ns):
                            yield connection.topic, entry.time


class Ros2Storage:
    """A ROS 2 SQLite recording: one `.db3` file, or a rosbag2 folder with its metadata.yaml."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._reader = Ros2Reader(path)
            self._reader.open()
        except (Ros2ReaderError, FileNotFoundError, KeyError, ValueError) as error:
            raise RecordingError(
                f"the recording cannot be read: {error}",
                where=str(path),
                cure="check that it was closed properly (`ros2 bag reindex` mends metadata.yaml)",
            ) from error
        self._by_id = _channels(self._reader.connections, ros1=False)
        self.channels = tuple(dict.fromkeys(self._by_id.values()))
        self.start_ns, self.end_ns = self._reader.start_time, self._reader.end_time - 1

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        wanted = [connection for connection in self._reader.connections if connection.topic in topics]
        if not wanted:
            return
        try:
            for connection, log_ns, data in self._reader.messages(wanted, start_ns, end_ns):
                yield RawMessage(self._by_id[connection.id], log_ns, data)
        except (Ros2ReaderError, apsw.Error) as error:
            raise RecordingError(
                f"the recording is damaged: {error}", where=str(self._path), cure="record or copy it again"
            ) from error

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        for raw in self.messages(topics, start_ns, end_ns):
            yield raw.channel.topic, raw.log_ns
