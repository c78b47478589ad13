"""Recordings in which messages have the time 0: those that `--use-sim-time` recorded before the first /clock."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import RawMessage, Storage


class FromFirstRealTime:
    """A storage whose messages of time 0 count as recorded at the first real time, before all others.

    `first_ns` is that time; the storage beneath keeps the zeros.
    """

    def __init__(self, storage: Storage, first_ns: int) -> None:
        self._storage = storage
        self.channels = storage.channels
        self.start_ns = first_ns
        self.end_ns = storage.end_ns

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        if self._from_start(start_ns, end_ns):
            for raw in self._storage.messages(topics, 0, 1):
                yield replace(raw, log_ns=self.start_ns)
        yield from self._storage.messages(topics, max(start_ns or 0, 1), end_ns)

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        if self._from_start(start_ns, end_ns):
            yield from ((topic, self.start_ns) for topic, _ in self._storage.log_times(topics, 0, 1))
        yield from self._storage.log_times(topics, max(start_ns or 0, 1), end_ns)

    def _from_start(self, start_ns: int | None, end_ns: int | None) -> bool:
        return (start_ns is None or start_ns <= self.start_ns) and (end_ns is None or end_ns > self.start_ns)


def from_first_real_time(storage: Storage, where: str, notes: Notes) -> Storage:
    """The storage, without zeros in its times if there are others (noted)."""
    if storage.start_ns != 0 or storage.end_ns <= 0:
        return storage
    topics = [channel.topic for channel in storage.channels]
    count = sum(1 for _ in storage.log_times(topics, 0, 1))
    first_ns = min((time for _, time in storage.log_times(topics, 1, None)), default=0)
    if not first_ns:
        return storage
    notes.note(
        "zero times",
        f"{where}: {count} messages were recorded at time 0, before the first /clock of a simulation; they count as "
        "recorded at the first real time",
    )
    return FromFirstRealTime(storage, first_ns)
