"""Model files are data: pickled formats are never loaded, and external data stays in the model's folder.

Field numbers are those of onnx/onnx.proto; the encoding is that of protocol buffers.
"""

from __future__ import annotations

import hashlib
import mmap
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

from supermap_cli.errors import SupermapError
from supermap_cli.input_files import check_readable

_OTHER_FORMATS = {
    ".pt": "PyTorch",
    ".pth": "PyTorch",
    ".ckpt": "PyTorch",
    ".bin": "PyTorch",
    ".pkl": "pickle",
    ".pickle": "pickle",
    ".joblib": "pickle",
    ".npy": "NumPy",
    ".npz": "NumPy",
    ".safetensors": "safetensors",
    ".gguf": "GGUF",
    ".h5": "Keras",
    ".keras": "Keras",
    ".pb": "TensorFlow",
    ".tflite": "TensorFlow Lite",
    ".engine": "TensorRT",
    ".plan": "TensorRT",
    ".mlmodel": "Core ML",
    ".torchscript": "TorchScript",
}
"""Suffixes of weights that are no ONNX model -> the format. Many of them run code when they are loaded."""

_ZIP = b"PK\x03\x04"
_PICKLE = (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
"""First bytes of what `torch.save` writes (a zip archive since 1.6), and of pickles of protocols 2 to 5."""

_CHILDREN = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "function": {7: "node", 11: "attribute"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "tensor": {13: "entry"},
}
"""Message -> field number -> the message in it, as far as tensors lie below."""

_DIGEST_CHARS = 8
"""Characters of a model's digest in its identity. Chosen: 32 bits tell a few thousand models apart."""


def check_model_file(path: Path, error_type: type[SupermapError], *, option: str) -> None:
    """Raise an error of the type unless `path` is a file that may be an ONNX model with all its data beside it.

    `option` is the option that named it, such as "onnx.model".
    """
    check_readable(path, error_type, what=f"an .onnx file with --option {option}=PATH")
    if not path.is_file():
        raise error_type("there is no model file", where=str(path), cure=f"check --option {option}=PATH")
    with path.open("rb") as file:
        start = file.read(4)
    pickled = "PyTorch" if start == _ZIP else "pickle" if start[:2] in _PICKLE else None
    other = _OTHER_FORMATS.get(path.suffix.lower()) or pickled
    if other is not None:
        raise error_type(
            f"a {other} file, no ONNX model; such files are not loaded",
            where=str(path),
            cure="export the model to ONNX, and name the .onnx file",
        )
    for location in external_data(path):
        _check_location(location, path, error_type)


def external_data(path: Path) -> frozenset[str]:
    """The files, as the model names them, that hold its tensors. A damaged model gives those before the damage."""
    if not path.stat().st_size:
        return frozenset()
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return frozenset(_locations(content))


def model_digest(path: Path, *words: str) -> str:
    """The first characters of a digest of a model, its external data and `words`: enough to tell a user's models
    apart.
    """
    digest = hashlib.sha256()
    for part in (path, *(path.parent / location for location in sorted(external_data(path)))):
        with part.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    digest.update("\n".join(words).encode())
    return digest.hexdigest()[:_DIGEST_CHARS]


def _check_location(location: str, path: Path, error_type: type[SupermapError]) -> None:
    windows, posix = PureWindowsPath(location), PurePosixPath(location)
    outside = posix.is_absolute() or windows.drive or windows.root or ".." in windows.parts
    if outside or not location:
        raise error_type(
            f"the model's data lies outside its folder: {location!r}",
            where=str(path),
            cure="get the model from somebody you trust, or export it anew",
        )
    if not (path.parent / location).is_file():
        raise error_type(
            f"the model's data is missing: {location}",
            where=str(path),
            cure="put the file beside the model, under that name",
        )


def _locations(content: mmap.mmap) -> Iterator[str]:
    """The values of the key `location` in all tensors."""
    messages = [("model", 0, len(content))]
    while messages:
        kind, start, end = messages.pop()
        if kind == "entry":
            fields = {field: content[first:last] for field, first, last in _fields(content, start, end)}
            if fields.get(1) == b"location":
                yield fields.get(2, b"").decode("utf-8", "replace")
            continue
        children = _CHILDREN[kind]
        messages += [
            (children[field], first, last) for field, first, last in _fields(content, start, end) if field in children
        ]


def _fields(content: mmap.mmap, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(field number, first byte, end) of the fields of a message that have a length; stops where it is damaged."""
    at = start
    while at < end:
        key, at = _varint(content, at, end)
        match key & 7:
            case 0:
                _, at = _varint(content, at, end)
            case 1:
                at += 8
            case 2:
                length, at = _varint(content, at, end)
                if at + length > end:
                    return
                yield key >> 3, at, at + length
                at += length
            case 5:
                at += 4
            case _:
                return


def _varint(content: mmap.mmap, at: int, end: int) -> tuple[int, int]:
    """A number of at most 64 bits and where it ends; at the message's end it is 0."""
    value, shift = 0, 0
    while at < end and shift < 64:
        byte = content[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
    return 0, end
