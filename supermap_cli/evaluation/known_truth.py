"""The part of the ground truth that a map can be scored against: mapped traversals, object places, their visibility.

A map is judged as it is at its end, the last mapped keyframe. Traversals with no keyframe in the map do not count. An
object is *countable* in a place if some image, taken while it stood there and not after the end, showed at least
`MIN_COUNTABLE_PIXELS` pixels of it and `MIN_COUNTABLE_SHARE` of its front; what no image showed so well is *ignored*:
it need not be found, and finding it is no error (as COCO's crowds and ScanNet's void points). Only images near a mapped
keyframe count, within `MAX_KEYFRAME_OFFSET_NS`: a map cannot know what the others showed. Where the robot has several
cameras, a keyframe is an image of its own camera, and images that several of them took at once are one view.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.truth import GroundTruth, TrueObject, TrueSightings, TrueState, TrueTraversal

MIN_COUNTABLE_PIXELS = 100
"""Pixels of an object that an image must show for it to be countable. Chosen."""
MIN_COUNTABLE_SHARE = 0.2
"""Share of an object's front side that an image must show for it to be countable. Chosen."""
MIN_IN_VIEW_SHARE = 0.3
"""Share of a place's front side that a keyframe must show to have the place in view. Chosen."""

IMAGE_TOLERANCE_NS = 50_000_000
"""Nanoseconds (50 ms) up to which a keyframe and the nearest image of the truth are the same image. Chosen."""

MAX_KEYFRAME_OFFSET_NS = 250_000_000
"""Nanoseconds (0.25 s) to the nearest keyframe within which an image counts as seen by the map. Chosen."""

MAX_UNMAPPED_MARGIN_NS = 2_000_000_000
"""Nanoseconds (2 s) between the first or last image and keyframe of a traversal; beyond, it is mapped in part. Chosen.
"""


@dataclass(frozen=True, eq=False)
class Place:
    """One state of a true object, as a place.

    `well_seen_ns`: stamp of the first image that showed it well there; `None`: not countable.
    """

    object: TrueObject
    index: int
    well_seen_ns: int | None

    @property
    def state(self) -> TrueState:
        """The true state."""
        return self.object.states[self.index]

    @property
    def centroid(self) -> FloatArray:
        """The centre (3,) of the whole object's box: the paper annotates boxes (sec. V)."""
        return self.state.box.center

    @property
    def box(self) -> Box3D:
        """The whole object's box there."""
        return self.state.box

    @property
    def countable(self) -> bool:
        """Whether images showed it well enough that a map should contain it."""
        return self.well_seen_ns is not None

    def overlaps(self, first_ns: int, last_ns: int) -> bool:
        """Whether the object stood there at any time of the closed interval."""
        since, until = self.state.since_ns, self.state.until_ns
        return (since is None or since <= last_ns) and (until is None or first_ns < until)


@dataclass(frozen=True)
class KnownTruth:
    """The truth as far as the mapped images show it.

    `places` (p) are all stays of all objects that began before the end. `stamps_ns` (k,) are the mapped keyframes that
    the truth has an image of, those of several cameras with one stamp being one; `visible` (p, k) is the share of each
    place's front that each shows, whether or not the object is there.

    Of the truth's traversals, the map has keyframes of `traversals`, but only of a part of those in `partly_mapped`,
    and none of those in `not_mapped` (names).
    """

    traversals: tuple[TrueTraversal, ...]
    not_mapped: tuple[str, ...]
    partly_mapped: tuple[str, ...]
    end_ns: int | None
    places: tuple[Place, ...]
    stamps_ns: IntArray
    visible: Float32Array

    @property
    def gap(self) -> str | None:
        """Which of the truth's traversals the map lacks, in words; `None` if none.

        Truth about all traversals together (seen surfaces, answers) cannot score a map of fewer.
        """
        lacks = [*self.not_mapped, *(f"a part of {name}" for name in self.partly_mapped)]
        return f"not judged: the map lacks {' and '.join(lacks)}" if lacks else None

    @cached_property
    def standing(self) -> tuple[int, ...]:
        """The places that are occupied at the end."""
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
        since = np.array([first if state.since_ns is None else state.since_ns for state in states], np.int64)
        until = np.array([last if state.until_ns is None else state.until_ns for state in states], np.int64)
        occupied: BoolArray = (since[:, None] <= stamps_ns[None, :]) & (stamps_ns[None, :] < until[:, None])
        return occupied

    @cached_property
    def in_view(self) -> BoolArray:
        """(p, k): the keyframe shows at least `MIN_IN_VIEW_SHARE` of the place's front side."""
        view: BoolArray = self.visible >= MIN_IN_VIEW_SHARE
        return view

    @cached_property
    def in_view_with_object(self) -> BoolArray:
        """(p, k): in view, the object stands there, and this or an earlier image showed it well."""
        never = np.iinfo(np.int64).max
        seen_ns = [never if place.well_seen_ns is None else place.well_seen_ns for place in self.places]
        return self.in_view & self.present & (np.array(seen_ns, np.int64)[:, None] <= self.stamps_ns[None, :])

    @cached_property
    def in_view_empty(self) -> BoolArray:
        """(p, k): in view, and the object is not there: not yet, or no more."""
        return self.in_view & ~self.present

    @cached_property
    def in_view_left(self) -> BoolArray:
        """(p, k): in view, and the object has left it."""
        last = np.iinfo(np.int64).max
        until = [last if place.state.until_ns is None else place.state.until_ns for place in self.places]
        return self.in_view_empty & (np.array(until, np.int64)[:, None] <= self.stamps_ns[None, :])

    def place_of(self, object_id: str, index: int | None) -> int | None:
        """Index into `places` of an object's state; `None` where there is none or it began after the end."""
        return self._index_of_place.get((object_id, index)) if index is not None else None

    def position(self, place: Place) -> int:
        """Index of a place in `places`."""
        return self._index_of_place[place.object.id, place.index]

    @cached_property
    def _index_of_place(self) -> dict[tuple[str, int], int]:
        return {(place.object.id, place.index): k for k, place in enumerate(self.places)}


