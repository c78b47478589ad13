"""Pictures of things on walls that a detector takes for the things in most views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.simulation.detection.mask_errors import parts_across_seam
from supermap_cli.simulation.views import RenderedView
from supermap_cli.simulation.world import World, box_of, sample_surface
from supermap_cli.types.detections import RegionMask, cut_mask

_PICTURED = ("armchair", "backpack", "chair", "lamp", "laptop", "potted plant", "tv", "vase")
_ROOM_M2 = 20.0  # floor for which the number of posters is given: a room
_SAMPLED_M = 0.25  # between two places where one may hang
_HALF_SIZE_M = ((0.2, 0.3), (0.25, 0.42))  # m, least and most, across and up: from A2 (0.42 x 0.59 m) to A1
_LOWEST_M, _HIGHEST_M = 0.9, 1.5  # m, of their middles: where a camera 1 m up that looks slightly down sees them
_APART_M = 1.2  # m between two of them, so that one view seldom shows both; chosen
_FREE_M = 0.3  # m, half a poster, free of furniture, doors and windows round a middle
_INTO_ROOM_M = 0.3  # m before a wall, more than any wall is thick, to tell its inner from its outer face
_NEAREST_M, _FARTHEST_M = 0.6, 4.5  # m, as of phantoms: distances from which one is mistaken for a thing
_FLAT_M = 0.03  # m, a frame's thickness, off the wall's plane: still on it
_STRETCH = (
    1.5  # ratio, chosen: most stretching of what lies at the side of a wide image, or above the middle of a panorama
)
_RECALL_SPREAD = (
    0.1  # share of views, so that recalls are .6 to .8: by which the posters' recalls lie above or below the mean
)


@dataclass(frozen=True)
class Posters:
    """n rectangles on walls: `middles` (n, 3) and `normals` (n, 3) in the world, `half_sizes_m` (n, 2) across and up,
    `recalls` (n,) shares of the views in which each is taken for a thing, and the `labels` of these.
    """

    middles: FloatArray
    normals: FloatArray
    half_sizes_m: FloatArray
    recalls: FloatArray
    labels: tuple[str, ...]

    @classmethod
    def hung(cls, world: World, per_room: int, recall: float, rng: np.random.Generator) -> Posters:
        """So many on the walls for each 20 m2 of floor, and so many at least; none where there is no wall."""
        walls = [fixture.shape for fixture in world.fixtures if fixture.label == "wall"]
        if per_room <= 0 or not walls:
            return cls(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2)), np.empty(0), ())
        sampled = [sample_surface(wall, _SAMPLED_M, seed=int(rng.integers(2**31))) for wall in walls]
        points, normals = (np.concatenate([samples[k] for samples in sampled]).astype(np.float64) for k in (0, 1))
        suits = (np.abs(normals[:, 2]) < 0.1) & (points[:, 2] > _LOWEST_M) & (points[:, 2] < _HIGHEST_M)
        floor_m2, indoors = _indoors(world, points + _INTO_ROOM_M * normals)
        goes_on = _goes_on(points, normals)
        suits &= indoors
        points, normals, free = points[suits], normals[suits], goes_on[suits]
        free &= _free(world, points)
        order = rng.permutation(len(points))
        order = order[np.argsort(~free[order], kind="stable")]
        count = min(per_room * max(1, round(floor_m2 / _ROOM_M2)), len(points))
        chosen = _apart(points, order, count)
        low, high = (np.array([side[k] for side in _HALF_SIZE_M]) for k in (0, 1))
        recalls = np.clip(recall + rng.uniform(-_RECALL_SPREAD, _RECALL_SPREAD, count), 0, 1)
        labels = tuple(map(str, rng.permutation(np.resize(_PICTURED, max(count, len(_PICTURED))))[:count]))
        return cls(points[chosen], normals[chosen], rng.uniform(low, high, (count, 2)), recalls, labels)

    def seen(self, view: RenderedView, camera: Camera, T_world_camera: FloatArray) -> list[tuple[int, RegionMask]]:
        """Which of them an image shows from 0.6 to 4.5 m with nothing before their middle, each with its pixels."""
        if not len(self.middles):
            return []
        middles = transform_points(inverse(T_world_camera), self.middles)
        pixels, on_image = camera.project(middles)
        distance_m = np.linalg.norm(middles, axis=1)
        faces = ((T_world_camera[:3, 3] - self.middles) * self.normals).sum(axis=1) > 0
        near = on_image & faces & (distance_m > _NEAREST_M) & (distance_m < _FARTHEST_M)
        if not near.any():
            return []
        shown = []
        for k in np.flatnonzero(near):
            u, v = np.rint(pixels[k]).astype(int)
            reach_px = _reach_px(float(np.hypot(*self.half_sizes_m[k])), float(distance_m[k]), camera)
            covered = np.zeros(view.thing.shape, bool)
            window = _window(u, v, reach_px, camera)
            surface = _surface(view, camera, T_world_camera, window)
            covered[window] = self._covers(int(k), surface) & (view.thing[window] == 0)
            if covered[v, u]:
                shown.append((int(k), _largest_part(covered, full_turn=camera.full_turn)))
        return shown

    def _covers(self, k: int, points: FloatArray) -> BoolArray:
        """(h, w) whether points (h, w, 3) in the world lie on the k-th."""
        normal, (half_across, half_up) = self.normals[k], self.half_sizes_m[k]
        offsets = points - self.middles[k]
        across = offsets @ np.array([-normal[1], normal[0], 0.0])
        on_plane = np.abs(offsets @ normal) < _FLAT_M
        covers: BoolArray = on_plane & (np.abs(across) < half_across) & (np.abs(offsets[..., 2]) < half_up)
        return covers


def _reach_px(reach_m: float, distance_m: float, camera: Camera) -> float:
    """How far from its middle something may reach in the image; all over it where it is that near."""
    if distance_m <= reach_m:
        return float(camera.width)
    return _STRETCH * camera.focal_px() * reach_m / (distance_m - reach_m)


def _window(u: int, v: int, reach_px: float, camera: Camera) -> tuple[slice, slice]:
    """The rows and columns round a pixel; all columns where they go across the seam of a full turn."""
    low_v, high_v = max(int(v - reach_px), 0), min(int(v + reach_px) + 2, camera.height)
    low_u, high_u = int(u - reach_px), int(u + reach_px) + 2
    if camera.full_turn and (low_u < 0 or high_u > camera.width):
        return slice(low_v, high_v), slice(0, camera.width)
    return slice(low_v, high_v), slice(max(low_u, 0), min(high_u, camera.width))


def _surface(view: RenderedView, camera: Camera, T_world_camera: FloatArray, window: tuple[slice, slice]) -> FloatArray:
    """(h, w, 3) where the rays of a window's pixels end in the world."""
    v, u = np.mgrid[window].astype(np.float64)
    depth_m = view.depth_m[window].astype(np.float64)
    points = camera.back_project(np.column_stack([u.ravel(), v.ravel()]), depth_m.ravel())
    in_world: FloatArray = transform_points(T_world_camera, points).reshape(*depth_m.shape, 3)
    return in_world


