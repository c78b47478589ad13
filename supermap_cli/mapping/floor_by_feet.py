"""Where the floor is when no ray reaches it: where the feet of what stands on it are.

A LiDAR that looks down by 7 degrees from 0.75 m sees the floor from 6 m on, which in most rooms is behind a wall. But
the image shows where things end below. How far off that is the returns above tell; or, of what no ray reaches at all,
the views from several places that the robot passed: a foot seen under several angles is where these meet. Most things
that reach down beneath all rays stand on the floor: it is where most of them end.

Departs from the paper, which needs no floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.mapping.below_lidar_fov import MaskRays, covered_below, mask_rays
from supermap_cli.mapping.depth import DepthView
from supermap_cli.mapping.lifting import LiftedDetection, is_truncated
from supermap_cli.types.detections import Detections, RegionMask
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.parameters import parameter


@dataclass(frozen=True)
class FloorByFeetParameters:
    """What a foot is, and how many of them make a floor."""

    foot_px: int = parameter(2, "px", "rows at a mask's lower end that are its foot", "a mask's edge is off by so many")
    covered_gap_px: int = parameter(4, "px", "gap below a pixel within which another mask covers it", "as in lifting")
    max_covered_share: float = parameter(
        0.3, "1", "share of the foot that other masks may cover", "as in lifting", at_most=1.0
    )
    min_slope: float = parameter(
        0.1, "1", "fall per metre of the ray to a foot from which it tells a height: flatter ones graze", "geometry"
    )
    place_m: float = parameter(0.5, "m", "edge of the cells of places: many views of one foot are one", "chosen")
    same_m: float = parameter(
        0.08,
        "m",
        "how far feet on one floor may differ: a mask's edge of 1.5 pixels, and how deep a thing is",
        "chosen",
    )
    min_places: int = parameter(3, "1", "places at which something must end at the same height", "chosen", at_least=2)
    settled_places: int = parameter(
        12, "1", "places that agree from which on the floor is known for good", "bounds the time", at_least=2
    )
    min_views: int = parameter(2, "1", "views of a place that count", "two witnesses", at_least=1)
    edge_px: float = parameter(1.5, "px", "standard deviation of a mask's lower edge", "as in lifting")
    met_sigma_m: float = parameter(
        0.04, "m", "deviation of the height at which the rays to one foot meet, up to which it counts", "half `same_m`"
    )
    met_views: int = parameter(
        4, "1", "views of one foot whose rays must meet", "three unknowns, and a check", at_least=3
    )
    met_misfit: float = parameter(
        2.0, "1", "how far, in deviations, these rays may pass by one another: what moves has no place", "chosen"
    )


DEFAULT = FloorByFeetParameters()


@dataclass
class FootRays:
    """The rays to the foot of one track, summed up.

    From p (2,) on the plane, a ray to a foot at x (2,), h beneath, goes r = (x - p) / h aside for every metre down: r
    falls on p with a slope of -1 / h, by weighted least squares. (The other way round, where p depends on r, noise in
    r alone would make rays of a robot that stands still meet in its camera.)
    """

    views: int = 0
    weight: float = 0.0
    at: FloatArray = field(default_factory=lambda: np.zeros(3))
    aside: FloatArray = field(default_factory=lambda: np.zeros(2))
    squares: FloatArray = field(default_factory=lambda: np.zeros(3))

    def add(self, origin: FloatArray, aside: FloatArray, sigma: float) -> None:
        """Add a ray, and how exact its way aside is."""
        weight = 1 / sigma**2
        self.views += 1
        self.weight += weight
        self.at += weight * origin
        self.aside += weight * aside
        self.squares += weight * np.array([origin[:2] @ origin[:2], origin[:2] @ aside, aside @ aside])

    def foot_z(self, parameters: FloorByFeetParameters) -> float | None:
        """The height at which they meet; `None` where the robot hardly moved, or they do not meet."""
        if self.views < parameters.met_views:
            return None
        at, aside = self.at / self.weight, self.aside / self.weight
        about = np.array([at[:2] @ at[:2], at[:2] @ aside, aside @ aside])
        moved, along, turned = (float(x) for x in self.squares - self.weight * about)
        if along >= 0 or moved <= 0:
            return None
        height_m = -moved / along
        misfit = (turned - along**2 / moved) / (2 * self.views - 3)
        exact = height_m**2 / np.sqrt(moved) < parameters.met_sigma_m
        return float(at[2]) - height_m if exact and misfit < parameters.met_misfit**2 else None


@dataclass
class FloorByFeet:
    """The heights of feet seen so far, by place (a cell of the plane); of feet that no ray reaches, the rays to them by
    camera and track. `floor_z` is the height at which most of the places agree, once there are enough of them; when it
    is `settled` no more feet are taken in.
    """

    parameters: FloorByFeetParameters = DEFAULT
    heights_m: dict[tuple[int, int], list[float]] = field(default_factory=dict)
    rays: dict[tuple[str, int], FootRays] = field(default_factory=dict)
    floor_z: float | None = None
    settled: bool = False

    def add(
        self,
        keyframe: Keyframe,
        view: DepthView,
        detections: Detections,
        track_ids: IntArray,
        lifted: Sequence[LiftedDetection],
    ) -> None:
        """Take in the feet that a keyframe shows beneath all returns."""
        if self.settled:
            return
        lifted_as = {detection.index: detection for detection in lifted}
        masks = [mask for mask in detections.masks if mask is not None]
        for index, mask in enumerate(detections.masks):
            if mask is None or is_truncated(detections.boxes_xyxy[index], keyframe.camera):
                continue
            rays = foot_rays(keyframe, view, mask, masks, self.parameters)
            if rays is None:
                continue
            if index in lifted_as and lifted_as[index].measured:
                foot = foot_below(rays, lifted_as[index].points_map, 2 * view.spacing_px / keyframe.camera.focal_px())
                if foot is not None:
                    x, y = np.floor(foot[:2] / self.parameters.place_m).astype(int)
                    self.heights_m.setdefault((int(x), int(y)), []).append(float(foot[2]))
            elif track_ids[index] >= 0:
                track = self.rays.setdefault((keyframe.camera_id, int(track_ids[index])), FootRays())
                track.add(*_downwards(rays, self.parameters.edge_px / keyframe.camera.focal_px()))
        self._agree()

    def _agree(self) -> None:
        parameters = self.parameters
        measured = [heights for heights in self.heights_m.values() if len(heights) >= parameters.min_views]
        met = [height for rays in self.rays.values() if (height := rays.foot_z(parameters)) is not None]
        z = np.sort([float(np.median(heights)) for heights in measured] + met)
        agreeing = np.searchsorted(z, z + 2 * parameters.same_m, side="right") - np.arange(len(z))
        if not len(z) or agreeing.max() < parameters.min_places:
            return
        lowest = int(np.argmax(agreeing))
        self.floor_z = float(np.median(z[lowest : lowest + agreeing[lowest]]))
        self.settled = bool(agreeing[lowest] >= parameters.settled_places)


def foot_rays(
    keyframe: Keyframe,
    view: DepthView,
    mask: RegionMask,
    masks: Sequence[RegionMask],
    parameters: FloorByFeetParameters = DEFAULT,
) -> MaskRays | None:
    """The rays to where a mask ends below; `None` where returns reach that far down, or it is hidden."""
    if view.lowest is None:
        return None
    rows, columns = np.nonzero(mask.pixels)
    at_foot = rows > rows.max() - parameters.foot_px
    u, v = columns[at_foot] + mask.u0, rows[at_foot] + mask.v0
    if not view.lowest.below(u, v).all():
        return None
    if covered_below(mask, masks, u, v, parameters.covered_gap_px).mean() > parameters.max_covered_share:
        return None
    rays = mask_rays(keyframe.camera, keyframe.T_map_camera, u, v)
    return rays if float(np.median(rays.slope)) < -parameters.min_slope else None


def foot_below(rays: MaskRays, points_map: FloatArray, width_rad: float) -> FloatArray | None:
    """Where (3,) in the map the rays to a foot are as far off as the thing's points (n, 3) above it."""
    offsets = points_map[:, :2] - rays.origin[:2]
    aside = np.arctan2(offsets[:, 1], offsets[:, 0]) - float(np.median(rays.azimuth))
    aside = np.abs((aside + np.pi) % (2 * np.pi) - np.pi)
    above = aside <= max(float(np.ptp(rays.azimuth)), width_rad)
    if not above.any():
        return None
    distance_m = float(np.median(np.linalg.norm(offsets[above], axis=1)))
    foot: FloatArray = np.median(rays.at(np.full(len(rays.u), distance_m)), axis=0)
    return foot


def _downwards(rays: MaskRays, sigma_rad: float) -> tuple[FloatArray, FloatArray, float]:
    """Origin (3,), how far aside (2,) the middle ray goes for every metre down, and the deviation of that."""
    azimuth, slope = float(np.median(rays.azimuth)), float(np.median(rays.slope))
    aside = np.array([np.cos(azimuth), np.sin(azimuth)]) / -slope
    return rays.origin, aside, sigma_rad * (1 + 1 / slope**2)