def known_truth(estimate: EstimatedMap, truth: GroundTruth) -> KnownTruth:
    """Reduce the truth to what the map's keyframes can have shown."""
    keyframes_ns = np.sort(estimate.keyframes_ns)
    by_camera = keyframes_by_camera(estimate)
    mapped = tuple(traversal for traversal in truth.traversals if len(_keyframes_in(traversal, keyframes_ns)))
    end_ns = int(keyframes_ns[-1]) if len(keyframes_ns) else None
    images = [images_of(traversal, by_camera) for traversal in mapped]
    states = [
        (number, index)
        for number, obj in enumerate(truth.objects)
        for index, state in enumerate(obj.states)
        if end_ns is not None and (state.since_ns is None or state.since_ns <= end_ns)
    ]
    row_of = {state_key: row for row, state_key in enumerate(states)}
    visible = [
        _at_once(_visible(traversal.sightings, frames, row_of), stamps_ns)
        for traversal, (frames, stamps_ns) in zip(mapped, images, strict=True)
    ]
    stamps_ns = np.concatenate([np.zeros(0, np.int64), *(np.unique(stamps_ns) for _, stamps_ns in images)])
    well_seen = _well_seen(mapped, by_camera)
    places = tuple(Place(truth.objects[number], index, well_seen.get((number, index))) for number, index in states)
    return KnownTruth(
        traversals=mapped,
        not_mapped=tuple(
            traversal.name for traversal in truth.traversals if not len(_keyframes_in(traversal, keyframes_ns))
        ),
        partly_mapped=tuple(traversal.name for traversal in mapped if _is_partly_mapped(traversal, keyframes_ns)),
        end_ns=end_ns,
        places=places,
        stamps_ns=stamps_ns,
        visible=np.concatenate([np.zeros((len(places), 0), np.float32), *visible], axis=1),
    )


def _keyframes_in(traversal: TrueTraversal, keyframes_ns: IntArray) -> IntArray:
    return keyframes_ns[(keyframes_ns >= traversal.start_ns) & (keyframes_ns <= traversal.end_ns)]


def _is_partly_mapped(traversal: TrueTraversal, keyframes_ns: IntArray) -> bool:
    """Whether keyframes are missing at a mapped traversal's beginning or end."""
    own_ns = _keyframes_in(traversal, keyframes_ns)
    images_ns = traversal.stamps_ns if len(traversal.stamps_ns) else np.array([traversal.start_ns, traversal.end_ns])
    return bool(
        own_ns[0] - images_ns[0] > MAX_UNMAPPED_MARGIN_NS or images_ns[-1] - own_ns[-1] > MAX_UNMAPPED_MARGIN_NS
    )


def keyframes_by_camera(estimate: EstimatedMap) -> dict[str | None, IntArray]:
    """Stamps of the mapped keyframes, ascending: of all of them (`None`), and of each camera where these are known."""
    cameras = np.array(estimate.keyframe_cameras)
    own = {camera_id: np.unique(estimate.keyframes_ns[cameras == camera_id]) for camera_id in np.unique(cameras)}
    return {None: np.unique(estimate.keyframes_ns), **own}


