"""Questions in plain words whose answers follow from the true geometry, whatever the detail of the map that is asked.

Words: a label means its own things and those of its kinds (an armchair is a chair, a desk is a table). Times: now is
what stands there when the last traversal ends; "earlier" what stood there in a traversal before the last (with one
traversal: ever); "in NAME" what that traversal saw; the past tense what was ever seen.

Relations are those of the registry (`supermap_cli.relations`), on the true boxes and the surfaces that were seen, whose
measures `slack` widens. Here one holds if it does with `STRICT`, and does not if it fails even with `WIDE`, which is
more than the graph's own hysteresis of 1.3; a question that depends on anything between is left out.

- On(A, B): half of A's footprint is over B, and A's underside within 6 cm and a quarter of its height (up to 5 cm more)
  of B's surface there (of the top of B's box where the images do not show that surface).
- Under(A, B): half of B's surface over A is above A's top; or B is on A, or above it.
- Inside(A, B): B's box holds 60 % of A's, and B is no table, seat or the like.
- Near(A, B): the gap between the boxes is at most 0.5 m and 0.6 of the larger one's side (which counts up to 1.5 m),
  and no wall of the building stands between them.

So is a question that depends on things which the images do not determine (see `observed_truth`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from itertools import islice

import numpy as np

from supermap_cli.relations.predicates import under
from supermap_cli.relations.registry import RELATIONS
from supermap_cli.simulation.recording.observed_truth import ObservedTruth, Undetermined
from supermap_cli.simulation.recording.true_walls import true_walls
from supermap_cli.types.relations import GraphNode, Pair
from supermap_cli.types.truth import GroundTruth, TrueQuestion, TrueState

STRICT, WIDE = 1 / 1.4, 1.3 * 1.4
"""Slack with which a relation surely holds, and without which it surely fails: the graph's hysteresis (1.3) and a
margin of 1.4 for the map's errors of size and place.
"""

KINDS: Mapping[str, tuple[str, ...]] = {"chair": ("armchair",), "table": ("desk",)}
"""What else a label means, besides labels that end in it ("coffee table")."""

SPOKEN: Mapping[str, str] = {"potted plant": "plant", "refrigerator": "fridge", "cardboard box": "box"}
"""What people say instead of a label."""

NEVER_THERE = ("piano", "bathtub", "bicycle", "guitar", "aquarium", "surfboard")
"""Labels that no scenario has."""

_PLURALS: Mapping[str, str] = {"mouse": "mice", "bookshelf": "bookshelves", "tv": "televisions"}
_MOST: Mapping[str, int] = {
    "all": 4, "count": 4, "on": 4, "under": 3, "in": 2, "near": 5, "then": 6, "earlier": 3, "gone": 4, "never": 2,
}  # fmt: skip


def ask_questions(truth: GroundTruth) -> tuple[TrueQuestion, ...]:
    """The questions that a perfect map of this truth answers right; `truth.questions` is not looked at."""
    if not truth.traversals:
        return ()
    asking = _QuestionMaker(truth)
    asked = [
        *islice(asking.all_of(), _MOST["all"]),
        *islice(asking.how_many(), _MOST["count"]),
        *(
            question
            for preposition in _RELATIONS
            for question in islice(asking.related(preposition), _MOST[preposition])
        ),
        *islice(asking.during_traversals(), _MOST["then"]),
        *islice(asking.earlier(), _MOST["earlier"]),
        *islice(asking.gone(), _MOST["gone"]),
        *islice(asking.never_there(), _MOST["never"]),
    ]
    return tuple({question.text: question for question in asked}.values())


def means(label: str, other: str) -> bool:
    """Whether who asks for a label wants things of the other one, too."""
    return other == label or other.endswith(f" {label}") or other in KINDS.get(label, ())


def plural(label: str) -> str:
    """What to call several of a label's things."""
    if label in _PLURALS:
        return _PLURALS[label]
    noun = SPOKEN.get(label, label)
    if noun.endswith(("s", "x", "ch", "sh")):
        return f"{noun}es"
    return f"{noun[:-1]}ies" if noun.endswith("y") and noun[-2] not in "aeiou" else f"{noun}s"


