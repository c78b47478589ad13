"""What the images of a truth determine: what was certainly seen, certainly never seen, certainly seen to be gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.geometry.arrays import IntArray
from supermap_cli.types.truth import GroundTruth, TrueState

CLEAR_VISIBLE, CLEAR_PIXELS, CLEAR_FRAMES = 0.3, 150, 5
"""A thing counts as seen if so many images show that share and so many pixels of it."""

GLIMPSE_PIXELS = 30
"""A thing counts as never seen if every image shows fewer pixels of it than this."""

EMPTY_VISIBLE, EMPTY_FRAMES = 0.5, 5
"""A thing counts as gone if so many images show that share of the place it has left."""

SAME_PLACE_M = 0.5
"""A thing that was shifted by less need not be seen to have left."""


class Undetermined(Exception):  # noqa: N818 - an answer, not a failure
    """The images do not determine the answer."""


class ObservedTruth:
    """Answers about the k-th object of a truth; raises `Undetermined` where the images do not determine one.

    Counted for every state, with one place before them for the object in motion: in how many images of each traversal
    it is clear, how many pixels it has at best, and how many images show its place empty afterwards.
    """

    def __init__(self, truth: GroundTruth) -> None:
        self._objects = truth.objects
        self._end_ns = truth.traversals[-1].end_ns
        self._traversals = tuple(range(len(truth.traversals)))
        places = [0, *(len(thing.states) + 1 for thing in truth.objects)]
        self._first = np.cumsum(places, dtype=np.int64)
        until_ns = np.full(self._first[-1], np.iinfo(np.int64).max)
        for k, thing in enumerate(truth.objects):
            ends = [state.until_ns for state in thing.states]
            until_ns[self._first[k] + 1 : self._first[k + 1]] = [until_ns[0] if end is None else end for end in ends]
        self._clear = np.zeros((len(self._traversals), len(until_ns)), np.int64)
        self._pixels = np.zeros_like(self._clear)
        self._empty = np.zeros(len(until_ns), np.int64)
        for traversal in self._traversals:
            self._count(truth, traversal, until_ns)

    def _count(self, truth: GroundTruth, traversal: int, until_ns: IntArray) -> None:
        rows = truth.traversals[traversal].sightings
        stamps_ns = truth.traversals[traversal].stamps_ns[rows.frame]
        at = self._first[rows.object] + 1 + rows.state
        clear = rows.present & (rows.visible >= CLEAR_VISIBLE) & (rows.pixels >= CLEAR_PIXELS)
        left = ~rows.present & (rows.visible >= EMPTY_VISIBLE) & (stamps_ns >= until_ns[at])
        np.add.at(self._clear[traversal], at[clear], 1)
        np.maximum.at(self._pixels[traversal], at, rows.pixels)
        np.add.at(self._empty, at[left], 1)

    def now(self, k: int) -> TrueState | None:
        """Where an object stands when the last traversal ends, as far as it was ever seen there."""
        thing = self._objects[k]
        standing = thing.state_at(self._end_ns)
        if standing is None and any(way.stamps_ns[0] <= self._end_ns <= way.stamps_ns[-1] for way in thing.motions):
            raise Undetermined
        seen = [at for at in range(len(thing.states)) if self._seen(k, at, self._traversals)]
        for at in seen:
            if thing.states[at] is not standing and not self._has_left(k, at, standing):
                raise Undetermined
        return standing if any(thing.states[at] is standing for at in seen) else None

    def _has_left(self, k: int, at: int, standing: TrueState | None) -> bool:
        """Whether the images show that an object left a place, or hardly left it."""
        place = self._objects[k].states[at].centroid
        shifted = standing is not None and float(np.linalg.norm(standing.centroid - place)) < SAME_PLACE_M
        return shifted or int(self._empty[self._first[k] + 1 + at]) >= EMPTY_FRAMES

    def ever(self, k: int) -> TrueState | None:
        """The last place in which an object was seen."""
        return self._newest_seen(k, self._traversals)

    def during(self, k: int, traversal: int) -> TrueState | None:
        """The last place in which a traversal, by its index, saw an object."""
        return self._newest_seen(k, (traversal,))

    def earlier(self, k: int) -> TrueState | None:
        """The last place in which a traversal before the last one saw an object; with one traversal: `ever`."""
        if len(self._traversals) == 1:
            return self.ever(k)
        found = self._newest_seen(k, self._traversals[:-1])
        if found is None and len(self._objects[k].states) > 1 and self._newest_seen(k, self._traversals[-1:]):
            raise Undetermined
        return found

    def _newest_seen(self, k: int, traversals: Sequence[int]) -> TrueState | None:
        seen = [state for at, state in enumerate(self._objects[k].states) if self._seen(k, at, traversals)]
        if not seen and self._pixels[list(traversals), self._first[k]].max() >= GLIMPSE_PIXELS:
            raise Undetermined
        return seen[-1] if seen else None

    def _seen(self, k: int, state: int, traversals: Sequence[int]) -> bool:
        at = self._first[k] + 1 + state
        if self._clear[list(traversals), at].sum() >= CLEAR_FRAMES:
            return True
        if self._pixels[list(traversals), at].max() < GLIMPSE_PIXELS:
            return False
        raise Undetermined
