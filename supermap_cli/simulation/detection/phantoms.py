"""Detections of what is not there: at random, and again and again at the same spot of a wall or a floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.simulation.detection.mask_errors import ellipse, tight
from supermap_cli.simulation.views import RenderedView
from supermap_cli.simulation.world import World, sample_surface
from supermap_cli.types.detections import RegionMask

_NEAREST_M, _FARTHEST_M = 0.6, 4.5
"""m, distances from which a spot is mistaken for a thing; chosen so that the largest spots, 0.6 m across, fit into the
image of the RGB-D rig, and its smallest, 0.16 m across, are over 15 pixels wide.
"""
_HIDDEN_BEHIND_M = 0.1
"""m of depth difference from which on something stands before a spot; chosen between the roughness of a wall and the
depth of the flattest furniture.
"""


@dataclass(frozen=True)
class Phantoms:
    """n spots on the building that look like things: `points_world` (n, 3), `radii_m` (n, 2) across and down, and what
    each looks like.
    """

    points_world: FloatArray
    radii_m: FloatArray
    labels: tuple[str, ...]

    @classmethod
    def scattered(cls, world: World, labels: tuple[str, ...], per_m2: float, rng: np.random.Generator) -> Phantoms:
        """Spots evenly at random over all fixtures."""
        if not world.fixtures or per_m2 <= 0:
            return cls(np.empty((0, 3)), np.empty((0, 2)), ())
        spacing_m = 0.25
        samples = [
            sample_surface(fixture.shape, spacing_m, seed=int(rng.integers(2**31)))[0] for fixture in world.fixtures
        ]
        points = np.concatenate(samples).astype(np.float64)
        count = min(len(points), int(rng.poisson(len(points) * spacing_m**2 * per_m2)))
        chosen = points[rng.choice(len(points), count, replace=False)]
        return cls(chosen, rng.uniform(0.08, 0.3, (count, 2)), tuple(map(str, rng.choice(labels, count))))

    def seen(self, view: RenderedView, camera: Camera, T_world_camera: FloatArray) -> list[tuple[int, RegionMask]]:
        """Which spots an image shows from 0.6 to 4.5 m with nothing before them, each with the region it covers."""
        if not len(self.points_world):
            return []
        points = transform_points(inverse(T_world_camera), self.points_world)
        pixels, on_image = camera.project(points)
        depth_m = camera.depth_of(points)
        shown = []
        for k in np.flatnonzero(on_image & (depth_m > _NEAREST_M) & (depth_m < _FARTHEST_M)):
            u, v = np.rint(pixels[k]).astype(int)
            if view.thing[v, u] == 0 and abs(float(view.depth_m[v, u]) - depth_m[k]) < _HIDDEN_BEHIND_M:
                radii_px = self.radii_m[k] * camera.focal_px() / depth_m[k]
                shown.append((int(k), _on_one_surface(view, (int(u), int(v)), radii_px)))
        return shown


def random_region(view: RenderedView, rng: np.random.Generator) -> RegionMask:
    """An ellipse somewhere in the image, 2 to 8 % of its height in radius, on one thing or on the building alone."""
    height, width = view.thing.shape
    center_uv = int(rng.integers(width)), int(rng.integers(height))
    return _on_one_surface(view, center_uv, rng.uniform(0.02, 0.08, 2) * height)


def _on_one_surface(view: RenderedView, center_uv: tuple[int, int], radii_px: FloatArray) -> RegionMask:
    round_about = ellipse(center_uv, radii_px, view.thing.shape)
    h, w = round_about.pixels.shape
    things = view.thing[round_about.v0 : round_about.v0 + h, round_about.u0 : round_about.u0 + w]
    region = RegionMask(round_about.u0, round_about.v0, round_about.pixels & (things == view.thing[center_uv[::-1]]))
    return tight(region) or round_about
