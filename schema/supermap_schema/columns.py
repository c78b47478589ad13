"""Column types that SQLite's STRICT tables accept and that keep 64 bits elsewhere."""

from __future__ import annotations

from sqlalchemy import REAL, BigInteger, Double, Integer, LargeBinary, Text
from sqlalchemy.types import TypeEngine

Int64 = BigInteger().with_variant(Integer(), "sqlite")
"""Row ids, counts and nanoseconds."""

Real: TypeEngine[float] = Double().with_variant(REAL(), "sqlite")
"""64-bit floating point."""

Label = Text().with_variant(Text(collation="C"), "postgresql")
"""Any text; sorted by its bytes, independently of a server's locale."""

Json = Label
"""A JSON document as text, readable by any tool and by the databases' JSON functions."""

Blob = LargeBinary()
"""Voxels, embeddings and images; the formats are documented in `supermap_cli.memory.blobs`."""
