"""A world of upright boxes, rendered by ray-box intersection: exact depth, masks and detections for small tests.

The map frame is level, z = 0 is the floor. Times are given in seconds. Sizes are full lengths along x, y and z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.cameras import PinholeCamera, camera_to_json
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection, lift
from supermap_cli.mapping.objects import MapObject
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, cut_mask
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.sensing import MAIN_CAMERA

CAMERA = PinholeCamera(160, 120, 110.0, 110.0, 79.5, 59.5)
EPOCH_NS = 1_700_000_000_000_000_000
LEAST_PIXELS = 30
"""Things of which fewer pixels are seen are not detected."""

Point = tuple[float, float, float]


def ns(seconds: float) -> int:
    return EPOCH_NS + round(seconds * 1e9)


@dataclass(frozen=True)
class Thing:
    """A box of one colour. Without a label it is part of the room: seen, never detected."""

    label: str
    center: Point
    size: Point
    rgb: tuple[int, int, int] = (128, 128, 128)
    yaw: float = 0.0

    @property
    def box(self) -> Box3D:
        return Box3D(np.array(self.center, float), np.array(self.size, float), self.yaw)

    def at(self, x: float, y: float, z: float | None = None) -> Thing:
        """The same thing elsewhere, by default at the same height."""
        return replace(self, center=(x, y, self.center[2] if z is None else z))


FLOOR = Thing("", (0, 0, -0.05), (12, 12, 0.1), (190, 185, 175))
WALL = Thing("", (3.05, 0, 1.3), (0.1, 12, 2.8), (210, 210, 205))
ROOM = (FLOOR, WALL)

TABLE = Thing("dining table", (1.6, 0, 0.35), (0.8, 1.2, 0.7), (150, 100, 60))
CHAIR = Thing("chair", (1.6, 0, 0.4), (0.4, 0.4, 0.8), (40, 90, 160))
BOX = Thing("box", (1.6, 0, 0.2), (0.4, 0.4, 0.4), (200, 160, 90))
CUP = Thing("cup", (1.4, 0, 0.78), (0.12, 0.12, 0.16), (220, 60, 50))
PERSON = Thing("person", (1.8, 0, 0.85), (0.4, 0.5, 1.7), (60, 140, 70))


def looking(eye: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """`T_map_camera` of a level camera (optical frame: z forward, x right, y down) at `eye` that looks at `target`."""
    position = np.asarray(eye, float)
    forward = np.asarray(target, float) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return make_transform(np.column_stack([right, np.cross(forward, right), forward]), position)


@dataclass(frozen=True)
class Scene:
    """What a camera sees: `owner` (h, w) is the index of the thing at each pixel, -1 = nothing."""

    things: Sequence[Thing]
    keyframe: Keyframe
    owner: NDArray[np.int64]

    def mask(self, index: int) -> NDArray[np.bool_]:
        mask: NDArray[np.bool_] = self.owner == index
        return mask


def render(
    things: Sequence[Thing], T_map_camera: NDArray[np.float64], at_s: float = 0.0, camera: PinholeCamera = CAMERA
) -> Scene:
    """Depth along the optical axis and colour of the nearest thing on every pixel's ray (slab method)."""
    rays = camera.rays().reshape(-1, 3).astype(np.float64) @ T_map_camera[:3, :3].T
    nearest = np.full(len(rays), np.inf)
    owner = np.full(len(rays), -1)
    for index, thing in enumerate(things):
        depth = _hit(thing, T_map_camera[:3, 3], rays)
        closer = depth < nearest
        nearest[closer], owner[closer] = depth[closer], index
    colours = np.array([thing.rgb for thing in things] + [(0, 0, 0)], np.uint8)
    shape = (camera.height, camera.width)
    depth_m = np.where(np.isfinite(nearest), nearest, 0).astype(np.float32).reshape(shape)
    keyframe = Keyframe(ns(at_s), colours[owner].reshape(*shape, 3), depth_m, camera, T_map_camera, T_map_camera)
    return Scene(things, keyframe, owner.reshape(shape))


