import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import transform_points
from supermap_cli.simulation.recording.place_visibility import SurfaceCoverage, VisibilityModel
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import PlaceVisibility
from supermap_cli.simulation.world import Motion, SimulatedThing, Stay, World
from support import simulated
from support.simulated import BOX_ARRIVES_NS, CUP_LEAVES_NS, SECOND_NS, START_NS

CAMERA = PinholeCamera(320, 240, 232.0, 232.0, 159.5, 119.5)
PANORAMA = EquirectangularCamera(480, 240)
AHEAD = simulated.looking((0, -3, 0.5), (0, 0, 0.5))


def sights_of(
    world: World,
    T_world_camera: np.ndarray = AHEAD,
    stamp_ns: int = START_NS,
    camera: PinholeCamera | EquirectangularCamera = CAMERA,
    farthest_m: float = 8.0,
) -> PlaceVisibility:
    view = render(Scene(world), camera, T_world_camera, stamp_ns)
    return VisibilityModel(world, farthest_m=farthest_m).measure(view, camera, T_world_camera)


def cube(name: str, size: tuple[float, float, float] = (0.5, 0.5, 0.5)) -> SimulatedThing:
    return SimulatedThing(name, "cube", simulated.block(size, (0, 0, 0), simulated.RED))


def with_screen(width_m: float, x: float, target_until_ns: int | None = None) -> World:
    """A cube at the origin and a screen before it."""
    things = (cube("target"), cube("screen", (width_m, 0.02, 2.0)))
    stays = (
        Stay("target", simulated.standing(0, 0, 0.25), until_ns=target_until_ns),
        Stay("screen", simulated.standing(x, -1, 0)),
    )
    return World((), things, stays)


def test_an_empty_world_has_no_sights() -> None:
    assert len(sights_of(World((), (), ())).thing) == 0


@pytest.mark.parametrize("camera", [CAMERA, PANORAMA])
def test_a_lone_thing_in_view_is_fully_visible(camera: PinholeCamera | EquirectangularCamera) -> None:
    world = World((), (cube("target"),), (Stay("target", simulated.standing(0, 0, 0.25)),))
    visibility = sights_of(world, camera=camera)
    assert visibility.present.tolist() == [True]
    assert visibility.in_image.tolist() == visibility.visible.tolist() == [1.0]
    assert visibility.distance_m == pytest.approx([3.0])
    focal_px = camera.focal_px()
    assert visibility.pixels[0] == pytest.approx((0.5 * focal_px / 2.75) ** 2, rel=0.08)


@pytest.mark.parametrize(("x", "visible"), [(-0.5, 0.5), (0.5, 0.5), (0.0, 0.0), (2.0, 1.0)])
@pytest.mark.parametrize("until_ns", [None, START_NS - 1], ids=["there", "gone"])
def test_what_stands_before_a_place_hides_it_whether_the_thing_is_there_or_not(
    x: float, visible: float, until_ns: int | None
) -> None:
    visibility = sights_of(with_screen(1.0, x, until_ns))
    assert visibility.in_image[0] == 1
    assert visibility.visible[0] == pytest.approx(visible, abs=0.1)
    assert visibility.present[0] == (until_ns is None)
    assert (visibility.pixels[0] > 0) == (until_ns is None and visible > 0)


def test_a_thing_does_not_hide_itself() -> None:
    world = simulated.small_world()
    alone = World(world.fixtures, world.things[:1], world.stays[:1])
    visibility = sights_of(alone, simulated.looking((-1.5, -2.2, 1.4), (0, 0, 0.5)))
    assert visibility.visible.tolist() == [1.0]


@pytest.mark.parametrize("camera", [CAMERA, PANORAMA])
def test_the_empty_place_on_the_table_is_visible(camera: PinholeCamera | EquirectangularCamera) -> None:
    T_world_camera = simulated.looking((-0.8, -1.6, 1.3), (0.3, 0.1, 0.75))
    visibility = sights_of(simulated.small_world(), T_world_camera, CUP_LEAVES_NS, camera)
    assert not visibility.present[1]
    assert visibility.pixels[1] == 0
    assert visibility.visible[1] > 0.95


@pytest.mark.parametrize(
    ("at", "in_image"),
    [((0, -6.0), 0.0), ((0, 20.0), 0.0), ((-3 * 159.5 / 232, 0), 0.5)],
    ids=["behind", "far", "edge"],
)
def test_what_the_image_does_not_reach_is_not_in_it(at: tuple[float, float], in_image: float) -> None:
    world = World((), (cube("target"),), (Stay("target", simulated.standing(*at, 0.25)),))
    visibility = sights_of(world)
    assert visibility.in_image[0] == pytest.approx(in_image, abs=0.25 if in_image else 0)
    assert visibility.visible[0] == visibility.in_image[0]


