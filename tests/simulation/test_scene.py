import numpy as np
import pytest

from supermap_cli.geometry.se3 import transform_points
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.world import Fixture, Material, SimulatedThing, Stay, World
from support import simulated
from support.simulated import BOX_ARRIVES_NS, BOX_FROM, BOX_LEAVES_NS, BOX_TO, CUP_LEAVES_NS, SECOND_NS, START_NS

TABLE, CUP, CHAIR, BALL, BOX = range(1, 6)
DOWN, ABOVE = np.array([[0, 0, -1.0]]), np.array([0, 0, 2.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(simulated.small_world())


def test_an_empty_world_has_no_hits() -> None:
    hits = Scene(World((), (), ())).cast(0, np.zeros(3), DOWN, colour=True)
    assert np.isinf(hits.distance).all()
    assert hits.thing.tolist() == [0]
    assert not hits.rgb.any()
    assert not hits.slant_cos.any()


def test_no_rays_give_no_hits(scene: Scene) -> None:
    hits = scene.cast(START_NS, np.zeros(3), np.empty((0, 3)), colour=True)
    assert len(hits.distance) == len(hits.normals) == len(hits.rgb) == 0


def test_a_ray_at_a_ball_ends_where_the_sphere_equation_says(scene: Scene) -> None:
    center, origin = np.array([2.2, -1.5, 0.25]), np.array([0.5, -2.0, 1.4])
    aside = np.array([0.05, 0.02, 0.1])
    direction = center + aside - origin
    to_center = center - origin
    along = to_center @ direction / np.linalg.norm(direction)
    range_m = along - np.sqrt(0.25**2 - to_center @ to_center + along**2)
    hits = scene.cast(START_NS, origin, direction[None], colour=False)
    assert hits.thing.tolist() == [BALL]
    assert hits.rgb is None
    assert hits.distance[0] * np.linalg.norm(direction) == pytest.approx(range_m, abs=2e-3)  # flat triangles
    outward = origin + hits.distance[0] * direction - center
    assert hits.normals[0] @ outward / np.linalg.norm(outward) == pytest.approx(1, abs=0.01)
    cosine = -hits.normals[0] @ direction / np.linalg.norm(direction)
    assert hits.slant_cos[0] == pytest.approx(cosine, abs=1e-5)


def test_normals_point_to_the_origin_also_from_inside(scene: Scene) -> None:
    hits = scene.cast(START_NS, np.array([2.2, -1.5, 0.25]), np.array([[1.0, 0.2, 0]]), colour=True)
    assert hits.thing.tolist() == [BALL]
    assert hits.normals[0] @ [1.0, 0.2, 0] < 0


@pytest.mark.parametrize(("stamp_ns", "thing"), [(CUP_LEAVES_NS - 1, CUP), (CUP_LEAVES_NS, TABLE), (START_NS, CUP)])
def test_a_thing_is_there_for_as_long_as_it_stays(scene: Scene, stamp_ns: int, thing: int) -> None:
    assert scene.cast(stamp_ns, np.array([0.3, 0.1, 2.0]), DOWN, colour=False).thing.tolist() == [thing]


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.9])
def test_a_moving_body_is_where_it_is_between_its_stamps(scene: Scene, share: float) -> None:
    stamp_ns = BOX_LEAVES_NS + round(share * (BOX_ARRIVES_NS - BOX_LEAVES_NS))
    here = (1 - share) * np.array(BOX_FROM) + share * np.array(BOX_TO)
    beside = here + np.array([0, 0.5 if share < 0.5 else -0.5, 0])
    hits = scene.cast(stamp_ns, np.stack([here, beside]) + ABOVE, np.repeat(DOWN, 2, axis=0), colour=False)
    assert hits.thing.tolist() == [BOX, 0]
    assert hits.distance == pytest.approx([1.7, 2.0], abs=1e-5)


def test_what_stands_before_a_moving_body_hides_it() -> None:
    world = simulated.small_world()
    lid = SimulatedThing("lid", "lid", simulated.block((1, 1, 0.02), (0, 0, 0), simulated.WOOD))
    world = World(
        world.fixtures,
        (*world.things, lid),
        (*world.stays, Stay("lid", simulated.standing(-2.2, 0, 1.0))),
        world.motions,
    )
    hits = Scene(world).cast(START_NS + 3 * SECOND_NS, np.array([-2.2, 0, 2.0]), DOWN, colour=True)
    assert hits.thing.tolist() == [6]