def _hit(thing: Thing, origin: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) how far along (n, 3) rays a box is first met, in units of the rays; inf where it is not."""
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    R_box_map = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    start, along, half = R_box_map @ (origin - thing.center), rays @ R_box_map.T, np.array(thing.size) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-half - start) / along, (half - start) / along
    enter, leave = np.fmin(one, other).max(axis=1), np.fmax(one, other).min(axis=1)
    return np.where((enter <= leave) & (enter > 0.05), enter, np.inf)


def detections_of(
    masks: Iterable[NDArray[np.bool_]],
    hypotheses: Iterable[Sequence[tuple[str, float]]],
    at_s: float = 0.0,
) -> Detections:
    """Detections with these masks and, for each, its labels with scores, best first."""
    regions: list[RegionMask] = [region for mask in masks if (region := cut_mask(mask)) is not None]
    boxes = [(r.u0, r.v0, r.u0 + r.pixels.shape[1] - 1, r.v0 + r.pixels.shape[0] - 1) for r in regions]
    labels = tuple(tuple(Hypothesis(*pair) for pair in one) for one in hypotheses)
    scores = np.array([one[0].score for one in labels], np.float32)
    return Detections(ns(at_s), np.array(boxes, np.float32).reshape(-1, 4), scores, labels, tuple(regions))


def detect(scene: Scene, at_s: float = 0.0, *, score: float = 0.8, blind_to: Iterable[str] = ()) -> Detections:
    """What a perfect detector finds."""
    blind = set(blind_to)
    seen = [
        i
        for i, thing in enumerate(scene.things)
        if thing.label and thing.label not in blind and (scene.owner == i).sum() >= LEAST_PIXELS
    ]
    return detections_of([scene.mask(i) for i in seen], [[(scene.things[i].label, score)] for i in seen], at_s)


def lifted(scene: Scene, index: int, label: str | None = None, *, score: float = 0.8) -> LiftedDetection:
    """One thing's detection in 3D."""
    found = detections_of([scene.mask(index)], [[(label or scene.things[index].label, score)]])
    (one,) = lift(scene.keyframe, depth_view(scene.keyframe, 6.0), found, np.array([-1]))
    return one


def small_record(keyframe: Keyframe, step_px: int = 4) -> KeyframeRecord:
    depth = encode_small_depth(keyframe, step_px)
    camera = camera_to_json(keyframe.camera)
    return KeyframeRecord(
        keyframe.stamp_ns, keyframe.T_map_base, keyframe.T_map_camera, camera, depth, step_px, None, detected=True
    )


def view_of(engine: MappingEngine, keyframe: Keyframe) -> KeyframeView:
    """Compare a keyframe with what the map has near by."""
    return engine.compare_depth(keyframe, engine.get_neighbor_objects(keyframe))


def integrate(
    engine: MappingEngine, view: KeyframeView, found: Detections | None, track_ids: NDArray[np.int64] | None = None
) -> None:
    """The steps of Algorithm 1 after the tracker's; `found` `None`: no detector looked."""
    lifted_detections: list[LiftedDetection] = []
    if found is not None:
        view, lifted_detections = engine.unproject(view, found, track_ids)
    matched = engine.obj_merge(view, lifted_detections)
    missed = engine.check_semantic_consistency(view, matched, found)
    engine.obj_negate(view, missed)
    engine.map_merge(view.stamp_ns, matched)


Detector = Callable[[Scene, float], Detections | None]


@dataclass
class Run:
    """A camera that goes through the world and maps it, as the pipeline does: 3 keyframes a second."""

    engine: MappingEngine = field(default_factory=MappingEngine)
    detector: Detector = detect
    traversal: int = 1
    at_s: float = 0.0
    target: Point = (1.6, 0.0, 0.4)
    last_view: KeyframeView | None = None

    def see(
        self,
        things: Sequence[Thing],
        eye: ArrayLike,
        target: ArrayLike | None = None,
        *,
        camera_id: str = MAIN_CAMERA,
        step_s: float = 1 / 3,
    ) -> Scene:
        """Map one keyframe; the next one comes `step_s` later."""
        scene = render(things, looking(eye, self.target if target is None else target), self.at_s)
        scene = replace(scene, keyframe=replace(scene.keyframe, camera_id=camera_id))
        view = view_of(self.engine, scene.keyframe)
        integrate(self.engine, view, self.detector(scene, self.at_s))
        self.engine.free_space.add_record(self.traversal, small_record(scene.keyframe))
        self.last_view = view
        self.at_s += step_s
        return scene

    def walk(self, things: Sequence[Thing], looks: int = 6, *, target: ArrayLike | None = None) -> None:
        """Keyframes from an arc of viewpoints, 1.2 m up, all looking at the target."""
        for y in np.linspace(-0.5, 0.5, looks):
            self.see(things, (0.0, float(y), 1.2), target)

    def pause(self, seconds: float) -> None:
        self.at_s += seconds

    def take(self) -> MapDelta:
        return self.engine.take_changes()

    @property
    def map(self) -> dict[int, MapObject]:
        """What is in the map."""
        return {obj.number: obj for obj in self.engine.objects if obj.confirmed}

    def standing(self, label: str | None = None) -> list[MapObject]:
        """What is in the map and stands there now."""
        here = [obj for obj in self.map.values() if obj.present and not obj.demoted]
        return here if label is None else [obj for obj in here if obj.label == label]


def distance_to(obj: MapObject, thing: Thing) -> float:
    """Between the centres of a mapped object's box and the true one, metres."""
    return float(np.linalg.norm(obj.shape.box.center - thing.center))
