"""Texts as vectors, by an ONNX sentence encoder such as all-MiniLM-L6-v2. Needs the extra `encoder`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import TextEncoder


class SentenceOptions(Options):
    """Options of the encoder `sentence`."""

    model: Path | None = Field(
        default=None,
        description="folder with the encoder's .onnx file and its tokenizer.json; default: the only such folder in "
        "SuperMap's user data folder, under models/",
    )
    threads: int = Field(default=1, ge=0, description="threads of onnxruntime, 0 = one for each core")


@hookimpl
def register_encoders(register: Register) -> None:
    """The encoder `sentence`."""
    register("sentence", _make_encoder, SentenceOptions)


def _make_encoder(options: SentenceOptions) -> TextEncoder:
    from supermap_sentence_encoder.encoder import SentenceEncoder  # noqa: PLC0415 - loads onnxruntime

    return SentenceEncoder(options)
