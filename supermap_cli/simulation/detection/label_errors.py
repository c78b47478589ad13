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
_CLOSE = 0.95
"""Ratio of the scores of a thing's usual name and of the synonym that comes first; chosen so that both stay likely."""


@cache
def look_alikes() -> Mapping[str, tuple[str, ...]]:
    """A label -> the labels it is confused with, the likeliest first."""
    text = (Path(__file__).parent / "look_alikes.toml").read_text(encoding="utf-8")
    return {label: tuple(others) for label, others in tomllib.loads(text)["look_alikes"].items()}


@cache
def other_names() -> Mapping[str, tuple[str, ...]]:
    """A label -> synonyms of it. A label that is not listed has none."""
    text = (Path(__file__).parent / "synonyms.toml").read_text(encoding="utf-8")
    return {label: tuple(names) for label, names in tomllib.loads(text)["synonyms"].items()}


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
        self,
        label: str,
        taken_for: str | None,
        score: float,
        count: int,
        rng: np.random.Generator,
        *,
        wrong_score: float = 0.85,
    ) -> tuple[Hypothesis, ...]:
        """The best `count` labels with scores that add up to at most 1: the true one first with `score`, or, where the
        thing is `taken_for` another, that one with `wrong_score` of it and the true one close behind.
        """
        others = [other for other in self.others(label, count, rng) if other != taken_for]
        if taken_for is None:
            ranked = [label, *others]
        else:
            ranked, score = [taken_for, label, *others], score * wrong_score
        scores = [score]
        for _ in ranked[1:count]:
            closeness = rng.uniform(0.6, 0.95) if taken_for is not None and len(scores) == 1 else rng.uniform(0.3, 0.7)
            left = 1 - sum(scores)
            scores.append(float(min(closeness * left, 0.95 * scores[-1])))
        return tuple(
            Hypothesis(name, hypothesis_score) for name, hypothesis_score in zip(ranked[:count], scores, strict=True)
        )


def called_otherwise(
    hypotheses: tuple[Hypothesis, ...], count: int, rng: np.random.Generator
) -> tuple[Hypothesis, ...]:
    """The hypotheses with a synonym of the first before it, if there is one. A network that knows both words scores
    each on its own, almost alike: the scores may add up to more than 1.
    """
    right, *others = hypotheses
    names = other_names().get(right.label, ())
    if not names:
        return hypotheses
    first = Hypothesis(str(rng.choice(names)), right.score)
    return (first, Hypothesis(right.label, _CLOSE * right.score), *others)[:count]
