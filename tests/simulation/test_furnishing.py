"""Buildings and what is in them: watertight, different by seed, nothing in anything else, and room to go round."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.open3d_loader import load_open3d
from supermap_cli.simulation.building_plan import BuildingPlan
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.world import Fixture, sample_surface
from supermap_cli.simulation.worlds.building import AREA_M2, CORRIDOR, make_building
from supermap_cli.simulation.worlds.furnishing import Interior, RecipeLine
from supermap_cli.simulation.worlds.places import AlongWall, Hung, Inside, On, OnFloor, PlacedPiece
from supermap_cli.simulation.worlds.room_recipes import TINY_ROOM, office_recipes
from supermap_cli.simulation.worlds.shapes import HANGING_LABELS
from supermap_cli.simulation.worlds.shapes.primitives import signed_volume_m3

ROOMS = ("office", "meeting room", "kitchen")
SEEDS = (0, 1, 4)


@cache
def building(seed: int) -> tuple[BuildingPlan, tuple[Fixture, ...]]:
    return make_building(np.random.default_rng(seed), ROOMS)


@cache
def office(seed: int) -> Interior:
    plan, fixtures = building(seed)
    interior = Interior(plan, fixtures)
    rng = np.random.default_rng(seed)
    interior.furnish(office_recipes(rng), rng)
    return interior


def empty_room() -> Interior:
    return Interior(*make_building(np.random.default_rng(0), ["office"]))


@pytest.mark.parametrize("seed", range(8))
def test_a_building_is_an_office_of_plausible_size(seed: int) -> None:
    plan, _ = building(seed)
    assert {room.name for room in plan.rooms} == {*ROOMS, CORRIDOR}
    sizes = np.array([room.high - room.low for room in plan.rooms if room.name != CORRIDOR])
    assert (sizes >= 3.99).all()
    assert (sizes <= 7.01).all()
    assert AREA_M2[0] <= sum(np.prod(room.high - room.low) for room in plan.rooms) <= AREA_M2[1]
    assert 2.6 <= plan.height_m <= 2.9
    for first, second in combinations(plan.rooms, 2):
        assert (np.maximum(first.low, second.low) >= np.minimum(first.high, second.high) + 0.1).any()


@pytest.mark.parametrize("seed", range(8))
def test_every_doorway_joins_a_room_and_the_corridor_through_the_wall(seed: int) -> None:
    plan, _ = building(seed)
    assert {doorway.first for doorway in plan.doorways} == set(ROOMS)
    for doorway in plan.doorways:
        assert doorway.width_m >= 0.9
        for name, side in ((doorway.first, -1), (doorway.second, 1)):
            assert plan.room(name).holds(doorway.center + side * 0.15 * doorway.through)
        assert plan.room_at(doorway.center) is None


def test_different_seeds_give_different_buildings_and_the_same_seed_the_same() -> None:
    outlines = {tuple(np.concatenate([room.high for room in building(seed)[0].rooms]).round(3)) for seed in range(8)}
    assert len(outlines) == 8
    again, fixtures = make_building(np.random.default_rng(3), ROOMS)
    assert again.height_m == building(3)[0].height_m
    for one, other in zip(fixtures, building(3)[1], strict=True):
        assert np.array_equal(one.shape.vertices, other.shape.vertices)
        assert one.shape.materials == other.shape.materials


@pytest.mark.parametrize("names", [ROOMS, ROOMS[:2], ROOMS[:1]])
def test_a_building_has_all_its_parts(names: tuple[str, ...]) -> None:
    plan, fixtures = make_building(np.random.default_rng(2), names)
    labels = [fixture.label for fixture in fixtures]
    assert set(labels) == {"wall", "floor", "ceiling", "door", "window"}
    assert labels.count("door") == len(names)
    assert len(plan.rooms) == (1 if len(names) == 1 else len(names) + 1)
    assert all(signed_volume_m3(fixture.shape.vertices[fixture.shape.triangles]) > 0 for fixture in fixtures)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_no_ray_leaves_the_building(seed: int) -> None:
    """From points in every room, in all directions; each one ends within the building's outer walls."""
    plan, fixtures = building(seed)
    o3d = load_open3d()
    scene = o3d.t.geometry.RaycastingScene()
    for fixture in fixtures:
        scene.add_triangles(fixture.shape.vertices.astype(np.float32), fixture.shape.triangles.astype(np.uint32))
    rng = np.random.default_rng(seed)
    origins = np.concatenate(
        [rng.uniform([*room.low + 0.3, 0.3], [*room.high - 0.3, 2.3], (20, 3)) for room in plan.rooms]
    ).repeat(2000, axis=0)
    directions = rng.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    rays = np.concatenate([origins, directions], axis=1).astype(np.float32)
    distance = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    assert np.isfinite(distance).all()
    ends = origins + distance[:, None] * directions
    low = np.min([room.low for room in plan.rooms], axis=0) - 0.25
    high = np.max([room.high for room in plan.rooms], axis=0) + 0.25
    assert (ends[:, :2] >= low).all()
    assert (ends[:, :2] <= high).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_an_office_holds_exactly_its_things(seed: int) -> None:
    things = office(seed).things
    assert len(things) == len({thing.id for thing in things}) == 41
    assert len({thing.label for thing in things}) >= 18


