"""Packs values as bytes and back, exactly: the checkpoints that a stopped build resumes from.

**Format**: the four bytes ``SMC1``, then a zlib stream of a uint32 n (little-endian), n bytes of JSON (UTF-8), and the
bytes of the arrays that the JSON refers to, one after the other. JSON's own types are stored as they are; the others as

    {"array": [start, length], "dtype": "<f8", "shape": [3, 2], "order": "C"}   an array, or a scalar of numpy's
    {"bytes": [start, length]}
    {"tuple": [...]}, {"set": [...]}, {"dict": [[key, value], ...]}
    {"float": "inf"}                                                            what JSON has no number for
    {"is": "Course", "has": {"stamp_ns": ...}}                                  a dataclass, field by field

Only dataclasses of a given list are read, and no code of theirs runs: such bytes can do no harm.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

MAGIC = b"SMC1"
_LENGTH = struct.Struct("<I")
"""Length of the JSON part in bytes."""
_COMPRESSION_LEVEL = 1
"""zlib's fastest: checkpoints are written while a build waits."""

OmittedFields = Mapping[type, Collection[str]]
"""Packed dataclass -> its fields that are omitted; they have their default after unpacking."""


class PackingError(ValueError):
    """The bytes are no packed value, or speak of classes that are not expected."""


def pack(value: object, classes: OmittedFields, *, compressed: bool = True) -> bytes:
    """A value of plain types, numpy arrays and `classes` as bytes. Raises `TypeError` for any other."""
    packer = _Packer(classes)
    text = json.dumps(packer.packed(value), ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    content = b"".join((_LENGTH.pack(len(text)), text, *packer.chunks))
    return MAGIC + zlib.compress(content, _COMPRESSION_LEVEL if compressed else 0)


def unpack(blob: bytes, classes: OmittedFields) -> Any:
    """The value that was packed. Raises `PackingError` for anything else."""
    if not blob.startswith(MAGIC):
        raise PackingError("a packed value does not start with SMC1")
    try:
        content = zlib.decompress(blob[len(MAGIC) :])
        (length,) = _LENGTH.unpack_from(content)
        tree = json.loads(content[_LENGTH.size : _LENGTH.size + length])
        return _Unpacker(memoryview(content)[_LENGTH.size + length :], {cls.__name__: cls for cls in classes}).value(
            tree
        )
    except (zlib.error, struct.error, ValueError, KeyError, TypeError, AttributeError) as error:
        raise PackingError(f"a packed value is damaged: {error}") from error


@dataclass
class _Packer:
    classes: OmittedFields
    chunks: list[bytes] = field(default_factory=list)
    _end: int = 0

    def packed(self, value: object) -> object:
        if value is None or type(value) in {bool, int, str} or (type(value) is float and math.isfinite(value)):
            return value
        return [self.packed(item) for item in value] if isinstance(value, list) else self._tagged(value)

    def _tagged(self, value: object) -> dict[str, object]:
        match value:
            case np.ndarray() | np.generic():
                tagged = self._array(value)
            case float():
                tagged = {"float": repr(value)}
            case bytes():
                tagged = {"bytes": self._chunk(value)}
            case tuple():
                tagged = {"tuple": [self.packed(item) for item in value]}
            case set() | frozenset():
                tagged = {"set": [self.packed(item) for item in value]}
            case Mapping():
                tagged = {"dict": [[self.packed(key), self.packed(item)] for key, item in value.items()]}
            case _:
                tagged = self._instance(value)
        return tagged

    def _instance(self, value: object) -> dict[str, object]:
        omitted = self.classes.get(type(value))
        if omitted is None:
            raise TypeError(f"a {type(value).__qualname__} cannot be packed")
        names = [attribute.name for attribute in fields(value) if attribute.name not in omitted]  # type: ignore[arg-type]
        return {"is": type(value).__name__, "has": {name: self.packed(getattr(value, name)) for name in names}}

    def _array(self, value: np.ndarray[Any, Any] | np.generic) -> dict[str, object]:
        """The order of the numbers in memory is kept, too: sums over them are the same to the last bit."""
        array = np.asarray(value)
        if array.dtype.hasobject:
            raise TypeError("an array of objects cannot be packed")
        order = "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
        packed: dict[str, object] = {
            "array": self._chunk(array.tobytes(order)),  # type: ignore[arg-type]
            "dtype": array.dtype.newbyteorder("<").str,
            "shape": None if isinstance(value, np.generic) else list(array.shape),
        }
        return packed if order == "C" else {**packed, "order": order}

    def _chunk(self, content: bytes) -> list[int]:
        self.chunks.append(content)
        self._end += len(content)
        return [self._end - len(content), len(content)]


@dataclass(frozen=True)
class _Unpacker:
    chunks: memoryview
    classes: Mapping[str, type]

    def value(self, tree: Any) -> Any:
        if isinstance(tree, list):
            return [self.value(item) for item in tree]
        return self._tagged(tree) if isinstance(tree, dict) else tree

    def _tagged(self, tree: dict[str, Any]) -> Any:
        value: Any
        match tree:
            case {"array": span, "dtype": dtype, "shape": shape}:
                value = self._array(np.frombuffer(self._chunk(span), np.dtype(dtype)), shape, tree.get("order", "C"))
            case {"is": name, "has": values}:
                value = self._instance(self.classes[name], values)
            case {"float": text}:
                value = float(text)
            case {"bytes": span}:
                value = bytes(self._chunk(span))
            case {"tuple": items}:
                value = tuple(self.value(item) for item in items)
            case {"set": items}:
                value = {self.value(item) for item in items}
            case {"dict": pairs}:
                value = {self.value(key): self.value(item) for key, item in pairs}
            case _:
                raise PackingError(f"a packed value is not understood: {sorted(tree)}")
        return value

    @staticmethod
    def _array(flat: np.ndarray[Any, Any], shape: list[int] | None, order: Literal["C", "F"]) -> Any:
        return flat[0] if shape is None else flat.reshape(shape, order=order).copy(order="K")

    def _chunk(self, span: list[int]) -> memoryview:
        start, length = span
        if start < 0 or length < 0 or start + length > len(self.chunks):
            raise PackingError("a packed value ends before its arrays do")
        return self.chunks[start : start + length]

    def _instance(self, kind: type, values: dict[str, Any]) -> Any:
        instance: Any = object.__new__(kind)
        for attribute in fields(kind):
            if attribute.name in values:
                value = self.value(values[attribute.name])
            elif callable(attribute.default_factory):
                value = attribute.default_factory()
            else:
                value = attribute.default
            object.__setattr__(instance, attribute.name, value)
        return instance
