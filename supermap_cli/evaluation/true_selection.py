"""Which true objects a selection names: a small language of its own, evaluated over the truth and not by any query.

A selection is a JSON object: `{"label": "mug", "on": {"label": "desk"}}`. All of its terms must hold:

- `label`: a label or several; "*" is any. Nothing is derived from it: who means armchairs, too, says so.
- A relation of the registry (`on`, `under`, `inside`, `near`, `beside`, ...; `_` for spaces) to a selection: it holds
  of one of that. With `STRICT` slack it surely holds, with `WIDE` it surely does not; between, nobody can say.
- `within_m` and `beyond_m`: `[metres, selection]`, the gap between the boxes, for sure or not at `DISTANCE_MARGIN_M`.
- `not`: an object of such terms, of which none holds. `or`: several of them, of which one holds.
- `having`: a selection that stands in a relation to it: `{"on": {"label": "mug"}}` (a mug is on it).
- `except`: a selection that is left out. `first`: `[measure, rank]` or `[measure, rank, selection]`, of `largest`,
  `smallest`, `tallest`, `nearest`, `farthest`: the one of this rank, if it leads by `LEAD`.
- `when`: `now` (the end of the last traversal), `ever`, `earlier` (before the last traversal), `first` (the first
  traversal), `last` (the last one). Selections within it are of the same time unless they say another.
- `changed`: `appeared`, `disappeared`, `moved` or `any`: what the truth's list of changes has of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from supermap_cli.geometry.boxes import Box3D, footprint_gap_m
from supermap_cli.relations.registry import RELATIONS
from supermap_cli.simulation.recording.observed_truth import (
    EMPTY_FRAMES,
    EMPTY_VISIBLE,
    ObservedTruth,
    Undetermined,
)
from supermap_cli.simulation.recording.questions import STRICT, WIDE
from supermap_cli.simulation.recording.true_walls import true_walls
from supermap_cli.types.relations import GraphNode, Pair
from supermap_cli.types.truth import GroundTruth, TrueChange, TrueState

Selection = Mapping[str, Any]

DISTANCE_MARGIN_M = 0.25
"""Metres by which a distance must differ from a limit for anyone to be sure: a map's errors of two boxes. Chosen."""
LEAD = 1.25
"""Ratio by which the measure of a superlative's thing must lead its neighbours in the ranking. Chosen."""
CLEAR_MOVE_M = 0.5
"""Metres; a smaller move need not be noticed (the gate of `eval change`)."""

RELATION_NAMES = frozenset({"on", "under", "inside", "near", "beside", "above", "below", "at", "against", "far_from"})
MEASURES = frozenset({"largest", "smallest", "tallest", "nearest", "farthest"})
TIMES = frozenset({"now", "ever", "earlier", "first", "last"})
TERMS = frozenset({"label", "within_m", "beyond_m", "not", "or", "having", "except", "first", "when", "changed"})
_NO_CONDITION = frozenset({"label", "when", "first"})


