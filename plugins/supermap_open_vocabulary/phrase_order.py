"""Whether a Grounding DINO export takes several phrases at once.

In the text encoder each phrase attends to its own tokens only, and their positions begin anew with each phrase; from
there on the order of tokens plays no part. So a phrase's logits are the same wherever it stands in the caption. An
export that was traced with one phrase has the mask and the positions of one phrase built in, and the words of a second
phrase do not see each other: they score otherwise there than in the first place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array
from supermap_open_vocabulary.captions import Caption, Encode, make_caption

_PHRASES = ("trash can", "red coffee table")
"""Two phrases of several tokens: in those of one token a missing mask changes less."""
_LARGEST_CHANGE = 0.02
"""Median change of a token's logits between the two orders, as a share of their spread. Rounding gives less than a
thousandth (measured on random models); a mask that is built in a tenth and more.
"""


def takes_several_phrases(logits: Callable[[Caption], Float32Array], encode: Encode, length: int | None) -> bool:
    """Whether each of two phrases scores alike in either order. `logits` runs the model on an image of noise."""
    try:
        first, second = (_ranked(logits, encode, length, order) for order in ((0, 1), (1, 0)))
    except DetectorError:
        alone = make_caption(_PHRASES[:1], (0,), encode, length)
        logits(alone)  # a model that does not run at all says so
        return False
    return order_change(first, second) <= _LARGEST_CHANGE


def order_change(first: Sequence[Float32Array], second: Sequence[Float32Array]) -> float:
    """The median change of ranked logits, as a share of their spread."""
    one, other = np.concatenate(first, axis=1), np.concatenate(second, axis=1)
    spread = float(np.std(one))
    change = float(np.median(np.abs(one - other)))
    return change / spread if spread > 0 else float(change > 0)


def _ranked(
    logits: Callable[[Caption], Float32Array], encode: Encode, length: int | None, order: tuple[int, int]
) -> list[Float32Array]:
    """For each of the phrases, in one order whatever the caption's, (queries, tokens) logits, the queries sorted."""
    caption = make_caption([_PHRASES[i] for i in order], order, encode, length)
    answer = logits(caption)
    spans = dict(zip(caption.phrases, caption.spans, strict=True))
    return [np.sort(answer[:, slice(*spans[number])], axis=0) for number in sorted(spans)]
