"""Runs a sentence encoder: tokens in, one vector for each text out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnxruntime

from supermap_cli.errors import EncoderError
from supermap_cli.geometry.arrays import Float32Array, FloatArray
from supermap_cli.weights.catalogue import load_catalogue
from supermap_cli.weights.folder import models_folder
from supermap_sentence_encoder import SentenceOptions

TOKENIZER = "tokenizer.json"

_TOKEN_INPUTS = ("input_ids", "attention_mask", "token_type_ids")
"""Inputs of BERT and its kin, as Hugging Face's exports name them."""


class SentenceEncoder:
    """An ONNX model of the BERT family. Raises `EncoderError` if it, its tokenizer or the extra is missing."""

    def __init__(self, options: SentenceOptions) -> None:
        try:
            from tokenizers import Tokenizer  # noqa: PLC0415 - an extra
        except ImportError:
            cure = "pip install 'supermap-cli[encoder]'"
            raise EncoderError("the sentence encoder needs the package tokenizers", cure=cure) from None
        folder = _find_folder(options.model)
        self._tokenizer = Tokenizer.from_file(str(folder / TOKENIZER))
        self._tokenizer.enable_padding()
        self._path = _only_model(folder)
        settings = onnxruntime.SessionOptions()
        settings.intra_op_num_threads = options.threads
        try:
            self._session = onnxruntime.InferenceSession(str(self._path), settings, ["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's own exceptions have no common base
            raise EncoderError(
                f"the model cannot be loaded: {error}", where=str(self._path), cure="export it again, or take another"
            ) from error
        self._inputs = [put_in.name for put_in in self._session.get_inputs()]
        if unknown := set(self._inputs) - set(_TOKEN_INPUTS):
            raise EncoderError(
                f"inputs of no sentence encoder: {', '.join(sorted(unknown))}",
                where=str(self._path),
                cure="take a model with input_ids and attention_mask",
            )

    def encode(self, texts: Sequence[str]) -> Float32Array:
        """(n, d) float32, unit length: the model's own sentence vector, else the mean of its tokens' vectors."""
        encoded = self._tokenizer.encode_batch(list(texts))
        fields = {
            "input_ids": np.array([text.ids for text in encoded], np.int64),
            "attention_mask": np.array([text.attention_mask for text in encoded], np.int64),
            "token_type_ids": np.array([text.type_ids for text in encoded], np.int64),
        }
        (output, *_) = self._session.run(None, {name: fields[name] for name in self._inputs})
        vectors = _sentence_vectors(np.asarray(output, np.float64), fields["attention_mask"].astype(np.float64))
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        return np.asarray(vectors / np.maximum(lengths, np.finfo(np.float32).tiny), np.float32)


def _sentence_vectors(output: FloatArray, attention: FloatArray) -> FloatArray:
    """(n, d) from (n, d), or from (n, tokens, d) as the mean over the tokens that are no padding."""
    if output.ndim == 2:
        return output
    weights = attention[:, :, None]
    return np.asarray((output * weights).sum(axis=1) / weights.sum(axis=1))


def _find_folder(requested: Path | None) -> Path:
    if requested is not None:
        folder = requested.expanduser()
        if not (folder / TOKENIZER).is_file():
            cure = "check the option sentence.model"
            raise EncoderError(f"no folder with a {TOKENIZER} and an .onnx file", where=str(folder), cure=cure)
        return folder
    others = {model.name for model in load_catalogue().model if model.backend != "sentence"}
    models = models_folder()
    found = sorted(path.parent for path in models.glob(f"*/{TOKENIZER}") if path.parent.name not in others)
    if len(found) != 1:
        what = "several sentence encoders to choose from" if found else "there is no sentence encoder"
        cure = f"`supermap models pull sentence` gets one; or put one, with its {TOKENIZER}, into a folder in {models}"
        raise EncoderError(what, where=", ".join(path.name for path in found) or None, cure=cure)
    return found[0]


def _only_model(folder: Path) -> Path:
    models = sorted(folder.glob("*.onnx"))
    if len(models) != 1:
        what = f"{len(models)} .onnx files" if models else "no .onnx file"
        raise EncoderError(f"{what} beside the {TOKENIZER}", where=str(folder), cure="leave one there")
    return models[0]
