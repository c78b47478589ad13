"""Column types that SQLite's STRICT tables accept and that keep 64 bits elsewhere."""

from __future__ import annotations

from sqlalchemy import REAL, BigInteger, Double, Integer, LargeBinary, Text
from sqlalchemy.types import TypeEngine

Int64 = BigInteger().with_variant(Integer(), "sqlite")
"""Row ids, counts and nanoseconds."""

Real: TypeEngine[float] = Double().with_variant(REAL(), "sqlite")
"""64-bit floating point."""

Label = Text().with_variant(Text(collation="C"), "postgresql")
"""Any text; it is sorted by its bytes, whatever the language of a server is."""

Json = Label
"""A JSON document as text, so that any tool shows it and the databases' JSON functions read it."""

Blob = LargeBinary()
"""Voxels, embeddings, images: the formats stand in `supermap_cli.memory.blobs`."""
