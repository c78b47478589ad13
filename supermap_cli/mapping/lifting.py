"""Lifting: from a mask and a depth image to an object's points, without what masks bleed onto.

`Unproject` of the paper's algorithm 1, step (4). Departs from it in what of a mask is taken: its core, off depth edges,
of one cluster (`mask_core`, `clusters`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray, UInt8Array
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.percentiles import percentiles
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.mapping import voxel_map
from supermap_cli.mapping.below_lidar_fov import BelowLidarFovParameters
from supermap_cli.mapping.clusters import (
    ClusterParameters,
    cell_m,
    image_clusters,
    joined_clusters,
    main_cluster,
    occluded_continuation,
)
from supermap_cli.mapping.depth import DepthView, edge_step_m, pixel_scale
from supermap_cli.mapping.foreground import ForegroundParameters, foreground
from supermap_cli.mapping.lidar_foreground import LidarForegroundParameters
from supermap_cli.mapping.lidar_lifting import LidarLiftingParameters, LiftedPoints, lift_returns
from supermap_cli.mapping.mask_core import MaskCore, MaskCoreParameters, erosion_px, off_depth_edges
from supermap_cli.mapping.relief import Relief, ReliefParameters
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class LiftingParameters:
    """How many pixels of a mask become points, and when a mask counts as cut."""

    max_points: int = parameter(
        2000,
        "1",
        "pixels of one mask; more are thinned out evenly, for voxels get no fuller from them",
        "bounds the time",
        at_least=1,
    )
    min_points: int = parameter(12, "1", "pixels below which there is no evidence of a shape", TUNED)
    low_percentile: float = parameter(
        5.0,
        "%",
        "percentile of the points at which a detection's extent begins; it ends at 100 less",
        TUNED,
        at_most=50,
    )
    border_px: int = parameter(3, "px", "least distance from the image's border within which a box is truncated", TUNED)
    border_share: float = parameter(1 / 160, "1", "the same distance, as a share of the image's width", TUNED)


DEFAULT = LiftingParameters()


@dataclass(frozen=True)
class LiftingParameterSets:
    """The parameters of all that lifting does."""

    lifting: LiftingParameters = DEFAULT
    foreground: ForegroundParameters = field(default_factory=ForegroundParameters)
    mask_core: MaskCoreParameters = field(default_factory=MaskCoreParameters)
    clusters: ClusterParameters = field(default_factory=ClusterParameters)
    lidar_lifting: LidarLiftingParameters = field(default_factory=LidarLiftingParameters)
    lidar_foreground: LidarForegroundParameters = field(default_factory=LidarForegroundParameters)
    below_lidar_fov: BelowLidarFovParameters = field(default_factory=BelowLidarFovParameters)
    relief: ReliefParameters = field(default_factory=ReliefParameters)
    finest_voxel_m: float = voxel_map.DEFAULT.finest_voxel_m


DEFAULT_SETS = LiftingParameterSets()


@dataclass(frozen=True)
class LiftedDetection:
    """One detection in 3D.

    `points_map` (n, 3) metres with `rgb` (n, 3); `centroid_map` (3,); `mask` is the detector's own, `core` the part of
    it that is surely the object's: all but its rim, and of the rim what lies in the foreground (both on the region of
    `mask`); `rim_px` is how wide the rim is; `truncated` says that the image's border cuts it, so that its extent is
    only part of the object's; `voxel_m` is the edge of voxels that are not finer than what the sensor tells apart.
    `measured`: depth or returns tell where it is, and not its foot alone. `relief` is how far what the mask shows
    rises from the planes that go on beside it, `None` where that is not known.
    """

    index: int
    points_map: FloatArray
    rgb: UInt8Array
    centroid_map: FloatArray
    depth_m: float
    mask: RegionMask
    core: BoolArray
    rim_px: int
    box_xyxy: Float32Array
    score: float
    hypotheses: tuple[Hypothesis, ...]
    track_id: int
    truncated: bool
    voxel_m: float = voxel_map.DEFAULT.finest_voxel_m
    measured: bool = True
    relief: Relief | None = None
    parameters: LiftingParameters = DEFAULT

    def with_points(self, kept: BoolArray) -> LiftedDetection:
        """The same with those (n,) of its points."""
        points = self.points_map[kept]
        return replace(self, points_map=points, rgb=self.rgb[kept], centroid_map=percentiles(points, (50,))[0])

    @cached_property
    def extent_m(self) -> float:
        """Length of the longest side of what was seen, without the outermost twentieth."""
        percentile = self.parameters.low_percentile
        low, high = percentiles(self.points_map, (percentile, 100 - percentile))
        return float((high - low).max())


def lift(
    keyframe: Keyframe,
    view: DepthView,
    detections: Detections,
    track_ids: np.ndarray,
    sets: LiftingParameterSets = DEFAULT_SETS,
) -> list[LiftedDetection]:
    """Lift all detections that have a mask and enough depth under it, or, with a LiDAR, stand on the floor."""
    lifted = []
    masked = _masked(view, detections)
    for index in range(len(detections)):
        mask = detections.masks[index]
        if mask is None or not mask.pixels.any():
            continue
        rim_px = erosion_px(
            int(np.count_nonzero(mask.pixels)), pixel_scale(keyframe.camera, view.parameters), sets.mask_core
        )
        own = _own_part(view, mask, masked, rim_px, sets)
        if view.returns is None:
            one = _lift_core(keyframe, view, own, sets)
        else:
            one = lift_returns(
                keyframe,
                view,
                own.mask,
                own.core,
                [other for other in detections.masks if other is not None],
                masked=masked,
                parameters=sets.lidar_lifting,
                foreground_parameters=sets.lidar_foreground,
                surface_parameters=sets.foreground,
                cluster_parameters=sets.clusters,
                fov_parameters=sets.below_lidar_fov,
                relief_parameters=sets.relief,
            )
        if one is None:
            continue
        box = detections.boxes_xyxy[index]
        lifted.append(
            LiftedDetection(
                index,
                one.points_map,
                one.rgb,
                percentiles(one.points_map, (50,))[0],
                one.depth_m,
                own.mask,
                own.core,
                rim_px,
                box,
                float(detections.scores[index]),
                detections.hypotheses[index],
                int(track_ids[index]),
                is_truncated(box, keyframe.camera, sets.lifting),
                sets.finest_voxel_m if view.returns is None else view.returns.parameters.range_sigma_m,
                one.measured,
                one.relief,
                sets.lifting,
            )
        )
    return lifted


@dataclass(frozen=True)
class _OwnPart:
    """The mask of a thing after what depth says of the detector's; on its region, what of it is surely the thing's
    (`core`), and what is surely on no depth edge (`clear`); and its relief.
    """

    mask: RegionMask
    core: BoolArray
    clear: BoolArray
    relief: Relief | None = None


def _own_part(
    view: DepthView, mask: RegionMask, masked: BoolArray, rim_px: int, sets: LiftingParameterSets
) -> _OwnPart:
    whole = MaskCore(view, mask, rim_px, sets.mask_core)
    if view.returns is not None:
        return _OwnPart(mask, whole.pixels, whole.clear)
    found = foreground(view, mask, lambda: whole.pixels, masked, sets.foreground, relief_parameters=sets.relief)
    own = found.region
    if own is None:
        return _OwnPart(mask, whole.pixels, whole.clear, found.relief)
    return _OwnPart(own, own.pixels, _near_side(view, own), found.relief)


def _masked(view: DepthView, detections: Detections) -> BoolArray:
    """(h, w) the pixels in any mask."""
    masked = np.zeros(view.depth_m.shape, dtype=bool)
    for mask in detections.masks:
        if mask is not None:
            masked[mask.window] |= mask.pixels
    return masked


def _near_side(view: DepthView, mask: RegionMask) -> BoolArray:
    """(h, w) the mask's pixels that are not behind what is around them: no mixture of two depths."""
    depth, nearest = view.depth_m[mask.window], view.nearest_m[mask.window]
    near: BoolArray = mask.pixels & (depth > 0) & (depth - nearest < edge_step_m(depth, view.parameters))
    return near


