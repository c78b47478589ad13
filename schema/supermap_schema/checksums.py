"""Checksums of what never changes once a traversal is complete: one for each traversal and table.

A row's hash is the BLAKE2b (128 bits) of its numbers (little-endian, 64 bits each) and texts, made distinct by the
table's name. A table's checksum is the sum of the hashes of its rows, modulo 2^128: it does not depend on their order,
and what pruning removes is taken off it, so that everything else stays covered. Equal rows have equal checksums in
SQLite and in PostgreSQL.

What a later traversal may change is not covered: labels, places and spans of instances and states, spatial edges, how
far a move went, and the counts and limits of a traversal. Their rows' identities are. Nor are a traversal's timings,
which alone differ between equal builds: these have equal checksums.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Any

from sqlalchemy import ColumnElement, Connection, Double, Select, column, insert, select, table

HASH_BYTES = 16
"""128 bits: that a change goes unnoticed has a probability of 2^-128 (BLAKE2, RFC 7693)."""
_MODULUS = 1 << (8 * HASH_BYTES)
_ROWS = 500
"""Rows read together."""
_CHECKSUM = table("checksum", *map(column, ("traversal_id", "table_name", "row_count", "digest")))


@dataclass(frozen=True)
class Sum:
    """The hashes of `rows` rows (and of their images), summed; sums are added and subtracted."""

    rows: int = 0
    value: int = 0

    def __add__(self, other: Sum) -> Sum:
        return Sum(self.rows + other.rows, (self.value + other.value) % _MODULUS)

    def __sub__(self, other: Sum) -> Sum:
        return Sum(self.rows - other.rows, (self.value - other.value) % _MODULUS)

    @property
    def digest(self) -> str:
        """32 hexadecimal digits."""
        return f"{self.value:0{2 * HASH_BYTES}x}"


@dataclass(frozen=True)
class Immutable:
    """The columns of a table that never change, by their types.

    `traversal` is the column that says whose row it is, where that is the row's own; `image` is one that pruning may
    empty, and has a hash of its own, together with the row's first integer.
    """

    name: str
    integers: tuple[str, ...]
    reals: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    image: str | None = None
    traversal: str | None = "traversal_id"

    @cached_property
    def _pack(self) -> Callable[..., bytes]:
        return struct.Struct(f"<{len(self.integers)}q{len(self.reals)}d").pack

    def hash_row(self, numbers: Sequence[Any], texts: Sequence[Any]) -> int:
        """The hash of a row's numbers (integers, then reals) and texts."""
        try:
            head = self._pack(*numbers)
        except struct.error:  # NULL, or what a damaged row holds instead of a number
            head = json.dumps([str(number) for number in numbers]).encode()
        return _hash(self.name, head, texts)

    def hash_image(self, row_id: Any, image: Any) -> int:
        """The hash of the image of a row."""
        return _hash(str(self.image), str(row_id).encode(), (image,))


IMMUTABLE_0004 = (
    Immutable(
        "traversal",
        ("id", "number", "start_ns", "end_ns", "clock_shift_ns"),
        texts=("name", "recording", "fingerprint", "T_map_odom", "config", "versions", "warnings"),
        traversal="id",
    ),
    Immutable(
        "keyframe",
        ("id", "traversal_id", "stamp_ns", "detected", "depth_step"),
        texts=("T_map_base", "T_map_camera", "camera", "depth_png", "camera_id"),
        image="thumbnail_jpeg",
    ),
    Immutable(
        "observation",
        ("id", "keyframe_id", "instance_number", "track_id", "evidence_for", "evidence_against"),
        ("score", "u_min", "v_min", "u_max", "v_max", "x", "y", "z"),
        ("label", "hypotheses"),
        image="crop_jpeg",
        traversal=None,
    ),
    Immutable("instance", ("number", "traversal_id"), texts=("id",)),
    Immutable("state", ("id", "instance_number", "state_index", "traversal_id")),
    Immutable(
        "visit",
        (
            *("traversal_id", "instance_number", "supported", "in_view", "contradicted"),
            *("first_support_ns", "last_support_ns"),
        ),
    ),
    Immutable(
        "temporal_edge",
        (
            *("id", "from_number", "from_state", "to_number", "to_state", "not_before_ns", "not_after_ns"),
            "traversal_id",
        ),
        ("probability",),
        ("kind",),
    ),
)
"""Those of schema version 4; observations belong to the traversal of their keyframe."""
IMMUTABLE = {each.name: each for each in IMMUTABLE_0004}
"""Those of the newest version, by the table's name."""


