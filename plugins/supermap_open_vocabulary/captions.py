"""Captions for Grounding DINO: lower-case phrases joined by ". ", no longer than the text encoder takes.

Source: `GroundingDinoProcessor` of transformers, and `load_image`, `preprocess_caption` of IDEA-Research/GroundingDINO.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array

_JOINT = ". "
_END = "."

Encode = Callable[[str], Any]
"""A text -> its encoding by the package tokenizers: `ids`, `type_ids`, `attention_mask`, `offsets`."""


@dataclass(frozen=True)
class Caption:
    """One pass's text: `ids`, `type_ids` and `attention` (tokens,) int64; `phrases` are numbers into the list of all
    phrases, `spans` the (first, end) of each one's tokens.
    """

    ids: NDArray[np.int64]
    type_ids: NDArray[np.int64]
    attention: NDArray[np.int64]
    phrases: tuple[int, ...]
    spans: tuple[tuple[int, int], ...]

    def feeds(self) -> dict[str, NDArray[np.int64]]:
        """The text inputs of a model, (1, tokens) each."""
        return {
            "input_ids": self.ids[None],
            "token_type_ids": self.type_ids[None],
            "attention_mask": self.attention[None],
        }

    def scores(self, logits: Float32Array) -> Float32Array:
        """(queries, phrases) of [0, 1] from `logits` (queries, tokens): the best of each phrase's tokens."""
        best = np.stack([logits[:, first:end].max(axis=1) for first, end in self.spans], axis=1)
        with np.errstate(over="ignore"):
            return np.asarray(1 / (1 + np.exp(-best.astype(np.float64))), np.float32)


def caption_text(phrases: Sequence[str]) -> str:
    """Phrases as one caption."""
    return _JOINT.join(phrases) + _END


def make_caption(phrases: Sequence[str], numbers: Sequence[int], encode: Encode, length: int | None = None) -> Caption:
    """The caption of some phrases, given with their numbers; filled up to `length` tokens where a model needs that."""
    encoding = encode(caption_text(phrases))
    spans, start = [], 0
    for phrase in phrases:
        end = start + len(phrase)
        within = [i for i, (first, last) in enumerate(encoding.offsets) if start <= first < last <= end]
        if not within:
            raise DetectorError(
                f"the model's tokenizer makes nothing of {phrase!r}", cure="look for it by another word"
            )
        spans.append((within[0], within[-1] + 1))
        start = end + len(_JOINT)
    padding = (0,) * max((length or 0) - len(encoding.ids), 0)
    ids = np.array([*encoding.ids, *padding], np.int64)
    type_ids = np.array([*encoding.type_ids, *padding], np.int64)
    attention = np.array([*encoding.attention_mask, *padding], np.int64)
    return Caption(ids, type_ids, attention, tuple(numbers), tuple(spans))


def make_captions(
    phrases: Sequence[str], encode: Encode, *, budget: int, length: int | None = None, one_phrase: bool = False
) -> tuple[Caption, ...]:
    """All phrases in as few captions of at most `budget` tokens as taking them in their order gives.

    Raises `DetectorError` for a phrase that alone is longer.
    """
    chunks: list[list[int]] = []
    for number, phrase in enumerate(phrases):
        alone = len(encode(caption_text([phrase])).ids)
        if alone > budget:
            raise DetectorError(
                f"a phrase of {alone} tokens, the model takes {budget}: {phrase[:60]!r}",
                cure="look for it by fewer words",
            )
        joined = [*chunks[-1], number] if chunks and not one_phrase else [number]
        if len(joined) > 1 and len(encode(caption_text([phrases[i] for i in joined])).ids) <= budget:
            chunks[-1] = joined
        else:
            chunks.append([number])
    return tuple(make_caption([phrases[i] for i in chunk], chunk, encode, length) for chunk in chunks)
