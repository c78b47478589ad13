"""What of the truth a map can be held to: the mapped traversals, where things stood, and what the images showed of it.

A map is judged as it is at its end, the last mapped keyframe. Traversals with no keyframe in the map do not count. An
object is *countable* in a place if some image, taken while it stood there and not after the end, showed at least
`COUNTABLE_PIXELS` pixels of it and `COUNTABLE_VISIBLE` of its front; what no image showed so well is *ignored*: it need
not be found, and finding it is no error (as COCO's crowds and ScanNet's void points).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.truth import GroundTruth, TrueObject, TrueSightings, TrueState, TrueTraversal

COUNTABLE_PIXELS = 100
COUNTABLE_VISIBLE = 0.2
IN_VIEW = 0.3
"""A place is in view of a keyframe that shows at least this share of its front side."""

SAME_IMAGE_NS = 50_000_000
"""A keyframe is the truth's image whose stamp is nearest, if not farther than this."""


@dataclass(frozen=True, eq=False)
class Place:
    """One stay of a true object. `well_seen_ns`: the first image that showed it well there; `None`: not countable."""

    object: TrueObject
    index: int
    well_seen_ns: int | None

    @property
    def state(self) -> TrueState:
        """The stay itself."""
        return self.object.states[self.index]

    @property
    def centroid(self) -> FloatArray:
        """Mean (3,) of the object's surface there."""
        return self.state.centroid

    @property
    def box(self) -> Box3D:
        """The object's box there."""
        return self.state.box

    @property
    def countable(self) -> bool:
        """Whether the images showed it well enough that a map should know of it."""
        return self.well_seen_ns is not None

    def overlaps(self, first_ns: int, last_ns: int) -> bool:
        """Whether the object stood there at any time of the closed interval."""
        since, until = self.state.since_ns, self.state.until_ns
        return (since is None or since <= last_ns) and (until is None or first_ns < until)


@dataclass(frozen=True)
class KnownTruth:
    """The truth as far as the mapped images show it.

    `places` (p) are all stays of all objects that began before the end. `stamps_ns` (k,) are the mapped keyframes that
    the truth has an image of; `visible` (p, k) is the share of each place's front that each shows, whether or not the
    object is there.
    """

    traversals: tuple[TrueTraversal, ...]
    end_ns: int | None
    places: tuple[Place, ...]
    stamps_ns: IntArray
    visible: Float32Array

    @cached_property
    def standing(self) -> tuple[int, ...]:
        """The places that are taken at the end."""
        end_ns = self.end_ns
        return tuple(k for k, place in enumerate(self.places) if end_ns is not None and place.state.covers(end_ns))

    @cached_property
    def present(self) -> BoolArray:
        """(p, k): the object stands in the place."""
        return self.present_at(self.stamps_ns)

    def present_at(self, stamps_ns: IntArray) -> BoolArray:
        """(p, n): the object stands in the place at other times (n,)."""
        first, last = np.iinfo(np.int64).min, np.iinfo(np.int64).max
        states = [place.state for place in self.places]
        since = np.array([first if each.since_ns is None else each.since_ns for each in states], np.int64)
        until = np.array([last if each.until_ns is None else each.until_ns for each in states], np.int64)
        taken: BoolArray = (since[:, None] <= stamps_ns[None, :]) & (stamps_ns[None, :] < until[:, None])
        return taken

    @cached_property
    def in_view(self) -> BoolArray:
        """(p, k): at least `IN_VIEW` of the place's front side is to be seen."""
        view: BoolArray = self.visible >= IN_VIEW
        return view

    @cached_property
    def in_view_with_object(self) -> BoolArray:
        """(p, k): in view, the object stands there, and this or an earlier image showed it well."""
        never = np.iinfo(np.int64).max
        seen_ns = [never if each.well_seen_ns is None else each.well_seen_ns for each in self.places]
        return self.in_view & self.present & (np.array(seen_ns, np.int64)[:, None] <= self.stamps_ns[None, :])

    @cached_property
    def in_view_empty(self) -> BoolArray:
        """(p, k): in view, and the object is not there."""
        return self.in_view & ~self.present

    def place_of(self, object_id: str, index: int | None) -> int | None:
        """The position in `places` of an object's stay; `None` where it is none or began after the end."""
        return self._positions.get((object_id, index)) if index is not None else None

    def position(self, place: Place) -> int:
        """Where a place stands in `places`."""
        return self._positions[place.object.id, place.index]

    @cached_property
    def _positions(self) -> dict[tuple[str, int], int]:
        return {(place.object.id, place.index): k for k, place in enumerate(self.places)}


