"""Reads the rows of an SQLite file whose header, schema or pages are damaged, page by page.

The format is that of https://www.sqlite.org/fileformat2.html: sections 1.3 (header), 1.6 (b-tree pages, overflow),
1.5 (freelist) and 2.1 (records). All numbers are big-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MAGIC = b"SQLite format 3\x00"
_HEADER_BYTES = 100
_SIZES = tuple(1 << power for power in range(9, 17))
"""Bytes a page may have; 65536 is stored as 1."""
_INTERIOR, _LEAF = 0x05, 0x0D
_TYPES = frozenset({0x02, _INTERIOR, 0x0A, _LEAF})
"""First bytes of the pages of b-trees."""
_FRACTIONS = b"\x40\x20\x20"
_WAL, _ROLLBACK = 2, 1
_DEPTH = 40
"""Levels of a b-tree; four-byte page numbers fill no more than 32 of two children each."""
_REALS = 7
_INTEGER_BYTES = (0, 1, 2, 3, 4, 6, 8)

Cell = tuple[int, list[Any]]
"""A row id and the values of its record."""


def header_fault(path: Path) -> str | None:
    """In words what is wrong with the header of a file; `None` for a sound one."""
    length = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    if len(head) < _HEADER_BYTES:
        return f"the file ends after {length} bytes"
    if not head.startswith(MAGIC):
        return "its first 16 bytes are not those of an SQLite file"
    size, pages = _size_of(head), _number(head, 28)
    if size not in _SIZES or head[21:24] != _FRACTIONS or _number(head, 56) != 1 or not 1 <= _number(head, 44) <= 4:
        return "its header holds values that are none"
    if pages * size != length:
        return f"its header says {pages} pages of {size} bytes, and the file has {length} bytes ({length / size:.1f})"
    return None


def mend_header(path: Path, *, has_log: bool) -> None:
    """Give a file the header that its pages say. The log (-wal) has a newer number of pages than the file."""
    fault = header_fault(path)
    if fault is None or (has_log and "pages of" in fault):
        return
    content = path.read_bytes()
    size = _likely_size(content)
    count = max(1, -(-len(content) // size))
    head = bytearray(content[:_HEADER_BYTES].ljust(_HEADER_BYTES, b"\0"))
    head[:16] = MAGIC
    head[16:24] = struct.pack(">HBBB", size & 0xFFFF or 1, *[_WAL if has_log else _ROLLBACK] * 2, 0) + _FRACTIONS
    head[24:48] = struct.pack(">6I", 1, count, 0, 0, 1, 4)  # no freelist: whatever is on it is not trusted
    head[52:60] = struct.pack(">2I", 0, 1)  # no pointer map is needed for reading; UTF-8
    head[64:68] = bytes(4)
    head[92:96] = struct.pack(">I", 1)
    with path.open("r+b") as file:
        file.write(head)
        file.truncate(count * size)


def _size_of(head: bytes) -> int:
    (stored,) = struct.unpack_from(">H", head, 16)
    return 65536 if stored == 1 else int(stored)


def _likely_size(content: bytes) -> int:
    """The size of a page for which most pages, and the most, begin as pages do."""

    def score(size: int) -> float:
        starts = content[0::size][1:]
        found = sum(start in _TYPES for start in starts)
        return found * found / max(len(starts), 1)

    stored = _size_of(content[:_HEADER_BYTES].ljust(_HEADER_BYTES, b"\0"))
    best = max(_SIZES, key=score)
    return stored if stored in _SIZES and score(stored) >= score(best) else best


class PageFile:
    """The pages of a file; whatever they hold, reading them ends."""

    def __init__(self, path: Path) -> None:
        """Reads all of the file. Its header must be sound (`mend_header`)."""
        self._content = path.read_bytes()
        self._size = _size_of(self._content)
        self._usable = self._size - self._content[20]
        self._count = len(self._content) // self._size
        self._visited = self._free_pages()
        self._roots: dict[str, int] = {}
        for cell in self.tree(1):
            if cell is not None and len(cell[1]) == 5 and cell[1][0] == "table" and isinstance(cell[1][3], int):
                self._roots[str(cell[1][1])] = cell[1][3]

    def table(self, name: str) -> Iterator[Cell | None]:
        """The rows that lie in the tree of a table, `None` for one that cannot be read."""
        if name in self._roots:
            yield from self.tree(self._roots[name])

    def strays(self) -> Iterator[Cell]:
        """The rows of pages that no tree that was read, and no table of the schema, leads to."""
        for name in self._roots:
            for _ in self.table(name):
                pass
        for number in range(2, self._count + 1):
            if number not in self._visited and self._page(number)[0] == _LEAF:
                yield from (cell for cell in self._cells(self._page(number), 0) if cell is not None)

    def tree(self, root: int) -> Iterator[Cell | None]:
        """The rows of the b-tree with a root."""
        waiting, seen = [(root, 0)], set()
        while waiting:
            number, depth = waiting.pop()
            if not 1 <= number <= self._count or number in seen or depth > _DEPTH:
                yield None
                continue
            seen.add(number)
            page, start = self._page(number), _HEADER_BYTES if number == 1 else 0
            if page[start] == _LEAF:
                self._visited.add(number)
                yield from self._cells(page, start)
            elif page[start] == _INTERIOR:
                self._visited.add(number)
                waiting += [(child, depth + 1) for child in reversed(self._children(page, start))]
            else:
                yield None

    def _free_pages(self) -> set[int]:
        free: set[int] = set()
        trunk = _number(self._content, 32)
        while 1 < trunk <= self._count and trunk not in free:
            free.add(trunk)
            page = self._page(trunk)
            leaves = min(_number(page, 4), self._size // 4 - 2)
            free.update(struct.unpack_from(f">{leaves}I", page, 8))
            trunk = _number(page, 0)
        return free

    def _page(self, number: int) -> bytes:
        return self._content[(number - 1) * self._size : number * self._size]

    def _pointers(self, page: bytes, start: int, header: int) -> tuple[int, ...]:
        (count,) = struct.unpack_from(">H", page, start + 3)
        count = min(count, (len(page) - start - header) // 2)
        return struct.unpack_from(f">{count}H", page, start + header)

    def _children(self, page: bytes, start: int) -> list[int]:
        inner = [_number(page, at) for at in self._pointers(page, start, 12) if at <= len(page) - 4]
        return [*inner, _number(page, start + 8)]

    def _cells(self, page: bytes, start: int) -> Iterator[Cell | None]:
        for at in self._pointers(page, start, 8):
            try:
                length, begin = _varint(page, at)
                row_id, begin = _varint(page, begin)
                yield (row_id - (1 << 64) if row_id >> 63 else row_id), _values(self._payload(page, begin, length))
            except (IndexError, struct.error, ValueError):
                yield None

    def _payload(self, page: bytes, begin: int, length: int) -> bytes:
        """A payload with what lies on overflow pages. Raises `ValueError` if it is not all there."""
        if length > len(self._content):
            raise ValueError("longer than the file")
        greatest, least = self._usable - 35, (self._usable - 12) * 32 // 255 - 23
        local = length
        if length > greatest:
            local = least + (length - least) % (self._usable - 4)
            local = local if local <= greatest else least
        parts, left = [page[begin : begin + local]], length - local
        number = _number(page, begin + local) if left else 0
        while left > 0:
            if not 1 < number <= self._count:
                raise ValueError("overflow beyond the file")
            overflow = self._page(number)
            parts.append(overflow[4 : 4 + min(left, self._usable - 4)])
            left -= self._usable - 4
            number = _number(overflow, 0)
        payload = b"".join(parts)
        if len(payload) != length:
            raise ValueError("cut off")
        return payload


def _number(content: bytes, at: int) -> int:
    return int(struct.unpack_from(">I", content, at)[0])


def _varint(content: bytes, at: int) -> tuple[int, int]:
    """A number of one to nine bytes, and where it ends."""
    value = 0
    for byte in range(8):
        value = value << 7 | content[at + byte] & 0x7F
        if content[at + byte] < 0x80:
            return value, at + byte + 1
    return value << 8 | content[at + 8], at + 9


def _values(payload: bytes) -> list[Any]:
    """The values of a record: text that is no UTF-8 has U+FFFD. Raises for one that is none."""
    at_value, at = _varint(payload, 0)
    kinds, end = [], at_value
    while at < end:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    values: list[Any] = []
    for kind in kinds:
        value, at_value = _value(payload, at_value, kind)
        values.append(value)
    if at_value != len(payload) or at != end:
        raise ValueError("no record")
    return values


def _value(payload: bytes, at: int, kind: int) -> tuple[Any, int]:
    if kind == 0:
        return None, at
    if kind in {8, 9}:  # the integers 0 and 1
        return kind - 8, at
    if kind == _REALS:
        return struct.unpack_from(">d", payload, at)[0], at + 8
    if kind < _REALS:
        length = _INTEGER_BYTES[kind]
        return int.from_bytes(payload[at : at + length], "big", signed=True), at + length
    if kind < 12:
        raise ValueError("no kind of value")
    length = (kind - 12) // 2
    content = payload[at : at + length]
    return (content if kind % 2 == 0 else content.decode("utf-8", "replace")), at + length