class TrueSelections:
    """Evaluates selections; raises `Undetermined` where the images, or the margins, leave the answer open."""

    def __init__(self, truth: GroundTruth) -> None:
        self._truth = truth
        self._observed = ObservedTruth(truth)
        self._objects = [k for k, thing in enumerate(truth.objects) if thing.kind == "object"]
        self._clear_between = true_walls(truth)
        self._nodes: dict[tuple[int, int], GraphNode] = {}

    def ids(self, selection: Selection) -> frozenset[str]:
        """The ids of the objects that a selection names, if that is sure of all of them."""
        return frozenset(self._truth.objects[k].id for k in self._select(selection, "now"))

    def sure_and_perhaps(self, selection: Selection) -> tuple[frozenset[str], frozenset[str]]:
        """The ids of the objects that a selection surely names, and of those of which nobody can say."""
        if "first" in selection:
            return self.ids(selection), frozenset()
        when = selection.get("when", "now")
        holds = [self._condition(name, term, when) for name, term in selection.items() if name not in _NO_CONDITION]
        sure, perhaps = set[str](), set[str]()
        for k in self._labelled(selection):
            try:
                if self._state(k, when) is not None and all(each(k) for each in holds):
                    sure.add(self._truth.objects[k].id)
            except Undetermined:
                perhaps.add(self._truth.objects[k].id)
        return frozenset(sure), frozenset(perhaps)

    def changed(self, kind: str, of: Selection | None = None) -> tuple[frozenset[str], frozenset[str]]:
        """The ids of what surely changed in a way ("any": in any), and of what may have, as far as images show it."""
        named = None if of is None else self._labelled(of)
        numbers = {thing.id: k for k, thing in enumerate(self._truth.objects)}
        sure: set[str] = set()
        perhaps: set[str] = set()
        for change in self._truth.changes:
            k = numbers[change.object_id]
            if (kind not in {"any", change.kind}) or (named is not None and k not in named):
                continue
            (sure if self._was_shown(change, k) else perhaps).add(change.object_id)
        return frozenset(sure), frozenset(perhaps - sure)

    def gap_m(self, first: Selection, second: Selection) -> float:
        """Metres between the nearest two of two selections, box to box."""
        pairs = [
            _box_gap_m(self._box(k, "now"), self._box(other, "now"))
            for k in self._select(first, "now")
            for other in self._select(second, "now")
            if k != other
        ]
        if not pairs:
            raise Undetermined
        return min(pairs)

    def is_larger(self, measure: str, first: Selection, second: Selection) -> bool:
        """Whether the one thing of a selection exceeds that of another. `Undetermined` if either is not one thing."""
        one, other = self._select(first, "now"), self._select(second, "now")
        if len(one) != 1 or len(other) != 1:
            raise Undetermined
        return self._ranked([*one, *other], (measure, 1), "now") == one

    # -- terms

    def _labelled(self, selection: Selection) -> list[int]:
        label = selection.get("label", "*")
        labels = {label} if isinstance(label, str) else set(label)
        return [k for k in self._objects if "*" in labels or self._truth.objects[k].label in labels]

    def _select(self, selection: Selection, when: str) -> list[int]:
        when = selection.get("when", when)
        found = [k for k in self._labelled(selection) if self._state(k, when) is not None]
        for name, term in selection.items():
            if name not in _NO_CONDITION:
                holds = self._condition(name, term, when)
                found = [k for k in found if holds(k)]
        if "first" in selection:
            return self._ranked(found, selection["first"], when)
        return found

    def _condition(self, name: str, term: Any, when: str) -> Callable[[int], bool]:
        match name:
            case "not" | "or":
                alternatives = [term] if name == "not" else term
                every = [[self._condition(each, value, when) for each, value in one.items()] for one in alternatives]
                if name == "not":
                    return lambda k: not any(holds(k) for holds in every[0])
                return lambda k: any(all(holds(k) for holds in one) for one in every)
            case "except":
                left_out = set(self._select(term, when))
                return lambda k: k not in left_out
            case "changed":
                sure, perhaps = self.changed(term)
                return lambda k: _decided(self._truth.objects[k].id in sure, self._truth.objects[k].id in perhaps)
            case "within_m" | "beyond_m":
                metres, others = float(term[0]), self._select(term[1], when)
                return lambda k: self._is_distant(k, others, metres, when, within=name == "within_m")
            case _:
                return self._relation(name, term, when)

    def _relation(self, name: str, term: Any, when: str) -> Callable[[int], bool]:
        """Whether something stands in a relation to one of a selection; of `having`, the other way round."""
        turned = name == "having"
        [(relation, selection)] = term.items() if turned else [(name, term)]
        others = self._select(selection, when)
        return lambda k: _any(
            self._relates(relation, *((other, k) if turned else (k, other)), when) for other in others if other != k
        )

    def _is_distant(self, k: int, others: Iterable[int], limit_m: float, when: str, *, within: bool) -> bool:
        gaps = [_box_gap_m(self._box(k, when), self._box(other, when)) for other in others if other != k]
        if not gaps:
            return False
        if abs(min(gaps) - limit_m) < DISTANCE_MARGIN_M:
            raise Undetermined
        return (min(gaps) < limit_m) is within

    def _relates(self, name: str, k: int, other: int, when: str) -> bool | None:
        """Whether one object stands in a relation to another; `None` in between."""
        pair, relation = Pair(self._node(k, when), self._node(other, when)), name.replace("_", " ")
        if RELATIONS.measure(relation, pair, STRICT, self._clear_between) > 0:
            return True
        return None if RELATIONS.measure(relation, pair, WIDE, self._clear_between) > 0 else False

    def _ranked(self, found: Sequence[int], term: Sequence[Any], when: str) -> list[int]:
        measure, rank = str(term[0]), int(term[1])
        others = self._select(term[2], when) if len(term) > 2 else []
        ranked = sorted((self._measured(measure, k, others, when), k) for k in found if k not in others)
        if measure in {"largest", "tallest", "farthest"}:
            ranked.reverse()
        if len(ranked) < rank:
            return []
        for (one, _), (other, _) in itertools.pairwise(ranked[max(0, rank - 2) : rank + 1]):
            if max(one, other) < LEAD * min(one, other) + (measure in {"nearest", "farthest"}) * DISTANCE_MARGIN_M:
                raise Undetermined
        return [ranked[rank - 1][1]]

    def _measured(self, measure: str, k: int, others: Sequence[int], when: str) -> float:
        box = self._box(k, when)
        if measure == "tallest":
            return float(box.size[2])
        if measure in {"largest", "smallest"}:
            return float(np.prod(box.size))
        if not others:
            raise Undetermined
        return min(_box_gap_m(box, self._box(other, when)) for other in others)

    # -- the truth at a time

    def _state(self, k: int, when: str) -> TrueState | None:
        match when:
            case "now":
                return self._observed.now(k)
            case "ever":
                return self._observed.ever(k)
            case "earlier":
                return self._observed.earlier(k)
            case _:
                return self._observed.during(k, 0 if when == "first" else len(self._truth.traversals) - 1)

    def _standing(self, k: int, when: str) -> TrueState:
        state = self._state(k, when)
        if state is None:
            raise Undetermined
        return state

    def _box(self, k: int, when: str) -> Box3D:
        return self._standing(k, when).box

    def _node(self, k: int, when: str) -> GraphNode:
        state = self._standing(k, when)
        thing = self._truth.objects[k]
        at = (k, next(at for at, each in enumerate(thing.states) if each is state))
        if at not in self._nodes:
            self._nodes[at] = GraphNode(k, thing.label, state.box, thing.surface_world(state))
        return self._nodes[at]

    def _was_shown(self, change: TrueChange, k: int) -> bool:
        """Whether the images show a change: the thing in each of its places, and the place that is empty, empty."""
        try:
            came = change.to_state is None or self._observed.ever(k) is self._truth.objects[k].states[change.to_state]
            left = change.from_state is None or self._observed.earlier(k) is not None
        except Undetermined:
            return False
        if change.kind == "moved":
            return came and left and change.distance_m is not None and change.distance_m >= CLEAR_MOVE_M
        place = change.to_state if change.from_state is None else change.from_state
        return came and left and place is not None and self._shown_empty(k, place) >= EMPTY_FRAMES

    def _shown_empty(self, k: int, place: int) -> int:
        """Images that show the place without the object."""
        return sum(
            int(np.sum((rows.object == k) & (rows.state == place) & ~rows.present & (rows.visible >= EMPTY_VISIBLE)))
            for rows in (traversal.sightings for traversal in self._truth.traversals)
        )


def _box_gap_m(first: Box3D, second: Box3D) -> float:
    """Metres between two upright boxes."""
    low, high = (max, min)
    above = low(first.center[2] - first.size[2] / 2, second.center[2] - second.size[2] / 2)
    below = high(first.center[2] + first.size[2] / 2, second.center[2] + second.size[2] / 2)
    return float(np.hypot(footprint_gap_m(first, second), max(0.0, above - below)))


def _any(verdicts: Iterable[bool | None]) -> bool:
    known = list(verdicts)
    return _decided(True in known, None in known)


def _decided(sure: bool, perhaps: bool) -> bool:
    """Surely so, or surely not."""
    if not sure and perhaps:
        raise Undetermined
    return sure