@pytest.mark.parametrize("seed", SEEDS)
def test_no_two_things_share_any_space(seed: int) -> None:
    """By points of every surface: none lies in any part of another thing, by more than a contact."""
    placed = office(seed).placed
    for one, other in combinations(placed, 2):
        if one.outline.meet(other.outline):
            assert not _deepest_point_inside(one, other) > 0.004
            assert not _deepest_point_inside(other, one) > 0.004


def _deepest_point_inside(one: PlacedPiece, other: PlacedPiece) -> float:
    """How deep surface points of one thing lie within the parts' boxes of another."""
    shape = one.piece.shape.moved(one.T_world_thing)
    points = sample_surface(shape, 0.03)[0].astype(np.float64)
    solids = other.solids
    c, s = np.cos(solids.yaw), np.sin(solids.yaw)
    offset = points[:, None] - solids.centers[None]
    local = np.stack([c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0], offset[..., 2]])
    depth = (solids.sizes.T[:, None] / 2 - np.abs(local)).min(axis=0)
    return float(depth.max())


@pytest.mark.parametrize("seed", SEEDS)
def test_things_stand_on_the_floor_on_their_hosts_or_hang(seed: int) -> None:
    interior = office(seed)
    placed = {placed_thing.thing_id: placed_thing for placed_thing in interior.placed}
    for placed_thing in interior.placed:
        z = placed_thing.T_world_thing[2, 3]
        if placed_thing.on is not None:
            host = placed[placed_thing.on]
            levels = [host.T_world_thing[2, 3] + surface.z_m for surface in host.piece.surfaces]
            assert min(abs(z - level) for level in levels) < 1e-9
            assert host.box.footprint().min() - 0.001 <= placed_thing.T_world_thing[0, 3]
        elif placed_thing.piece.label in HANGING_LABELS:
            assert 0.7 < z < 2.0
        else:
            assert z == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_hanging_things_touch_a_wall_that_is_there(seed: int) -> None:
    interior = office(seed)
    for placed_thing in interior.placed:
        if placed_thing.piece.label in HANGING_LABELS:
            room = interior.plan.room(placed_thing.room)
            inwards = -placed_thing.T_world_thing[:2, 1]
            behind = placed_thing.T_world_thing[:2, 3] - 0.02 * inwards
            assert not room.holds(behind)
            assert room.holds(placed_thing.T_world_thing[:2, 3])
            for doorway in interior.plan.doorways:
                assert np.linalg.norm(doorway.center - placed_thing.T_world_thing[:2, 3]) > doorway.width_m / 2


@pytest.mark.parametrize("seed", SEEDS)
def test_relations_are_as_the_recipe_says(seed: int) -> None:
    interior = office(seed)
    by_id = {placed_thing.thing_id: placed_thing for placed_thing in interior.placed}
    desks = [placed_thing for placed_thing in interior.placed if placed_thing.piece.label == "desk"]
    first = next(placed_thing for placed_thing in interior.placed if placed_thing.name == "first desk")
    assert {"monitor", "keyboard", "mouse", "mug"} <= {
        placed_thing.piece.label for placed_thing in interior.placed if placed_thing.on == first.thing_id
    }
    books = [placed_thing for placed_thing in interior.placed if placed_thing.piece.label == "book"]
    assert all(by_id[str(book.on)].piece.label == "bookshelf" for book in books)
    assert all(by_id[str(book.on)].box.z_max > book.box.z_max for book in books)
    under = [
        placed_thing
        for placed_thing in interior.placed
        if placed_thing.piece.label == "trash can" and any(_covers(desk, placed_thing) for desk in desks)
    ]
    assert len(under) == 1
    in_box = next(
        placed_thing
        for placed_thing in interior.placed
        if placed_thing.on and placed_thing.on.startswith("cardboard-box")
    )
    assert in_box.piece.label == "bottle"


