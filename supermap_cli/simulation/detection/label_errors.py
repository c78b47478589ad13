"""Which labels a detector considers for a thing, and how sure it is of each."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np

from supermap_cli.types.detections import Hypothesis

_LIKELIER = 0.55
"""Ratio of the chances of a look-alike and of the one listed before it; chosen so that of a long list the first is
taken in not quite half of the cases, 1 - 0.55, and the second in a quarter.
"""


@cache
def look_alikes() -> Mapping[str, tuple[str, ...]]:
    """A label -> the labels it is confused with, the likeliest first."""
    text = (Path(__file__).parent / "look_alikes.toml").read_text(encoding="utf-8")
    return {label: tuple(others) for label, others in tomllib.loads(text)["look_alikes"].items()}


class LabelErrors:
    """All labels that a detector knows, and how it errs among them."""

    def __init__(self, labels: Iterable[str]) -> None:
        self.labels = tuple(sorted({*labels, *look_alikes()}))

    def others(self, label: str, count: int, rng: np.random.Generator) -> list[str]:
        """Up to `count` labels that such a thing may be taken for, the likelier ones mostly first."""
        known = look_alikes().get(label, ())
        liking = rng.gumbel(size=len(known)) + np.arange(len(known)) * np.log(_LIKELIER)
        chosen = [known[k] for k in np.argsort(-liking)[:count]]
        if len(chosen) < count:
            rest = [other for other in self.labels if other != label and other not in known]
            chosen += [rest[k] for k in rng.permutation(len(rest))[: count - len(chosen)]]
        return chosen

    def hypotheses(
        self, label: str, taken_for: str | None, score: float, count: int, rng: np.random.Generator
    ) -> tuple[Hypothesis, ...]:
        """The best `count` labels with scores that add up to at most 1: the true one first with `score`, or, where the
        thing is `taken_for` another, that one with a lower score and the true one close behind.
        """
        others = [other for other in self.others(label, count, rng) if other != taken_for]
        if taken_for is None:
            ranked = [label, *others]
        else:
            ranked, score = [taken_for, label, *others], score * 0.85
        scores = [score]
        for _ in ranked[1:count]:
            closeness = rng.uniform(0.6, 0.95) if taken_for is not None and len(scores) == 1 else rng.uniform(0.3, 0.7)
            left = 1 - sum(scores)
            scores.append(float(min(closeness * left, 0.95 * scores[-1])))
        return tuple(
            Hypothesis(name, hypothesis_score) for name, hypothesis_score in zip(ranked[:count], scores, strict=True)
        )