class _QuestionMaker:
    """Makes questions of each sort, the best first; what the images do not determine is left out."""

    def __init__(self, truth: GroundTruth) -> None:
        self._truth = truth
        self._observed = ObservedTruth(truth)
        objects = [(k, thing) for k, thing in enumerate(truth.objects) if thing.kind == "object"]
        self._labels = {k: thing.label for k, thing in objects}
        rng = np.random.default_rng(truth.seed)
        self._nouns = [str(label) for label in rng.permutation(sorted(set(self._labels.values())))]
        self._clear_between = true_walls(truth)
        self._relates = cache(self._relates_now)
        self._node = cache(self._node_now)

    def all_of(self) -> Iterator[TrueQuestion]:
        """Ask "chair": labels of several things first."""
        for noun, found in sorted(self._settled(self._observed.now), key=lambda settled: -len(settled[1])):
            if found:
                yield self._question(SPOKEN.get(noun, noun), found)

    def how_many(self) -> Iterator[TrueQuestion]:
        """Ask "how many chairs": labels of several things first, after those that `all_of` begins with."""
        several = sorted(self._settled(self._observed.now), key=lambda settled: -len(settled[1]))
        for noun, found in several[2:] + several[:2]:
            if found:
                yield self._question(f"how many {plural(noun)}", found)

    def related(self, preposition: str) -> Iterator[TrueQuestion]:
        """Ask "mug on the desk", once for each label: questions that tell things of one label apart come first."""
        settled = [(noun, found) for noun, found in self._settled(self._observed.now) if found]
        asked: list[tuple[bool, str, TrueQuestion]] = []
        for noun, found in settled:
            for other, references in settled:
                if set(found) & set(references):
                    continue
                answer = self._related_of(preposition, found, references)
                if any(self._is_telling(preposition, k, other_k) for k in answer for other_k in references):
                    text = f"{SPOKEN.get(noun, noun)} {preposition} the {SPOKEN.get(other, other)}"
                    asked.append((len(answer) == len(found), noun, self._question(text, answer)))
        asked.sort(key=lambda entry: entry[0])
        used: set[str] = set()
        for _, noun, question in asked:
            if noun not in used:
                used.add(noun)
                yield question

    def during_traversals(self) -> Iterator[TrueQuestion]:
        """Ask "plant in monday", of what changed; nothing where there is one traversal only."""
        if len(self._truth.traversals) < 2:
            return
        for noun in self._changed():
            for index, traversal in enumerate(self._truth.traversals):
                for found in self._settle(noun, partial(self._observed.during, traversal=index)):
                    yield self._question(f"{SPOKEN.get(noun, noun)} in {traversal.name}", found)

    def earlier(self) -> Iterator[TrueQuestion]:
        """Ask "plant earlier", of what changed."""
        for noun in self._changed():
            for found in self._settle(noun, self._observed.earlier):
                if found:
                    yield self._question(f"{SPOKEN.get(noun, noun)} earlier", found)

    def gone(self) -> Iterator[TrueQuestion]:
        """Ask "plant" and "where was the plant", of what is there no more."""
        for noun in self._changed():
            for standing in self._settle(noun, self._observed.now):
                for found in self._settle(noun, self._observed.ever):
                    if found and not standing:
                        yield self._question(SPOKEN.get(noun, noun), ())
                        yield self._question(f"where was the {SPOKEN.get(noun, noun)}", found)

    def never_there(self) -> Iterator[TrueQuestion]:
        """Ask for things that no world has."""
        first = self._truth.seed % len(NEVER_THERE)
        yield self._question(NEVER_THERE[first], ())
        yield self._question(f"is there a {NEVER_THERE[first - 1]}", ())

    def _question(self, text: str, found: Iterable[int]) -> TrueQuestion:
        return TrueQuestion(text, tuple(sorted(self._truth.objects[k].id for k in found)))

    def _changed(self) -> list[str]:
        """Labels of what appeared or disappeared, then of what moved."""
        labels = {thing.id: thing.label for thing in self._truth.objects}
        moved = {labels[change.object_id]: change.kind == "moved" for change in self._truth.changes}
        moved |= {labels[change.object_id]: False for change in self._truth.changes if change.kind != "moved"}
        return sorted((noun for noun in self._nouns if noun in moved), key=lambda noun: moved[noun])

    def _settled(self, when: Callable[[int], TrueState | None]) -> Iterator[tuple[str, tuple[int, ...]]]:
        for noun in self._nouns:
            for found in self._settle(noun, when):
                yield noun, found

    def _settle(self, noun: str, when: Callable[[int], TrueState | None]) -> Iterator[tuple[int, ...]]:
        """The objects that a noun means at a time; nothing where the images do not determine them."""
        meant = [k for k, label in self._labels.items() if means(noun, label)]
        try:
            yield tuple(k for k in meant if when(k) is not None)
        except Undetermined:
            return

    def _related_of(self, preposition: str, found: tuple[int, ...], references: tuple[int, ...]) -> tuple[int, ...]:
        """Those of the found that stand in the relation to any reference; none where a pair is in between."""
        verdicts = [[self._relates(preposition, k, other) for other in references] for k in found]
        if any(True not in row and None in row for row in verdicts):
            return ()
        return tuple(k for k, row in zip(found, verdicts, strict=True) if True in row)

    def _relates_now(self, preposition: str, k: int, other: int) -> bool | None:
        """Whether one object stands in a relation to another now; `None` in between."""
        pair, relation = Pair(self._node(k), self._node(other)), _RELATIONS[preposition]
        if RELATIONS.measure(relation, pair, STRICT, self._clear_between) > 0:
            return True
        return None if RELATIONS.measure(relation, pair, WIDE, self._clear_between) > 0 else False

    def _is_telling(self, preposition: str, k: int, other: int) -> bool:
        """Whether people would put it so: a mug is on the desk rather than near it, a book in the shelf and not under
        its boards, a bag under the desk and not in it.
        """
        pair, state = Pair(self._node(k), self._node(other)), self._observed.now(k)
        stands_there = state is not None and state.on == self._truth.objects[other].id
        match preposition:
            case "near":
                return pair.overlap_m2 == 0 and self._relates(preposition, k, other) is True
            case "under":
                return not stands_there and under(pair, STRICT) > 0
            case "in":
                return stands_there and self._relates(preposition, k, other) is True
            case _:
                return self._relates(preposition, k, other) is True

    def _node_now(self, k: int) -> GraphNode:
        thing, state = self._truth.objects[k], self._observed.now(k)
        if state is None:
            raise ValueError(f"{thing.id} does not stand anywhere")
        return GraphNode(k, thing.label, state.box, thing.surface_world(state))


_RELATIONS: Mapping[str, str] = {"on": "on", "under": "under", "in": "inside", "near": "near"}
"""The prepositions that are asked, and the relations that they mean."""