def known_truth(estimate: EstimatedMap, truth: GroundTruth) -> KnownTruth:
    """Cut the truth down to what the map's keyframes can have shown."""
    keyframes_ns = np.sort(estimate.keyframes_ns)
    mapped = tuple(each for each in truth.traversals if len(_keyframes_in(each, keyframes_ns)))
    end_ns = int(keyframes_ns[-1]) if len(keyframes_ns) else None
    images = [_images_of(each, keyframes_ns) for each in mapped]
    stays = [
        (number, index)
        for number, each in enumerate(truth.objects)
        for index, state in enumerate(each.states)
        if end_ns is not None and (state.since_ns is None or state.since_ns <= end_ns)
    ]
    row_of = {stay: row for row, stay in enumerate(stays)}
    visible = [_visible(each.sightings, frames, row_of) for each, (frames, _) in zip(mapped, images, strict=True)]
    stamps_ns = np.concatenate([np.zeros(0, np.int64), *(stamps for _, stamps in images)])
    well_seen = _well_seen(mapped, end_ns)
    places = tuple(Place(truth.objects[number], index, well_seen.get((number, index))) for number, index in stays)
    return KnownTruth(
        traversals=mapped,
        end_ns=end_ns,
        places=places,
        stamps_ns=stamps_ns,
        visible=np.concatenate([np.zeros((len(places), 0), np.float32), *visible], axis=1),
    )


def _keyframes_in(traversal: TrueTraversal, keyframes_ns: IntArray) -> IntArray:
    return keyframes_ns[(keyframes_ns >= traversal.start_ns) & (keyframes_ns <= traversal.end_ns)]


def _images_of(traversal: TrueTraversal, keyframes_ns: IntArray) -> tuple[IntArray, IntArray]:
    """The truth's frames (k,) that a traversal's keyframes are, and the keyframes' stamps (k,)."""
    stamps_ns = _keyframes_in(traversal, keyframes_ns)
    known_ns = traversal.stamps_ns
    if not len(known_ns):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    after = np.clip(np.searchsorted(known_ns, stamps_ns), 0, len(known_ns) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(known_ns[before] - stamps_ns) < np.abs(known_ns[after] - stamps_ns), before, after)
    close = np.abs(known_ns[nearest] - stamps_ns) <= SAME_IMAGE_NS
    return nearest[close], stamps_ns[close]


def _visible(sightings: TrueSightings, frames: IntArray, row_of: dict[tuple[int, int], int]) -> Float32Array:
    """Visibility (p, k) of all places in the chosen frames of one traversal."""
    n_frames = int(max(sightings.frame.max(initial=-1), frames.max(initial=-1))) + 1
    visible = np.zeros((len(row_of), n_frames), np.float32)
    stays = zip(sightings.object.tolist(), sightings.state.tolist(), strict=True)
    rows = np.array([row_of.get(stay, -1) for stay in stays], np.int64)
    known = rows >= 0
    visible[rows[known], sightings.frame[known]] = sightings.visible[known]
    return visible[:, frames]


def _well_seen(traversals: tuple[TrueTraversal, ...], end_ns: int | None) -> dict[tuple[int, int], int]:
    """When each stay (object, state) was first shown well, where it was."""
    first: dict[tuple[int, int], int] = {}
    for traversal in traversals:
        seen = traversal.sightings
        stamps_ns = traversal.stamps_ns[seen.frame]
        well = seen.present & (seen.pixels >= COUNTABLE_PIXELS) & (seen.visible >= COUNTABLE_VISIBLE)
        well &= (seen.state >= 0) & (stamps_ns <= (-1 if end_ns is None else end_ns))
        for number, index, stamp_ns in zip(
            seen.object[well].tolist(), seen.state[well].tolist(), stamps_ns[well].tolist(), strict=True
        ):
            stay = (number, index)
            first[stay] = min(stamp_ns, first.get(stay, stamp_ns))
    return first
