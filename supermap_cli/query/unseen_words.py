"""Labels of a map that a word nobody listed may mean, by a text encoder.

An encoder only suggests. A threshold alone lies: all-MiniLM-L6-v2 finds a fire truck more like a fire extinguisher than
a settee like a couch. So what it finds is said, and answers a question only if the lexicon agrees or the user asks
for loose answers.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from supermap_cli.errors import EncoderError, SupermapError
from supermap_cli.language.language_data import language_data
from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.protocols import TextEncoder

ENCODER = "sentence"
"""The encoder that is asked."""

PROMPT = "a photo of a {}"
"""What word and labels are put into (Radford et al. 2021, CLIP, sec. 3.1.4): bare words have no context to go by."""

LEAST_SIMILARITY = 0.57
"""Cosine from which a label is worth a suggestion, chosen on 40 words for 20 labels; docs/words.md has the figures for
others.
"""

MOST_SUGGESTIONS = 3


@dataclass(frozen=True)
class Suggestion:
    """A label that a word may mean: the cosine of their vectors (-1 to 1), and whether the lexicon says so too."""

    label: str
    similarity: float
    agreed: bool


def load_encoder(options: Mapping[str, object] | None = None) -> TextEncoder:
    """The text encoder. Raises `EncoderError` where there is none, with the way to get one."""
    encoders = load_plugins().encoders
    if ENCODER not in encoders:
        raise EncoderError("there is no text encoder", cure="pip install 'supermap-cli[encoder]'")
    made: TextEncoder = encoders.make(ENCODER, options or {})  # type: ignore[assignment]
    return made


def similar_labels(word: str, labels: Collection[str], encoder: TextEncoder) -> tuple[Suggestion, ...]:
    """The labels that are most like a word, the likeliest first; none where nothing is."""
    names = sorted(labels)
    if not names:
        return ()
    vectors = encoder.encode([PROMPT.format(text) for text in (word, *names)])
    similarities = vectors[1:] @ vectors[0]
    order = np.argsort(-similarities, kind="stable")[:MOST_SUGGESTIONS]
    return tuple(
        Suggestion(names[index], round(float(similarities[index]), 3), lexicon_agrees(word, names[index]))
        for index in order
        if similarities[index] >= LEAST_SIMILARITY
    )


def lexicon_agrees(word: str, label: str) -> bool:
    """Whether the lexicon calls a word and a label the same, or one a kind of the other."""
    lexicon = load_lexicon()
    one, other = lexicon.normalise(word), lexicon.normalise(label)
    return lexicon.is_kind_of(one, other) or lexicon.is_kind_of(other, one) or other in lexicon.near_kinds(one)


def suggested_labels(refusal: RefusedQuestionError, labels: Collection[str]) -> tuple[str, ...]:
    """The labels of the map that the unknown word of a refused question may mean; none without an encoder, which only
    English is asked for: the words of other languages are no words to it.
    """
    if refusal.kind != "unknown word" or refusal.part is None or refusal.language != "en":
        return ()
    try:
        found = similar_labels(refusal.part, labels, load_encoder())
    except SupermapError:
        return ()
    return tuple(suggestion.label for suggestion in found)


def with_suggestions(refusal: RefusedQuestionError, labels: Collection[str]) -> RefusedQuestionError:
    """A refusal with labels of the map that may have been meant, where the spelling suggests no word."""
    near = () if refusal.near else suggested_labels(refusal, labels)
    if not near:
        return refusal
    return language_data(refusal.language).refusal(refusal.kind, refusal.part, refusal.where, near)
