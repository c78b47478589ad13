"""What a camera sees of the world, exactly: a ray a pixel, through its middle."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera, FisheyeCamera, PinholeCamera
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import RenderedView

_AHEAD = np.array([0, 0, 1], np.float32)


def render(
    scene: Scene,
    camera: PinholeCamera | FisheyeCamera | EquirectangularCamera,
    T_world_camera: FloatArray,
    stamp_ns: int,
) -> RenderedView:
    """The image of a camera at `T_world_camera` (4, 4), the optical frame in the world, as if taken in an instant.

    Pixels that see nothing (outside `camera.valid_mask()`, or out of the world) are black, with depth and thing 0.
    """
    rays, valid = camera.rays(), camera.valid_mask()
    if not valid.all():
        rays = np.where(valid[..., None], rays, _AHEAD)
    R_t = T_world_camera[:3, :3].T.astype(np.float32)
    pixel_rad = 1 / camera.focal_px()
    hits = scene.cast(stamp_ns, T_world_camera[:3, 3], rays.reshape(-1, 3) @ R_t, colour=True, pixel_rad=pixel_rad)
    if hits.rgb is None:
        raise ValueError("a view needs colour")
    depth_m = np.where(np.isfinite(hits.distance), hits.distance, np.float32(0)).reshape(valid.shape)
    thing, slant_cos = hits.thing.reshape(valid.shape), hits.slant_cos.reshape(valid.shape)
    rgb = hits.rgb.reshape(*valid.shape, 3)
    if not valid.all():
        for image in (depth_m, thing, slant_cos, rgb):
            image[~valid] = 0
    returns = None if hits.returns is None else hits.returns.reshape(valid.shape)
    return RenderedView(stamp_ns, depth_m, thing, slant_cos, rgb, returns)
