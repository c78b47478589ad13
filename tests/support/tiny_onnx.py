"""Writes ONNX models that answer every image with the same tensors: the protobuf encoding by hand, without `onnx`.

Field numbers are those of onnx/onnx.proto.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_FLOAT = 1
_INT64 = 7


def write_constant_model(
    path: Path,
    outputs: Sequence[NDArray[np.float32]],
    input_size: tuple[int, int],
    metadata: Mapping[str, str] | None = None,
    names: Sequence[str] | None = None,
    input_name: str = "images",
) -> Path:
    """A model with the input `images` [1, 3, h, w] and the given outputs, whatever the image; `names` are theirs."""
    names = names or [f"output{i}" for i in range(len(outputs))]
    graph = _text(2, "constant") + _bytes(11, _value(input_name, (1, 3, *input_size)))
    for i, tensor in enumerate(outputs):
        graph += _bytes(5, _tensor(f"constant{i}", tensor))
        graph += _bytes(1, _text(1, f"constant{i}") + _text(2, names[i]) + _text(4, "Identity"))
        graph += _bytes(12, _value(names[i], tensor.shape))
    model = _number(1, 8) + _bytes(7, graph) + _bytes(8, _text(1, "") + _number(2, 13))
    for key, value in (metadata or {}).items():
        model += _bytes(14, _text(1, key) + _text(2, value))
    path.write_bytes(model)
    return path


def write_token_vectors(path: Path, vectors: NDArray[np.float32]) -> Path:
    """A model of `input_ids` and `attention_mask` [texts, tokens] that gives each token its row of `vectors`, as BERT's
    last hidden state: [texts, tokens, columns].
    """
    ids = [_value(name, ("texts", "tokens"), _INT64) for name in ("input_ids", "attention_mask")]
    gather = _text(1, "vectors") + _text(1, "input_ids") + _text(2, "last_hidden_state") + _text(4, "Gather")
    graph = _bytes(1, gather) + _text(2, "embedding") + _bytes(5, _tensor("vectors", vectors))
    graph += b"".join(_bytes(11, value) for value in ids)
    graph += _bytes(12, _value("last_hidden_state", ("texts", "tokens", vectors.shape[1])))
    path.write_bytes(_number(1, 8) + _bytes(7, graph) + _bytes(8, _text(1, "") + _number(2, 13)))
    return path


def _tensor(name: str, tensor: NDArray[np.float32]) -> bytes:
    dims = b"".join(_number(1, side) for side in tensor.shape)
    return dims + _number(2, _FLOAT) + _text(8, name) + _bytes(9, tensor.astype("<f4").tobytes())


def _value(name: str, shape: Sequence[int | str], kind: int = _FLOAT) -> bytes:
    dims = b"".join(_bytes(1, _text(2, side) if isinstance(side, str) else _number(1, side)) for side in shape)
    return _text(1, name) + _bytes(2, _bytes(1, _number(1, kind) + _bytes(2, dims)))


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, payload: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(payload)) + payload


def _text(field: int, text: str) -> bytes:
    return _bytes(field, text.encode())


def _varint(value: int) -> bytes:
    encoded = bytearray()
    while value >= 0x80:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(encoded) + bytes([value])