def _covers(desk: PlacedPiece, thing: PlacedPiece) -> bool:
    local = np.linalg.inv(desk.T_world_thing) @ thing.T_world_thing[:, 3]
    return bool((np.abs(local[:2]) < desk.piece.size[:2] / 2).all())


@pytest.mark.parametrize("seed", SEEDS)
def test_repeated_things_share_their_shape_and_others_do_not(seed: int) -> None:
    things = office(seed).things
    whiteboards = [thing.shape for thing in things if thing.label == "whiteboard"]
    assert len(whiteboards) == 2
    assert whiteboards[0] is whiteboards[1]
    chairs = [id(thing.shape) for thing in things if thing.label == "chair"]
    assert sorted(chairs.count(shape_id) for shape_id in set(chairs)) == [2, 4]
    plants = [thing.shape for thing in things if thing.label == "potted plant"]
    assert plants[0] is not plants[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_robot_can_reach_every_room_and_move_about_in_it(seed: int) -> None:
    interior = office(seed)
    free = FreeSpace(interior.plan, interior.obstacles, clearance_m=0.35)
    for room in interior.plan.rooms:
        x, y = (np.arange(room.low[k], room.high[k], 0.1) for k in (0, 1))
        floor = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        assert free.are_reachable(floor).mean() > 0.12


def test_the_same_seed_furnishes_alike() -> None:
    plan, fixtures = building(1)
    again = Interior(plan, fixtures)
    rng = np.random.default_rng(1)
    again.furnish(office_recipes(rng), rng)
    for one, other in zip(office(1).placed, again.placed, strict=True):
        assert (one.thing_id, one.on, one.room) == (other.thing_id, other.on, other.room)
        assert np.array_equal(one.T_world_thing, other.T_world_thing)


def test_an_empty_recipe_leaves_an_empty_room() -> None:
    interior = empty_room()
    interior.furnish({"office": ()}, np.random.default_rng(0))
    assert interior.things == ()


def test_a_further_place_is_far_enough_and_both_stay_taken() -> None:
    interior = empty_room()
    rng = np.random.default_rng(3)
    suitcase = interior.add(RecipeLine("suitcase", AlongWall()), "office", rng)
    moved = interior.another_place(suitcase, OnFloor(), "office", rng, at_least_m=2.0)
    assert np.linalg.norm(moved.box.center - suitcase.box.center) >= 2.0
    assert len(interior.placed) == 2
    assert len(interior.things) == 1


def test_a_nudge_is_as_long_as_asked() -> None:
    interior = empty_room()
    rng = np.random.default_rng(3)
    armchair = interior.add(RecipeLine("armchair", OnFloor()), "office", rng)
    moved = interior.nudged(armchair, 0.25, rng)
    assert np.linalg.norm(moved.box.center - armchair.box.center) == pytest.approx(0.25)


def test_a_room_that_is_too_small_is_an_error_with_a_cure() -> None:
    with pytest.raises(SimulationError, match="no place") as caught:
        empty_room().furnish({"office": (RecipeLine("couch", AlongWall(), count=30),)}, np.random.default_rng(0))
    assert caught.value.cure


def test_a_recipe_that_names_no_host_is_a_mistake() -> None:
    with pytest.raises(LookupError, match="desk"):
        empty_room().add(RecipeLine("mug", On("desk")), "office", np.random.default_rng(0))


@pytest.mark.parametrize(("thing", "height"), [("bottle", 0.3), ("book", 0.3)])
def test_what_is_inside_a_box_stands_on_its_bottom(thing: str, height: float) -> None:
    interior = empty_room()
    rng = np.random.default_rng(1)
    box = interior.add(RecipeLine("cardboard box", AlongWall()), "office", rng)
    inside = interior.add(RecipeLine(thing, Inside("cardboard box")), "office", rng)
    assert inside.on == box.thing_id
    assert 0 < inside.T_world_thing[2, 3] < 0.02
    assert inside.box.z_min < height


def test_what_hangs_keeps_clear_of_windows() -> None:
    plan, fixtures = make_building(np.random.default_rng(5), ["office"])
    interior = Interior(plan, fixtures)
    rng = np.random.default_rng(5)
    for _ in range(4):
        interior.add(RecipeLine("painting", Hung((1.2, 1.5))), "office", rng)
    for window in (fixture for fixture in fixtures if fixture.label == "window"):
        low, high = window.shape.bounds
        for placed_thing in interior.placed:
            footprint = placed_thing.box.footprint()
            assert (footprint.min(axis=0) > high[:2]).any() or (footprint.max(axis=0) < low[:2]).any()


def test_the_tiny_room_has_nine_things() -> None:
    assert sum(line.count for line in TINY_ROOM) == 9