def test_rays_may_share_an_origin_or_have_their_own(scene: Scene) -> None:
    rng = np.random.default_rng(0)
    origin, directions = np.array([-1.0, -1.0, 1.3]), rng.normal(size=(70_000, 3))
    shared = scene.cast(START_NS + 3 * SECOND_NS, origin, directions, colour=True)
    own = scene.cast(START_NS + 3 * SECOND_NS, np.tile(origin, (len(directions), 1)), directions, colour=True)
    assert {0, TABLE, CUP, CHAIR, BALL, BOX} == set(shared.thing.tolist())
    for name in ("distance", "thing", "normals", "slant_cos", "rgb"):
        np.testing.assert_array_equal(getattr(shared, name), getattr(own, name))


def test_a_texture_stays_on_its_thing_wherever_it_goes(scene: Scene) -> None:
    def from_above(stamp_ns: int, T_world_box: np.ndarray) -> np.ndarray:
        places = np.random.default_rng(1).uniform([-0.19, -0.14, 0.3], [0.19, 0.14, 0.3], (200, 3))
        origins = transform_points(T_world_box, places) + ABOVE / 2
        hits = scene.cast(stamp_ns, origins, np.repeat(DOWN, len(places), axis=0), colour=True)
        assert (hits.thing == BOX).all()
        return hits.rgb.astype(int)

    motion = scene.world.motions[0]
    before, after = motion.T_world_body
    on_the_way_ns = START_NS + 3 * SECOND_NS + 7
    standing = from_above(START_NS, before)
    assert standing.std(axis=0).min() > 10
    for stamp_ns, T in ((on_the_way_ns, motion.at(on_the_way_ns)), (BOX_ARRIVES_NS, after)):
        other = from_above(stamp_ns, T)
        assert (np.abs(other - standing).max(axis=1) <= 1).mean() > 0.97  # float rounding at the borders of texels


@pytest.mark.parametrize("pattern", ["plain", "speckle", "stripes", "checks", "grain", "print"])
def test_a_pattern_varies_a_material_about_its_colour(pattern: str) -> None:
    scene = Scene(World((_floor(Material((120, 110, 100), pattern, 0.1, 0.3)),), (), ()))
    directions = np.random.default_rng(0).uniform([-0.5, -0.5, -1], [0.5, 0.5, -1], (5000, 3))
    rgb = scene.cast(0, np.array([0, 0, 1.0]), directions, colour=True).rgb.astype(float)
    assert rgb.mean(axis=0) == pytest.approx([130, 119, 108], rel=0.15)
    assert (rgb.std(axis=0).max() > 8) == (pattern != "plain")


def test_far_patterns_are_blurred_not_grainy() -> None:
    scene = Scene(World((_floor(Material((120, 110, 100), "checks", 0.02, 0.5)),), (), ()))
    directions = np.random.default_rng(0).uniform([-0.5, -0.5, -1], [0.5, 0.5, -1], (5000, 3))
    near, far = (scene.cast(0, np.array([0, 0, z]), directions, colour=True).rgb.std() for z in (0.5, 30.0))
    assert far < near / 3


def test_things_of_one_material_look_alike_and_others_do_not() -> None:
    def seen(rgb: tuple[int, int, int]) -> np.ndarray:
        scene = Scene(World((_floor(Material(rgb, "print", 0.2, 0.5)),), (), ()))
        directions = np.random.default_rng(0).uniform([-0.2, -0.2, -1], [0.2, 0.2, -1], (2000, 3))
        return scene.cast(0, np.array([0, 0, 1.0]), directions, colour=True).rgb.mean(axis=1)

    first, again, other = seen((150, 150, 150)), seen((150, 150, 150)), seen((150, 150, 151))
    np.testing.assert_array_equal(first, again)
    assert np.corrcoef(first, other)[0, 1] < 0.5


def _floor(material: Material) -> Fixture:
    return Fixture("floor", simulated.block((40, 40, 0.1), (0, 0, -0.1), material))
