"""What a sensor meets in the world, exactly: the values that pass from the scene to the sensors' error models."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.geometry.arrays import BoolArray, Float32Array, Int32Array, IntArray, UInt8Array, check_shape


@dataclass(frozen=True)
class RayHits:
    """Where n rays end. `thing` (n,) int32: 0 = a fixture or nothing, k = `world.things[k - 1]`.

    `distance` (n,) float32 in lengths of the direction, inf where nothing is hit; `normals` (n, 3) float32 in the
    world, towards the ray's origin; `slant_cos` (n,) float32, the cosine between ray and normal, 0 where nothing is
    hit; `rgb` (n, 3) uint8, or `None` where colour was not asked for; `returns` (n,) whether the surface sends enough
    light back for its depth to be measured, `None` where all surfaces of the world do.
    """

    distance: Float32Array
    thing: Int32Array
    normals: Float32Array
    slant_cos: Float32Array
    rgb: UInt8Array | None
    returns: BoolArray | None = None


@dataclass(frozen=True)
class RenderedView:
    """One exact image: `depth_m` (h, w) float32 in the camera's measure, 0 = nothing there; `thing` (h, w) int32 as in
    `RayHits`; `slant_cos` (h, w) float32, the cosine between ray and surface normal; `rgb` (h, w, 3) uint8;
    `returns` (h, w) as in `RayHits`.
    """

    stamp_ns: int
    depth_m: Float32Array
    thing: Int32Array
    slant_cos: Float32Array
    rgb: UInt8Array
    returns: BoolArray | None = None

    def __post_init__(self) -> None:
        shape = self.depth_m.shape
        for name in ("thing", "slant_cos"):
            check_shape(name, getattr(self, name), shape)
        check_shape("rgb", self.rgb, (*shape, 3))


@dataclass(frozen=True)
class PlaceVisibility:
    """How one image shows n places: every stay of every thing (also when the thing is not there), and moving body.

    `thing` (n,) int64 indexes `world.things`, `stay` (n,) int64 the thing's stays in their order, -1 = in motion.
    `present` (n,): the thing is there now. `in_image` (n,) float32 is the share of the place's front side that falls
    into the image, `visible` (n,) float32 the share that does and that nothing stands before (whether or not the thing
    is there). `pixels` (n,) int64 is what the image really shows of the thing, 0 unless present; `distance_m` (n,)
    float32 from the camera to the place's centre.
    """

    thing: IntArray
    stay: IntArray
    present: BoolArray
    in_image: Float32Array
    visible: Float32Array
    pixels: IntArray
    distance_m: Float32Array

    def __post_init__(self) -> None:
        n = len(self.thing)
        for name in ("stay", "present", "in_image", "visible", "pixels", "distance_m"):
            check_shape(name, getattr(self, name), (n,))
