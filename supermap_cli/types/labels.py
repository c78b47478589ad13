"""Classes of labels, and how a label is spelled."""

from __future__ import annotations

import re
from functools import lru_cache

DYNAMIC_CLASSES = frozenset({"person", "people", "pedestrian", "man", "woman", "child", "dog", "cat", "bird"})
"""Labels of people and animals, which move by themselves: they are no part of the static map even while they stand
still.
"""

_WORDS = re.compile(r"[^\W\d_]\w*([ -]+\w+)*-?")
"""A label of words, of letters of any script; all others (sentences, quotations, numbers) keep their signs."""

_KEPT_SPELLINGS = 1 << 14
"""Labels whose spelling is kept: of all vocabularies of detectors together."""


@lru_cache(_KEPT_SPELLINGS)
def plain_label(label: str) -> str:
    """`Person` -> person, `potted_plant` -> potted plant, `T-Shirt` -> t shirt: as COCO spells, and as questions are
    read. Of what is not just words only the spaces are made plain; "" is no label.
    """
    spaced = " ".join(label.replace("_", " ").split())
    if _WORDS.fullmatch(spaced):
        return " ".join(spaced.replace("-", " ").lower().split())
    return " ".join(label.split())