@pytest.mark.parametrize(
    ("stamp_ns", "rows"),
    [
        (START_NS, [(0, True), (1, False)]),
        (START_NS + 3 * SECOND_NS, [(0, False), (1, False), (-1, True)]),
        (BOX_ARRIVES_NS, [(0, False), (1, True)]),
    ],
)
def test_a_carried_thing_has_a_row_for_each_place_and_one_on_its_way(
    stamp_ns: int, rows: list[tuple[int, bool]]
) -> None:
    T_world_camera = simulated.looking((0.5, -2.2, 1.8), (-2.2, 0, 0.2))
    visibility = sights_of(simulated.small_world(), T_world_camera, stamp_ns)
    box = visibility.thing == 4
    assert list(zip(visibility.stay[box].tolist(), visibility.present[box].tolist(), strict=True)) == rows
    assert ((visibility.pixels[box] > 0) == visibility.present[box]).all()


def test_a_person_of_several_bodies_is_one_row() -> None:
    stamps_ns = np.array([START_NS, START_NS + SECOND_NS])
    limbs = [simulated.block((0.2, 0.2, 0.8), (0, 0, z), simulated.RED) for z in (0, 0.8)]
    places = np.stack([simulated.standing(-0.5, 0, 0), simulated.standing(0.5, 0, 0)])
    person = SimulatedThing("person-1", "person", limbs[0])
    world = World((), (person,), (), tuple(Motion("person-1", limb, stamps_ns, places) for limb in limbs))
    visibility = sights_of(world, simulated.looking((0, -4, 0.8), (0, 0, 0.8)), START_NS + SECOND_NS // 2)
    assert (visibility.thing.tolist(), visibility.stay.tolist(), visibility.present.tolist()) == ([0], [-1], [True])
    assert visibility.visible.tolist() == [1.0]
    assert visibility.distance_m == pytest.approx([4.0], abs=1e-3)


def test_coverage_grows_by_what_a_view_shows_and_only_by_that() -> None:
    world = simulated.small_world()
    scene, coverage = Scene(world), SurfaceCoverage(world, spacing_m=0.03, fixture_spacing_m=0.2, farthest_m=8.0)
    assert not any(seen.any() for _, seen in (*coverage.things, *coverage.fixtures))
    T_front = simulated.looking((-1.5, -2.2, 1.4), (0.2, 0.3, 0.6))
    coverage.add(render(scene, CAMERA, T_front, START_NS), CAMERA, T_front)
    once = [seen for _, seen in coverage.things]
    assert [seen.any() for seen in once] == [True, True, True, False, False]
    top = world.things[0].shape.bounds[1][2]
    points, seen = coverage.things[0]
    on_top = points[:, 2] > top - 1e-4
    assert seen[on_top].mean() > 0.9
    below = np.abs(points[:, 2] - (top - 0.04)) < 1e-4
    assert seen[below].mean() < 0.02
    T_back = simulated.looking((1.8, 2.2, 1.4), (0, 0, 0.6))
    coverage.add(render(scene, CAMERA, T_back, START_NS), CAMERA, T_back)
    for before, (_, after) in zip(once, coverage.things, strict=True):
        assert (after >= before).all()
    assert sum(after.sum() for _, after in coverage.things) > 1.2 * sum(before.sum() for before in once)


def test_what_counts_as_seen_lies_where_some_pixel_saw_it() -> None:
    world = simulated.small_world()
    scene, coverage = Scene(world), SurfaceCoverage(world, spacing_m=0.05, fixture_spacing_m=0.2, farthest_m=8.0)
    T_world_camera = simulated.looking((0, -2.2, 1.5), (0.2, 0.9, 0.4))
    coverage.add(render(scene, CAMERA, T_world_camera, START_NS), CAMERA, T_world_camera)
    for k, stay in ((0, 0), (1, 1), (2, 2)):
        points, seen = coverage.things[k]
        placed = transform_points(world.stays[stay].T_world_thing, points[seen].astype(float))
        towards = placed - T_world_camera[:3, 3]
        hits = scene.cast(START_NS, T_world_camera[:3, 3], towards, colour=False)
        assert (hits.distance > 1 - 0.05).mean() > 0.98  # a pixel wide off at outlines
        assert seen.any()


def test_coverage_follows_a_thing_to_its_next_place() -> None:
    world = simulated.small_world()
    scene, coverage = Scene(world), SurfaceCoverage(world, spacing_m=0.02, fixture_spacing_m=0.5, farthest_m=8.0)
    seen = []
    for stamp_ns in (START_NS, BOX_ARRIVES_NS - 1, BOX_ARRIVES_NS):
        T_world_camera = simulated.looking((0.5, -2.2, 1.8), (-2.2, 0, 0.2))
        coverage.add(render(scene, CAMERA, T_world_camera, stamp_ns), CAMERA, T_world_camera)
        seen.append(int(coverage.things[4][1].sum()))
    assert 0 < seen[0] == seen[1] < seen[2]