def sums(
    connection: Connection,
    immutable: Immutable,
    *conditions: ColumnElement[bool],
    only_image: bool = False,
) -> dict[int, Sum]:
    """The sums of a table by traversal id, of the rows that meet conditions on its columns (`sqlalchemy.column`).

    `only_image`: of their images alone, as what remains is not pruned.
    """
    owners = _owners(connection, conditions) if immutable.traversal is None else None
    values: dict[int, int] = {}
    counts: dict[int, int] = {}
    for traversal_id, row_hash in _hashes(connection, immutable, conditions, owners, only_image=only_image):
        values[traversal_id] = values.get(traversal_id, 0) + row_hash
        counts[traversal_id] = counts.get(traversal_id, 0) + (not only_image)
    return {traversal_id: Sum(counts[traversal_id], value % _MODULUS) for traversal_id, value in values.items()}


def sums_of(connection: Connection, traversal_ids: Collection[int], immutable: Immutable) -> dict[int, Sum]:
    """The sum of a table for each of some traversals."""
    if immutable.traversal is None:
        keyframe = table("keyframe", column("id"), column("traversal_id"))
        keyframes = select(keyframe.c.id).where(keyframe.c.traversal_id.in_(traversal_ids))
        found = sums(connection, immutable, column("keyframe_id").in_(keyframes))
    else:
        found = sums(connection, immutable, column(immutable.traversal).in_(traversal_ids))
    return {traversal_id: found.get(traversal_id, Sum()) for traversal_id in traversal_ids}


def store_sums(connection: Connection, traversal_ids: Collection[int]) -> None:
    """Store the checksums of traversals that have none yet."""
    for immutable in IMMUTABLE.values() if traversal_ids else ():
        rows = [
            {"traversal_id": traversal_id, "table_name": immutable.name, "row_count": each.rows, "digest": each.digest}
            for traversal_id, each in sums_of(connection, traversal_ids, immutable).items()
        ]
        connection.execute(insert(_CHECKSUM), rows)


def store_all_sums(connection: Connection) -> None:
    """Store the checksums of all complete traversals of a map that has none yet."""
    traversal = table("traversal", column("id"), column("status"))
    complete = select(traversal.c.id).where(traversal.c.status == "complete").order_by(traversal.c.id)
    store_sums(connection, connection.execute(complete).scalars().all())


def _hashes(
    connection: Connection,
    immutable: Immutable,
    conditions: Sequence[ColumnElement[bool]],
    owners: Mapping[int, int] | None,
    *,
    only_image: bool,
) -> Iterator[tuple[int, int]]:
    """The traversal of each row, and its hash with that of its image."""
    numbers = len(immutable.integers) + len(immutable.reals)
    columns: list[ColumnElement[Any]] = [
        *map(column, immutable.integers),
        *(column(name, Double) + 0.0 for name in immutable.reals),  # SQLite stores -0.0 as 0.0
        *map(column, immutable.texts),
    ]
    end = len(columns)
    image = immutable.image
    owner = immutable.integers.index(immutable.traversal or "keyframe_id")
    statement = select(*columns, *(() if image is None else (column(image),))).select_from(table(immutable.name))
    rows = connection.execute(statement.where(*conditions).execution_options(yield_per=_ROWS))
    for row in rows:
        traversal_id = row[owner] if owners is None else owners.get(row[owner])
        if traversal_id is None:  # points nowhere, which is a fault of its own
            continue
        row_hash = 0 if only_image else immutable.hash_row(row[:numbers], row[numbers:end])
        if image is not None and row[end] is not None:
            row_hash += immutable.hash_image(row[0], row[end])
        yield traversal_id, row_hash


def _owners(connection: Connection, conditions: Sequence[ColumnElement[bool]]) -> dict[int, int]:
    """The traversals of the keyframes of the observations that meet the conditions."""
    keyframe = table("keyframe", column("id"), column("traversal_id"))
    statement = select(keyframe.c.id, keyframe.c.traversal_id)
    if conditions:
        observed: Select[tuple[int]] = (
            select(column("keyframe_id")).select_from(table("observation")).where(*conditions)
        )
        statement = statement.where(keyframe.c.id.in_(observed))
    return {row[0]: row[1] for row in connection.execute(statement)}


def _hash(name: str, head: bytes, texts: Sequence[Any]) -> int:
    parts = [head]
    for text in texts:
        content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        parts += (b"-",) if content is None else (b"%d:" % len(content), content)
    digest = blake2b(b"".join(parts), digest_size=HASH_BYTES, person=name.encode())
    return int.from_bytes(digest.digest(), "little")