def is_truncated(box_xyxy: Float32Array | FloatArray, camera: Camera, parameters: LiftingParameters = DEFAULT) -> bool:
    """Whether an image box reaches the border, which at the sides of a full turn is none."""
    margin = max(parameters.border_px, int(camera.width * parameters.border_share))
    if box_xyxy[1] < margin or box_xyxy[3] > camera.height - 1 - margin:
        return True
    return not camera.full_turn and bool(box_xyxy[0] < margin or box_xyxy[2] > camera.width - 1 - margin)


def _lift_core(
    keyframe: Keyframe,
    view: DepthView,
    own: _OwnPart,
    sets: LiftingParameterSets,
) -> LiftedPoints | None:
    parameters, mask = sets.lifting, own.mask
    usable = np.ascontiguousarray(own.core & (view.depth_m[mask.window] > 0))
    doubtful = np.flatnonzero(usable & ~own.clear)
    usable.ravel()[doubtful] = off_depth_edges(view, *_pixels_of(mask, doubtful))
    chosen = np.flatnonzero(usable)
    if len(chosen) < parameters.min_points:
        return None
    if len(chosen) > parameters.max_points:
        chosen = chosen[np.linspace(0, len(chosen) - 1, parameters.max_points).astype(np.int64)]
    v, u = _pixels_of(mask, chosen)
    depth_m = view.depth_m[v, u].astype(np.float64)
    points_camera = keyframe.camera.back_project(np.column_stack([u, v]).astype(np.float64), depth_m)
    in_image = image_clusters(usable, chosen)
    clusters = joined_clusters(points_camera, cell_m(_median(depth_m), sets.clusters), in_image)
    main = main_cluster(points_camera, clusters, sets.clusters)
    main |= occluded_continuation(view, (u, v), points_camera, clusters, main, parameters=sets.clusters)
    if np.count_nonzero(main) < parameters.min_points:
        return None
    points_map = transform_points(keyframe.T_map_camera, points_camera[main])
    rgb = keyframe.rgb[v[main], u[main]]
    return LiftedPoints(points_map, rgb, _median(depth_m[main]), measured=True, relief=own.relief)


def _pixels_of(mask: RegionMask, positions: IntArray) -> tuple[IntArray, IntArray]:
    """The image's rows and columns (n,) of positions (n,) on a mask's region."""
    rows, columns = np.divmod(positions, mask.pixels.shape[1])
    return rows + mask.v0, columns + mask.u0


def _median(values: FloatArray) -> float:
    return float(percentiles(values, (50,))[0])