def _largest_part(covered: BoolArray, *, full_turn: bool) -> RegionMask:
    mask = cut_mask(covered)
    if mask is None:
        raise ValueError("an empty mask")
    parts = parts_across_seam(mask, covered.shape[1]) if full_turn else [mask]
    return max(parts, key=lambda part: int(part.pixels.sum()))


def _indoors(world: World, points: FloatArray) -> tuple[float, BoolArray]:
    """The floor's area, and which points (n, 3) are above it; without a floor all are."""
    floors = [fixture.shape.bounds for fixture in world.fixtures if fixture.label == "floor"]
    if not floors:
        return 0.0, np.ones(len(points), bool)
    area_m2 = sum(float(np.prod((high - low)[:2])) for low, high in floors)
    above = [((points > low) & (points < high))[:, :2].all(axis=1) for low, high in floors]
    return area_m2, np.any(above, axis=0)


def _goes_on(points: FloatArray, normals: FloatArray) -> BoolArray:
    """(n,) where the wall goes on to both sides by a poster's half width."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 - keeps start-up light

    tree = cKDTree(np.column_stack([points, normals]))
    sideways = _HALF_SIZE_M[0][1] * np.column_stack([-normals[:, 1], normals[:, 0], np.zeros(len(normals))])
    found = [tree.query(np.column_stack([points + way * sideways, normals]))[0] for way in (-1, 1)]
    both: BoolArray = np.max(found, axis=0) < _SAMPLED_M
    return both


def _free(world: World, points: FloatArray) -> BoolArray:
    """(n,) which points have no thing, door or window about them, at any time."""
    free = np.ones(len(points), bool)
    boxes = [box_of(world.thing(stay.thing_id).shape, stay.T_world_thing) for stay in world.stays]
    boxes += [box_of(f.shape, np.eye(4)) for f in world.fixtures if f.label not in {"wall", "floor", "ceiling"}]
    for box in boxes:
        c, s = np.cos(box.yaw), np.sin(box.yaw)
        offsets = (points - box.center) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        free &= (np.abs(offsets) > box.size / 2 + _FREE_M).any(axis=1)
    return free


def _apart(points: FloatArray, order: np.ndarray, count: int) -> list[int]:
    """The first of an order that lie apart; then, if these are too few, the first of the others."""
    chosen: list[int] = []
    for k in order.tolist():
        if len(chosen) < count and all(np.linalg.norm(points[k] - points[other]) >= _APART_M for other in chosen):
            chosen.append(k)
    return (chosen + [k for k in order.tolist() if k not in set(chosen)])[:count]
