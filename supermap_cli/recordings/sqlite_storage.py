"""ROS 2 `.db3` recordings: SQLite files with the tables `topics` and `messages` (rosbag2_storage_sqlite3).

They are opened without ever being written to. What a recorder left in a `-wal` file beside it counts; of a file that is
cut off or damaged every row that SQLite still finds is read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

import apsw

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, LeftOut, RawMessage, full_type_name
from supermap_cli.recordings.unpacking import unpacked_message

_LARGEST_GAP = 1 << 40
"""Message ids that are tried beyond the last readable row of a damaged table, in steps that double."""

_MOST_GAPS = 10_000
"""Damaged places of a table beyond which no further ones are looked for."""

_ROWS = "SELECT id, topic_id, timestamp FROM messages NOT INDEXED WHERE id {} ORDER BY id"

_CELL_BYTES = 1 << 30
"""The largest value that SQLite is asked for (its own default limit is 1e9 bytes)."""


class SqliteStorage:
    """One SQLite recording; each stream has a connection of its own. Raises `RecordingError` where it is none."""

    def __init__(self, path: Path, notes: Notes, limits: Limits) -> None:
        self._path = path
        self._limits = limits
        self._left_out = LeftOut(notes, str(path))
        self._salvaged: list[tuple[int, int, int]] | None = None
        with self._open() as connection:
            topics, definitions = self._tables(connection)
            try:
                counts, span = _counts(connection)
            except apsw.Error as error:
                self._salvaged = _salvage(connection)
                counts, span = _of_rows(self._salvaged)
                if counts:
                    total = sum(counts.values())
                    notes.note(
                        f"damaged {path}",
                        f"{path}: the file is damaged or cut off ({error}); {total} messages are read",
                    )
        if not counts:
            raise RecordingError("no messages in the recording", where=str(path), cure="record or copy it again")
        self._by_id = _channels(topics, definitions, counts)
        self.channels = tuple(sorted(dict.fromkeys(self._by_id.values()), key=lambda each: (each.topic, each.msgtype)))
        self.start_ns, self.end_ns = span

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """See `Storage.messages`."""
        wanted = {number: channel for number, channel in self._by_id.items() if channel.topic in topics}
        if not wanted:
            return
        first = self.start_ns if start_ns is None else start_ns
        beyond = self.end_ns + 1 if end_ns is None else end_ns
        last: tuple[int, int] | None = None
        with self._open() as connection:
            if self._salvaged is None:
                try:
                    for number, log_ns, data, row in _select(connection, wanted, first, beyond):
                        last = (log_ns, row)
                        if (raw := self._message(wanted[number], log_ns, data, row)) is not None:
                            yield raw
                except apsw.Error:
                    self._salvaged = _salvage(connection)
                else:
                    return
            yield from self._one_by_one(connection, wanted, first, beyond, last)

    def _one_by_one(
        self,
        connection: apsw.Connection,
        wanted: dict[int, Channel],
        first: int,
        beyond: int,
        last: tuple[int, int] | None,
    ) -> Iterator[RawMessage]:
        """The messages of a damaged file in the order of (log time, row), those after `last`."""
        for log_ns, row, number in self._salvaged or ():
            if number not in wanted or not first <= log_ns < beyond or (last is not None and (log_ns, row) <= last):
                continue
            try:
                found = connection.execute("SELECT data FROM messages WHERE id = ?", (row,)).fetchone()
            except apsw.Error as error:
                topic = wanted[number].topic
                self._left_out.add("messages", f"a message of {topic} is in a damaged part ({error})", row)
                continue
            if found and (raw := self._message(wanted[number], log_ns, found[0], row)) is not None:
                yield raw

    def _message(self, channel: Channel, log_ns: int, data: object, row: int) -> RawMessage | None:
        """A message, unpacked; `None` (with a note) where it cannot be, or is none."""
        if not isinstance(data, bytes):
            self._left_out.add("messages", f"a message of {channel.topic} has no bytes", row)
            return None
        try:
            return RawMessage(channel, log_ns, unpacked_message(data, self._limits))
        except ValueError as error:
            self._left_out.add("messages", f"a message of {channel.topic} cannot be unpacked ({error})", row)
            return None

    def log_times(
        self, topics: Collection[str], start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, int]]:
        """See `Storage.log_times`."""
        for message in self.messages(topics, start_ns, end_ns):
            yield message.channel.topic, message.log_ns

    @contextmanager
    def _open(self) -> Iterator[apsw.Connection]:
        """A connection that never writes, not even when it is closed; with what a `-wal` file beside it holds."""
        wal = self._path.with_name(f"{self._path.name}-wal")
        how = "vfs=unix-none" if wal.is_file() and wal.stat().st_size else "immutable=1"
        try:
            connection = apsw.Connection(
                f"file:{quote(str(self._path.absolute()))}?mode=ro&{how}",
                flags=apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI,
            )
            connection.config(apsw.SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1)
            connection.config(apsw.SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0)
            connection.limit(apsw.SQLITE_LIMIT_LENGTH, _CELL_BYTES)
            for pragma in ("locking_mode = EXCLUSIVE", "writable_schema = ON", "cell_size_check = ON"):
                connection.execute(f"PRAGMA {pragma}").fetchall()
        except apsw.Error as error:
            raise self._unreadable(error) from error
        try:
            yield connection
        finally:
            connection.close()

    def _unreadable(self, error: Exception) -> RecordingError:
        return RecordingError(
            f"the recording cannot be read: {error}",
            where=str(self._path),
            cure="record or copy it again; `sqlite3 FILE .recover` saves what is left of a damaged one",
        )

    def _tables(
        self, connection: apsw.Connection
    ) -> tuple[dict[int, tuple[str, str, str]], dict[str, tuple[str, bytes]]]:
        """Topics by id: (name, type, serialization); definitions by type: (format, text)."""
        try:
            tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if not {"messages", "topics"} <= tables:
                raise RecordingError(
                    "an SQLite file that is no ROS 2 recording (no tables `topics` and `messages`)",
                    where=str(self._path),
                    cure="give the .db3 file of a recording; a map is read by `supermap show --db`",
                )
            topics = {
                number: (_text(name), full_type_name(_text(msgtype)), _text(serialization))
                for number, name, msgtype, serialization in connection.execute(
                    f"SELECT id, {_bytes_of('name', 'type', 'serialization_format')} FROM topics"  # noqa: S608
                )
            }
            definitions = {}
            if "message_definitions" in tables:
                for name, form, text in connection.execute(
                    f"SELECT {_bytes_of('topic_type', 'encoding', 'encoded_message_definition')} "  # noqa: S608
                    "FROM message_definitions"
                ):
                    definitions[full_type_name(_text(name))] = (_text(form), _text(text).encode())
        except apsw.Error as error:
            raise self._unreadable(error) from error
        return topics, definitions


def _bytes_of(*columns: str) -> str:
    """Columns of text as they are stored: apsw refuses damaged UTF-8."""
    return ", ".join(f"CAST({column} AS BLOB)" for column in columns)


def _text(stored: object) -> str:
    """A stored text; what is no UTF-8 in it is replaced."""
    return stored.decode(errors="replace") if isinstance(stored, bytes) else ""


def _select(
    connection: apsw.Connection, wanted: Collection[int], first: int, beyond: int
) -> Iterator[tuple[int, int, object, int]]:
    """(topic id, log time, data, row) of messages, in the order of log time and row."""
    marks = ",".join("?" for _ in wanted)
    query = (
        f"SELECT topic_id, timestamp, data, id FROM messages WHERE topic_id IN ({marks}) "  # noqa: S608 - only marks
        "AND timestamp >= ? AND timestamp < ? ORDER BY timestamp, id"
    )
    yield from connection.execute(query, (*wanted, _int64(first), _int64(beyond)))


def _int64(value: int) -> int:
    return max(min(value, 2**63 - 1), -(2**63))


def _counts(connection: apsw.Connection) -> tuple[Counter[int], tuple[int, int]]:
    """Messages of each topic id, and the first and last log time. Raises `apsw.Error` where the table is damaged."""
    counts: Counter[int] = Counter()
    times: list[int] = []
    for number, count, first, last in connection.execute(
        "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages NOT INDEXED "
        "WHERE typeof(timestamp) = 'integer' AND typeof(topic_id) = 'integer' GROUP BY topic_id"
    ):
        counts[number] = count
        times += [first, last]
    return counts, (min(times, default=0), max(times, default=0))


def _of_rows(rows: list[tuple[int, int, int]]) -> tuple[Counter[int], tuple[int, int]]:
    counts = Counter(number for _, _, number in rows)
    return counts, ((rows[0][0], rows[-1][0]) if rows else (0, 0))


def _salvage(connection: apsw.Connection) -> list[tuple[int, int, int]]:
    """(log time, row, topic id) of every row of a damaged table that can be found, by log time.

    A damaged page ends a scan; the next readable row is looked for beyond it, in steps that double.
    """
    rows: list[tuple[int, int, int]] = []
    next_row, step = 0, 1
    for _ in range(_MOST_GAPS):
        try:
            for row, number, log_ns in connection.execute(_ROWS.format(">= ?"), (next_row,)):
                if row < next_row:
                    break
                next_row, step = row + 1, 1
                if isinstance(number, int) and isinstance(log_ns, int):
                    rows.append((log_ns, row, number))
            else:
                break
        except apsw.Error:
            pass
        next_row, step = next_row + step, step * 2
        if step > _LARGEST_GAP:
            break
    rows.sort()
    return rows


def _channels(
    topics: dict[int, tuple[str, str, str]], definitions: dict[str, tuple[str, bytes]], counts: Counter[int]
) -> dict[int, Channel]:
    totals: Counter[tuple[str, str]] = Counter()
    for number, (topic, msgtype, _) in topics.items():
        totals[topic, msgtype] += counts[number]
    channels = {}
    for number, (topic, msgtype, serialization) in topics.items():
        form, text = definitions.get(msgtype, ("", b""))
        channels[number] = Channel(topic, msgtype, serialization, text, form, totals[topic, msgtype])
    return channels
