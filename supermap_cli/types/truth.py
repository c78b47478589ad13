"""Ground truth of a recording or of several of one place, as values. `truth_file` reads and writes them as JSON.

The world frame is level (z up) and belongs to the truth; maps are aligned with it by the robot's true poses. Times are
sensor time in nanoseconds. Everything in here may come from the simulator or from an annotated data set.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, check_shape
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import check_transform, transform_points

TrueKind = Literal["object", "person"]
TrueChangeKind = Literal["appeared", "disappeared", "moved"]


@dataclass(frozen=True)
class TrueState:
    """The half-open interval [since_ns, until_ns) in which an object stood in one place, open where `None`.

    `box` is tight along the object's own axes, `centroid` (3,) the mean of its surface; `on` names the object it stands
    on, in or hangs from.
    """

    since_ns: int | None
    until_ns: int | None
    T_world_object: FloatArray
    box: Box3D
    centroid: FloatArray
    on: str | None = None

    def __post_init__(self) -> None:
        check_transform("T_world_object", self.T_world_object)
        check_shape("centroid", self.centroid, (3,))

    def covers(self, stamp_ns: int) -> bool:
        """Whether the object stands there at that time."""
        since, until = self.since_ns, self.until_ns
        return (since is None or since <= stamp_ns) and (until is None or stamp_ns < until)


@dataclass(frozen=True)
class TrueMotion:
    """A moving object (carried, or a person walking): centres (k, 3) in the world at `stamps_ns` (k,)."""

    stamps_ns: IntArray
    centers_world: FloatArray

    def __post_init__(self) -> None:
        check_shape("centers_world", self.centers_world, (len(self.stamps_ns), 3))


@dataclass(frozen=True)
class TrueObject:
    """One real object. `states` are in the order of time; a person has none, only motions (one a passage).

    `surface_object` (n, 3) float32 are samples of its surface in its own frame, `surface_seen` (n,) says which of them
    any image of any visit really showed.
    """

    id: str
    label: str
    kind: TrueKind
    states: tuple[TrueState, ...]
    motions: tuple[TrueMotion, ...]
    surface_object: Float32Array
    surface_seen: BoolArray

    def __post_init__(self) -> None:
        check_shape("surface_object", self.surface_object, (None, 3))
        check_shape("surface_seen", self.surface_seen, (len(self.surface_object),))

    def state_at(self, stamp_ns: int) -> TrueState | None:
        """Its state at a time; `None` when it is gone, not yet there, or moving."""
        return next((state for state in self.states if state.covers(stamp_ns)), None)

    def surface_world(self, state: TrueState, *, only_seen: bool = True) -> FloatArray:
        """Samples (n, 3) of its surface in the world in a state."""
        chosen = self.surface_object[self.surface_seen] if only_seen else self.surface_object
        return transform_points(state.T_world_object, chosen.astype(np.float64))


@dataclass(frozen=True)
class TrueSurface:
    """A part of the building (wall, floor, ...): `points_world` (n, 3) float32 samples that some image showed."""

    label: str
    points_world: Float32Array

    def __post_init__(self) -> None:
        check_shape("points_world", self.points_world, (None, 3))


@dataclass(frozen=True)
class TrueSightings:
    """Visibility of each place in each image, n rows: a struct of arrays.

    `frame` (n,) indexes the traversal's `stamps_ns`, `object` (n,) the truth's `objects`, `state` (n,) the object's
    states (-1: in motion). `present` (n,): the object is there. `in_image` and `visible` (n,) float32 in [0, 1]: the
    share of the place's front side that falls into the image, and the share that is not occluded either, whether or not
    the object is there. `pixels` (n,): the object's pixels in the image. `distance_m` (n,) float32 to the camera.
    Rows with in_image = 0 are left out.
    """

    frame: IntArray
    object: IntArray
    state: IntArray
    present: BoolArray
    in_image: Float32Array
    visible: Float32Array
    pixels: IntArray
    distance_m: Float32Array

    def __post_init__(self) -> None:
        n = len(self.frame)
        for name in ("object", "state", "present", "in_image", "visible", "pixels", "distance_m"):
            check_shape(name, getattr(self, name), (n,))


@dataclass(frozen=True)
class TrueTraversal:
    """One recording: its file's name, its odometry's frame in the world, and the true poses and sightings of those
    images that a detector looked at: `stamps_ns` (f,), `T_world_base` (f, 4, 4).

    `fingerprint` is that of the whole recording (`recordings.fingerprint`), whatever its path; `None` where it is not
    known, as it may be in a truth that was annotated by hand. Where the robot has several cameras, whose images may
    share a stamp, `camera_ids` (f,) tells which of them took each image; else it is ().
    """

    name: str
    recording: str
    start_ns: int
    end_ns: int
    T_world_odom: FloatArray
    stamps_ns: IntArray
    T_world_base: FloatArray
    sightings: TrueSightings
    fingerprint: str | None = None
    camera_ids: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_transform("T_world_odom", self.T_world_odom)
        check_shape("T_world_base", self.T_world_base, (len(self.stamps_ns), 4, 4))
        if len(self.camera_ids) not in {0, len(self.stamps_ns)}:
            raise ValueError(f"{len(self.camera_ids)} cameras of {len(self.stamps_ns)} images")


@dataclass(frozen=True)
class TrueChange:
    """A change of an object at `stamp_ns` (`until_ns`: when it stood again, for moves).

    `from_state` and `to_state` index its states; `distance_m` is how far its centroid moved. `between` names the two
    traversals it happened between, or twice the one it happened in.
    """

    kind: TrueChangeKind
    object_id: str
    from_state: int | None
    to_state: int | None
    stamp_ns: int
    until_ns: int
    distance_m: float | None
    between: tuple[str, str]


@dataclass(frozen=True)
class TrueQuestion:
    """A question in plain words and the ids of all objects that answer it; () where nothing does."""

    text: str
    answer: tuple[str, ...]


@dataclass(frozen=True)
class GroundTruth:
    """Ground truth of one place and its traversals (in the order of time).

    `levels` names the levels of the axes that the simulator was told to vary (`simulation.domains`).
    """

    scenario: str
    seed: int
    traversals: tuple[TrueTraversal, ...]
    objects: tuple[TrueObject, ...]
    surfaces: tuple[TrueSurface, ...]
    changes: tuple[TrueChange, ...]
    questions: tuple[TrueQuestion, ...]
    levels: Mapping[str, str] = field(default_factory=dict)

    def object(self, object_id: str) -> TrueObject:
        """The object of an id."""
        return next(obj for obj in self.objects if obj.id == object_id)

    def traversal(self, name: str) -> TrueTraversal:
        """The traversal of a name."""
        return next(traversal for traversal in self.traversals if traversal.name == name)
