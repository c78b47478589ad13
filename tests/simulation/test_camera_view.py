import numpy as np
import pytest

from supermap_cli.geometry.cameras import Camera, EquirectangularCamera, FisheyeCamera, PinholeCamera
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.world import World, box_of
from support import simulated
from support.simulated import SECOND_NS, START_NS

PINHOLE = PinholeCamera(160, 120, 116.0, 116.0, 79.5, 59.5)
FISHEYE = FisheyeCamera(160, 120, 40.0, 40.0, 79.5, 59.5)
CAMERAS = {
    "pinhole": PINHOLE,
    "distorted": PinholeCamera(160, 120, 116.0, 114.0, 80.0, 58.0, (-0.1, 0.02, 0.001, -0.002)),
    "fisheye": FISHEYE,
    "panorama": EquirectangularCamera(240, 120),
}
T_WORLD_CAMERA = simulated.looking((-1.5, -2.2, 1.4), (0.2, 0.3, 0.6))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(simulated.small_world())


def points_of(camera: Camera, depth_m: np.ndarray, which: np.ndarray) -> np.ndarray:
    v, u = np.nonzero(which)
    points_camera = camera.back_project(np.column_stack([u, v]).astype(float), depth_m[v, u].astype(float))
    return transform_points(T_WORLD_CAMERA, points_camera)


def test_an_empty_world_is_black() -> None:
    view = render(Scene(World((), (), ())), PINHOLE, T_WORLD_CAMERA, START_NS)
    assert not any(image.any() for image in (view.depth_m, view.thing, view.slant_cos, view.rgb))


@pytest.mark.parametrize("name", CAMERAS)
def test_depth_back_projected_with_the_pose_lies_on_the_surface_of_the_thing_it_names(scene: Scene, name: str) -> None:
    camera = CAMERAS[name]
    view = render(scene, camera, T_WORLD_CAMERA, START_NS)
    assert set(np.unique(view.thing)) >= {0, 1, 2, 3}
    for thing in np.unique(view.thing):
        points = points_of(camera, view.depth_m, (view.thing == thing) & (view.depth_m > 0))
        assert simulated.distance_to_surfaces(scene.world, points, START_NS, thing).max() < 1e-4  # float32


@pytest.mark.parametrize("name", CAMERAS)
def test_what_the_image_shows_of_a_thing_lies_within_its_box(scene: Scene, name: str) -> None:
    camera = CAMERAS[name]
    view = render(scene, camera, T_WORLD_CAMERA, START_NS)
    for k, thing in enumerate(scene.world.things):
        stay = scene.world.stays_of(thing.id)[0]
        corners = box_of(thing.shape, stay.T_world_thing).corners()
        points = points_of(camera, view.depth_m, view.thing == k + 1)
        assert ((points > corners.min(axis=0) - 1e-4) & (points < corners.max(axis=0) + 1e-4)).all()


def test_a_things_mask_fills_its_projected_outline(scene: Scene) -> None:
    view = render(scene, PINHOLE, T_WORLD_CAMERA, START_NS)
    cup, stay = scene.world.things[1], scene.world.stays[1]
    corners = transform_points(inverse(T_WORLD_CAMERA) @ stay.T_world_thing, cup.shape.vertices)
    pixels, _ = PINHOLE.project(corners)
    v, u = np.nonzero(view.thing == 2)
    assert np.array([u.min(), v.min()]) == pytest.approx(pixels.min(axis=0), abs=1.0)
    assert np.array([u.max(), v.max()]) == pytest.approx(pixels.max(axis=0), abs=1.0)


def test_slant_is_the_cosine_between_ray_and_surface(scene: Scene) -> None:
    T_above = simulated.looking((1.5, 1.5, 2.0), (1.5, 1.5001, 0.0))
    view = render(scene, PINHOLE, T_above, START_NS)
    rays = PINHOLE.rays()
    straight = rays[..., 2] / np.linalg.norm(rays, axis=-1)
    floor = (view.thing == 0) & (np.abs(view.depth_m - 2.0) < 1e-3)
    assert floor.mean() > 0.5
    assert view.slant_cos[floor] == pytest.approx(straight[floor], abs=1e-4)


def test_a_fisheye_is_black_beyond_its_circle(scene: Scene) -> None:
    view = render(scene, FISHEYE, T_WORLD_CAMERA, START_NS)
    outside = ~FISHEYE.valid_mask()
    assert 0.01 < outside.mean() < 0.6
    assert not view.depth_m[outside].any()
    assert not view.rgb[outside].any()
    assert (view.depth_m[~outside] > 0).all()


def test_the_same_view_is_the_same_image(scene: Scene) -> None:
    stamp_ns = START_NS + 3 * SECOND_NS
    first = render(scene, CAMERAS["panorama"], T_WORLD_CAMERA, stamp_ns)
    render(scene, PINHOLE, T_WORLD_CAMERA, START_NS)
    again = render(Scene(simulated.small_world()), CAMERAS["panorama"], T_WORLD_CAMERA, stamp_ns)
    np.testing.assert_array_equal(first.rgb, again.rgb)
    np.testing.assert_array_equal(first.depth_m, again.depth_m)
