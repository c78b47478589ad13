"""Recordings as stores of raw messages: what every container format offers, and several files read as one."""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from supermap_cli.recordings.notes import Notes


@dataclass(frozen=True)
class Channel:
    """One topic of one message type.

    `msgtype` is "package/msg/Name" for ROS and "foxglove.Name" for Foxglove schemas; `serialization` is "cdr", "ros1",
    "json" or "protobuf"; `definition` is the schema as it was stored, its format "ros1msg", "ros2msg", "ros2idl",
    "jsonschema", "protobuf" or "" where there is none.
    """

    topic: str
    msgtype: str
    serialization: str
    definition: bytes
    definition_format: str
    count: int


@dataclass(frozen=True)
class RawMessage:
    """One message as stored; `log_ns` is when it was recorded."""

    channel: Channel
    log_ns: int
    data: bytes | memoryview


def full_type_name(name: str) -> str:
    """sensor_msgs/Image, as ROS 1 and some writers of ROS 2 have it -> sensor_msgs/msg/Image."""
    return re.sub(r"^([\w.]+)/(\w+)$", r"\1/msg/\2", name)


class LeftOut:
    """Counts what is left out of a container, and keeps one note on each sort of it that names the first.

    What stands at one `place` counts once, however often it is read.
    """

    def __init__(self, notes: Notes, where: str) -> None:
        self._notes = notes
        self._where = where
        self._places: dict[str, set[int]] = {}
        self._first: dict[str, str] = {}

    @property
    def reason(self) -> str:
        """Why the first was left out, to end an error's sentence; "" where nothing was."""
        return next((f" that can be read: {why}" for why in self._first.values()), "")

    def add(self, what: str, why: str, place: int) -> None:
        """One more of `what` ("chunks"), and why it is left out."""
        places = self._places.setdefault(what, set())
        places.add(place)
        first = self._first.setdefault(what, why)
        self._notes.note(f"left out {self._where} {what}", f"{self._where}: {first}; {len(places)} {what} left out")


class Storage(Protocol):
    """An opened container."""

    @property
    def channels(self) -> Sequence[Channel]:
        """What is in it, ordered by topic."""
        ...

    @property
    def start_ns(self) -> int:
        """Log time of the first message."""
        ...

    @property
    def end_ns(self) -> int:
        """Log time of the last message."""
        ...

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Messages of the topics with start_ns <= log time < end_ns, in the order of log time.

        Every call reads anew and independently of all others, a chunk at a time.
        """
        ...

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """(topic, log time) of the same messages, a topic's in order; by the index alone where there is one."""
        ...


def merge_lazily(
    parts: Iterable[tuple[int, Callable[[], Iterable[RawMessage]]]],
) -> Iterator[RawMessage]:
    """Merge ordered parts by log time, opening each only when its start time is reached (parts may overlap)."""
    waiting = sorted(((start, index, part) for index, (start, part) in enumerate(parts)), reverse=True)
    heads: list[tuple[int, int, RawMessage, Iterator[RawMessage]]] = []
    while waiting or heads:
        while waiting and (not heads or waiting[-1][0] <= heads[0][0]):
            _, index, part = waiting.pop()
            stream = iter(part())
            if (first := next(stream, None)) is not None:
                heapq.heappush(heads, (first.log_ns, index, first, stream))
        if not heads:
            continue
        _, index, message, stream = heads[0]
        yield message
        if (following := next(stream, None)) is None:
            heapq.heappop(heads)
        else:
            heapq.heapreplace(heads, (following.log_ns, index, following, stream))


class SplitStorage:
    """A recording split over several files, read as one."""

    def __init__(self, parts: Sequence[Storage]) -> None:
        self._parts = [part for part in parts if part.channels] or list(parts[:1])
        merged: dict[tuple[str, str], Channel] = {}
        for channel in (channel for part in self._parts for channel in part.channels):
            key = (channel.topic, channel.msgtype)
            known = merged.get(key)
            merged[key] = channel if known is None else replace(known, count=known.count + channel.count)
        self.channels = tuple(merged[key] for key in sorted(merged))
        self.start_ns = min(part.start_ns for part in self._parts)
        self.end_ns = max(part.end_ns for part in self._parts)

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""

        def reader(part: Storage) -> Callable[[], Iterator[RawMessage]]:
            return lambda: part.messages(topics, start_ns, end_ns)

        return merge_lazily((part.start_ns, reader(part)) for part in self._within(start_ns, end_ns))

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        for part in sorted(self._within(start_ns, end_ns), key=lambda part: part.start_ns):
            yield from part.log_times(topics, start_ns, end_ns)

    def _within(self, start_ns: int | None, end_ns: int | None) -> list[Storage]:
        return [
            part
            for part in self._parts
            if (start_ns is None or part.end_ns >= start_ns) and (end_ns is None or part.start_ns < end_ns)
        ]