def images_of(traversal: TrueTraversal, by_camera: Mapping[str | None, IntArray]) -> tuple[IntArray, IntArray]:
    """The truth's frames (k,) that a traversal's keyframes (`keyframes_by_camera`) are, and the keyframes' stamps (k,),
    ascending.
    """
    frames, stamps_ns = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for own_frames, keyframes_ns in _cameras(traversal, by_camera):
        own_ns = _keyframes_in(traversal, keyframes_ns)
        if not len(own_frames):
            continue
        images_ns = traversal.stamps_ns[own_frames]
        nearest = _nearest(own_ns, images_ns)
        close = np.abs(images_ns[nearest] - own_ns) <= IMAGE_TOLERANCE_NS
        frames.append(own_frames[nearest[close]])
        stamps_ns.append(own_ns[close])
    order = np.argsort(np.concatenate(stamps_ns), kind="stable")
    return np.concatenate(frames)[order], np.concatenate(stamps_ns)[order]


def _cameras(traversal: TrueTraversal, by_camera: Mapping[str | None, IntArray]) -> Iterator[tuple[IntArray, IntArray]]:
    """The frames of each camera of a traversal, and the stamps of its keyframes; of all cameras as one where the truth
    has only one, or does not say. A map that does not know its keyframes' cameras is taken to have mapped all of them.
    """
    if not traversal.camera_ids:
        yield np.arange(len(traversal.stamps_ns)), by_camera[None]
        return
    cameras, none = np.array(traversal.camera_ids), by_camera[None][:0]
    for camera_id in dict.fromkeys(traversal.camera_ids):
        own = by_camera.get(camera_id, none) if len(by_camera) > 1 else by_camera[None]
        yield np.flatnonzero(cameras == camera_id), own


def _at_once(visible: Float32Array, stamps_ns: IntArray) -> Float32Array:
    """(p, m) of (p, k) the best of all images that share a stamp (k,), ascending."""
    if not len(stamps_ns):
        return visible
    _, first = np.unique(stamps_ns, return_index=True)
    best: Float32Array = np.maximum.reduceat(visible, first, axis=1)
    return best


def _nearest(stamps_ns: IntArray, others_ns: IntArray) -> IntArray:
    """(n,): which of others (m,), ascending and at least one, is nearest to each of the stamps (n,)."""
    after = np.clip(np.searchsorted(others_ns, stamps_ns), 0, len(others_ns) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(others_ns[before] - stamps_ns) < np.abs(others_ns[after] - stamps_ns), before, after)


def _visible(sightings: TrueSightings, frames: IntArray, row_of: dict[tuple[int, int], int]) -> Float32Array:
    """Visibility (p, k) of all places in the chosen frames of one traversal."""
    n_frames = int(max(sightings.frame.max(initial=-1), frames.max(initial=-1))) + 1
    visible = np.zeros((len(row_of), n_frames), np.float32)
    states = zip(sightings.object.tolist(), sightings.state.tolist(), strict=True)
    rows = np.array([row_of.get(state_key, -1) for state_key in states], np.int64)
    known = rows >= 0
    visible[rows[known], sightings.frame[known]] = sightings.visible[known]
    return visible[:, frames]


def _well_seen(
    traversals: tuple[TrueTraversal, ...], by_camera: Mapping[str | None, IntArray]
) -> dict[tuple[int, int], int]:
    """When each stay (object, state) was first shown well, where it was, by an image near a keyframe."""
    first: dict[tuple[int, int], int] = {}
    for traversal in traversals:
        seen = traversal.sightings
        stamps_ns = traversal.stamps_ns[seen.frame]
        well = seen.present & (seen.pixels >= MIN_COUNTABLE_PIXELS) & (seen.visible >= MIN_COUNTABLE_SHARE)
        well &= (seen.state >= 0) & _near_keyframe(traversal, by_camera)[seen.frame]
        well &= stamps_ns <= by_camera[None][-1]
        for number, index, stamp_ns in zip(
            seen.object[well].tolist(), seen.state[well].tolist(), stamps_ns[well].tolist(), strict=True
        ):
            state_key = (number, index)
            first[state_key] = min(stamp_ns, first.get(state_key, stamp_ns))
    return first


def _near_keyframe(traversal: TrueTraversal, by_camera: Mapping[str | None, IntArray]) -> BoolArray:
    """(f,): which images of a traversal were taken within `MAX_KEYFRAME_OFFSET_NS` of a keyframe of their camera."""
    near = np.zeros(len(traversal.stamps_ns), bool)
    for frames, keyframes_ns in _cameras(traversal, by_camera):
        if len(keyframes_ns):
            images_ns = traversal.stamps_ns[frames]
            near[frames] = np.abs(keyframes_ns[_nearest(images_ns, keyframes_ns)] - images_ns) <= MAX_KEYFRAME_OFFSET_NS
    return near
