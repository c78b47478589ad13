"""The scenario `room` and the axes of its world: every level does what it says, for any seed."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from supermap_cli.geometry.boxes import footprint_gap_m
from supermap_cli.geometry.se3 import inverse
from supermap_cli.simulation.domains.axes import AXES, random_levels
from supermap_cli.simulation.domains.world_axes import WORLD_AXES
from supermap_cli.simulation.rigs import DepthSensor
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.scenarios import make_scenario
from supermap_cli.simulation.sensors.depth_sensor import measure_depth
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import RenderedView
from supermap_cli.simulation.world import Fixture, Material, Shape, SimulatedThing, Stay, World, box_of
from supermap_cli.simulation.worlds.finishes import BLACK_RETURN, GLOSSY_RETURN
from supermap_cli.simulation.worlds.look_alikes import ROW_GAP_M, ROW_OF, TWIN_M
from supermap_cli.simulation.worlds.pieces import Piece
from supermap_cli.simulation.worlds.shapes.glass import CLEAR_GLASS
from supermap_cli.simulation.worlds.shapes.primitives import block, signed_volume_m3
from supermap_cli.simulation.worlds.shapes.styles import STYLES, build_styled


@cache
def room(seed: int = 1, **levels: str) -> Scenario:
    named = {name.replace("_", "-"): level for name, level in levels.items()}
    return make_scenario("room", seed, levels=named)


def objects(scenario: Scenario) -> list[SimulatedThing]:
    return [thing for thing in scenario.world.things if thing.label != "person"]


def people(scenario: Scenario) -> list[SimulatedThing]:
    return [thing for thing in scenario.world.things if thing.label == "person"]


def moves(scenario: Scenario) -> list[tuple[Stay, Stay]]:
    """The first and the second place of all things that have two."""
    stays = [scenario.world.stays_of(thing.id) for thing in objects(scenario)]
    return [(first, second) for first, second in (pair for pair in stays if len(pair) == 2)]


def moved_m(scenario: Scenario) -> list[float]:
    return [float(np.linalg.norm(b.T_world_thing[:2, 3] - a.T_world_thing[:2, 3])) for a, b in moves(scenario)]


def came(scenario: Scenario) -> list[Stay]:
    moved = {stay.thing_id for stay, _ in moves(scenario)}
    return [stay for stay in scenario.world.stays if stay.since_ns is not None and stay.thing_id not in moved]


def left(scenario: Scenario) -> list[Stay]:
    moved = {stay.thing_id for stay, _ in moves(scenario)}
    return [stay for stay in scenario.world.stays if stay.until_ns is not None and stay.thing_id not in moved]


def seconds(scenario: Scenario) -> list[float]:
    return [(visit.route.end_ns - visit.route.start_ns) / 1e9 for visit in scenario.traversals]


def test_every_axis_of_the_world_has_three_levels_or_more() -> None:
    assert [axis.name for axis in WORLD_AXES] == [
        "room", "density", "look-alikes", "furniture", "materials", "dwell", "people", "changes",
    ]  # fmt: skip
    assert all(axis.of_world and len(axis.levels) >= 3 for axis in WORLD_AXES)
    assert set(AXES) >= {axis.name for axis in WORLD_AXES}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_usual_room_holds_16_to_20_things_and_one_person(seed: int) -> None:
    made = room(seed)
    assert 16 <= len(objects(made)) <= 20
    assert len(people(made)) == 1
    assert seconds(made) == [30.0]
    (only,) = made.plan.rooms
    assert sorted(only.high - only.low) == pytest.approx([5.0, 6.0], abs=0.5)
    assert all(stay.since_ns is None and stay.until_ns is None for stay in made.world.stays)


def test_other_seeds_are_other_rooms_and_the_same_seed_the_same() -> None:
    recipes = [sorted(thing.label for thing in objects(room(seed))) for seed in (1, 2, 3)]
    assert all(one != other for one, other in combinations(recipes, 2))
    again = make_scenario("room", 1)
    for one, other in zip(room(1).world.stays, again.world.stays, strict=True):
        assert (one.thing_id, one.on) == (other.thing_id, other.on)
        assert np.array_equal(one.T_world_thing, other.T_world_thing)
    for visit, same in zip(room(1).traversals, again.traversals, strict=True):
        assert np.array_equal(visit.route.knots_xy, same.route.knots_xy)


def test_what_is_on_something_touches_it() -> None:
    world = room(1, furniture="stacked").world
    places = {stay.thing_id: stay for stay in world.stays}
    upon = [stay for stay in world.stays if stay.on is not None]
    assert upon
    for stay in upon:
        host = places[str(stay.on)]
        surfaces = Piece("", world.thing(host.thing_id).shape).surfaces
        height_m = stay.T_world_thing[2, 3] - host.T_world_thing[2, 3]
        assert min(abs(height_m - surface.z_m) for surface in surfaces) < 1e-9


def test_rooms_are_what_the_levels_say() -> None:
    (closet,) = room(room="closet").plan.rooms
    assert sorted(closet.high - closet.low) == pytest.approx([2.2, 2.6], abs=0.25)
    assert len(objects(room(room="closet"))) <= 7
    first, second = (room(room="thin").plan.room(name) for name in ("first room", "second room"))
    apart = np.maximum(first.low - second.high, second.low - first.high).max()
    assert apart == pytest.approx(0.05)
    assert len(room(room="two-rooms").plan.rooms) == 3


def test_a_slanted_building_has_no_wall_along_the_axes() -> None:
    slanted = room(room="slanted").world
    walls = [fixture.shape for fixture in slanted.fixtures if fixture.label == "wall"]
    assert len(walls) == 2
    assert np.array_equal(slanted.things[0].shape.vertices, room().world.things[0].shape.vertices)
    for wall in walls:
        normals = _normals(wall)
        upright = normals[np.abs(normals[:, 2]) < 0.5]
        assert (np.abs(upright[:, :2]).min(axis=1) > 0.15).all() or len(upright) < 8
    oblique = _normals(walls[1])
    yaws = np.degrees(np.arctan2(oblique[:, 1], oblique[:, 0]))[np.abs(oblique[:, 2]) < 0.5] % 90
    assert np.ptp(yaws) > 10


def _normals(shape: Shape) -> np.ndarray:
    corners = shape.vertices[shape.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return cross / np.linalg.norm(cross, axis=1)[:, None]


def test_a_glass_partition_stands_from_floor_to_ceiling() -> None:
    made = room(room="glass")
    (pane,) = [
        fixture.shape for fixture in made.world.fixtures
        if any(material.see_through for material in fixture.shape.materials)
    ]  # fmt: skip
    low, high = pane.bounds
    assert high[2] - low[2] == pytest.approx(made.plan.height_m)
    assert (high - low)[:2].max() > 3


def test_density_is_a_number_of_things() -> None:
    assert len(objects(room(density="few"))) == 6
    assert 46 <= len(objects(room(density="many"))) <= 52
    assert seconds(room(density="many")) == [45.0]


def test_rows_are_of_one_chair_close_together() -> None:
    made = room(look_alikes="rows")
    shapes = [id(thing.shape) for thing in objects(made) if thing.label == "chair"]
    model = max(set(shapes), key=shapes.count)
    row = {thing.id for thing in objects(made) if id(thing.shape) == model}
    assert ROW_OF[0] <= len(row) <= ROW_OF[1]
    boxes = [box_of(made.world.thing(s.thing_id).shape, s.T_world_thing) for s in made.world.stays if s.thing_id in row]
    for box in boxes:
        assert min(footprint_gap_m(box, other) for other in boxes if other is not box) < ROW_GAP_M[1] + 0.03


def test_everything_has_a_twin_near_by() -> None:
    made = room(look_alikes="pairs")
    assert len(objects(made)) >= 10
    for stay in made.world.stays:
        shape = made.world.thing(stay.thing_id).shape
        distances = [
            np.linalg.norm(other.T_world_thing[:2, 3] - stay.T_world_thing[:2, 3])
            for other in made.world.stays
            if other is not stay and made.world.thing(other.thing_id).shape is shape
        ]
        assert any(TWIN_M[0] - 1e-6 <= distance <= TWIN_M[1] + 1e-6 for distance in distances)


def test_swapped_things_are_of_one_class_and_differ() -> None:
    made = room(look_alikes="swapped")
    pairs = moves(made)
    assert len(made.traversals) == 2
    assert len(pairs) >= 2
    for first, second in pairs:
        (other,) = [a for a, _ in pairs if np.allclose(a.T_world_thing, second.T_world_thing)]
        assert other.thing_id != first.thing_id
        one, another = made.world.thing(first.thing_id), made.world.thing(other.thing_id)
        assert one.label == another.label
        assert one.shape.materials != another.shape.materials


@pytest.mark.parametrize(("label", "style"), STYLES)
def test_styled_shapes_are_solid_and_stand_on_their_foot(label: str, style: str) -> None:
    for seed in range(2):
        shape = build_styled(label, style, np.random.default_rng(seed))
        low, high = shape.bounds
        assert low[2] == pytest.approx(0)
        assert low[0] + high[0] == pytest.approx(0)
        assert 0.02 < (high - low).min() < (high - low).max() < 2.3
        assert signed_volume_m3(shape.vertices[shape.triangles]) > 0


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        ("thin-legs", {("bookshelf", "thin"), ("clothes rack", "thin")}),
        ("leaning", {("broom", "leaning"), ("ladder", "leaning")}),
        ("nested", {("basket", "open")}),
        ("hanging", {("coat", "hung")}),
    ],
)
def test_furniture_of_a_level_is_there(level: str, expected: set[tuple[str, str]]) -> None:
    labels = {thing.label for thing in objects(room(furniture=level))}
    assert {label for label, _ in expected} & labels


def test_overhanging_tops_have_nothing_at_their_corners() -> None:
    shape = build_styled("table", "overhanging", np.random.default_rng(0))
    _, high = shape.bounds
    below = shape.vertices[shape.vertices[:, 2] < 0.5 * high[2]]
    assert np.abs(below[:, 0]).max() < 0.4 * high[0]


def test_lamps_hang_from_the_ceiling_and_leaning_things_reach_the_wall() -> None:
    made = room(furniture="hanging")
    tops = [box_of(made.world.thing(s.thing_id).shape, s.T_world_thing).z_max for s in made.world.stays]
    assert any(top == pytest.approx(made.plan.height_m - 0.021, abs=1e-6) for top in tops)


def test_nested_things_lie_within_their_hosts() -> None:
    world = room(furniture="nested").world
    stays = {stay.thing_id: stay for stay in world.stays}
    inside = [stay for stay in world.stays if stay.on is not None and stay.on.startswith(("basket", "trash", "cardb"))]
    assert inside
    for stay in inside:
        T_host_thing = inverse(stays[str(stay.on)].T_world_thing) @ stay.T_world_thing
        assert (np.abs(T_host_thing[:2, 3]) < 0.25).all()
        assert T_host_thing[2, 3] < 0.05


@pytest.mark.parametrize(("level", "share"), [("dark", BLACK_RETURN), ("glossy", GLOSSY_RETURN)])
def test_some_materials_have_less_depth_and_look_the_same_otherwise(level: str, share: float) -> None:
    shares = {material.depth_return for thing in objects(room(materials=level)) for material in thing.shape.materials}
    assert shares == {share, 1.0}
    assert all(material.depth_return == 1 for thing in objects(room()) for material in thing.shape.materials)


def test_a_material_prints_as_its_pattern_only() -> None:
    assert repr(Material((1, 2, 3), depth_return=0.5, see_through=True)) == repr(Material((1, 2, 3)))


def wall_and(material: Material) -> Scene:
    """A thing of a material 1 m before a wall, on the x axis."""
    wall = block((0.1, 8.0, 8.0), Material((200, 200, 200)), (2.05, 0, -4))
    pane = block((0.02, 2.0, 2.0), material, (1.0, 0, -1))
    return Scene(World((Fixture("wall", wall),), (SimulatedThing("pane", "pane", pane),), (Stay("pane", np.eye(4)),)))


def rays() -> np.ndarray:
    across = np.linspace(-0.4, 0.4, 160)
    return np.array([(1.0, y, z) for y in across for z in across])


def test_weak_surfaces_return_a_share_of_the_light_in_patches() -> None:
    for share in (0.1, 0.5):
        hits = wall_and(Material((20, 20, 20), depth_return=share)).cast(0, np.zeros(3), rays(), colour=False)
        assert hits.returns is not None
        assert hits.returns.mean() == pytest.approx(share, abs=0.05)
        grid = hits.returns.reshape(160, 160)
        assert (grid[:, 1:] == grid[:, :-1]).mean() > 1 - share * (1 - share)
        again = wall_and(Material((20, 20, 20), depth_return=share)).cast(0, np.zeros(3), rays(), colour=False)
        assert np.array_equal(hits.returns, again.returns)


def test_ordinary_surfaces_cost_nothing() -> None:
    assert wall_and(Material((20, 20, 20))).cast(0, np.zeros(3), rays(), colour=False).returns is None


def test_one_sees_the_glass_and_measures_what_is_behind() -> None:
    hits = wall_and(CLEAR_GLASS).cast(0, np.zeros(3), rays(), colour=True)
    assert hits.distance == pytest.approx(2.0)
    assert (hits.thing == 1).all()
    assert hits.rgb is not None
    plain = wall_and(Material(CLEAR_GLASS.rgb)).cast(0, np.zeros(3), rays(), colour=True)
    assert plain.distance == pytest.approx(0.99)


def test_the_depth_camera_loses_what_does_not_return() -> None:
    shape = (20, 20)
    returns = np.zeros(shape, bool)
    returns[:, :10] = True
    perfect = DepthSensor(noise_per_m=0, lost_share=0)
    view = RenderedView(
        0, np.full(shape, 2, np.float32), np.ones(shape, np.int32), np.ones(shape, np.float32),
        np.zeros((*shape, 3), np.uint8), returns,
    )  # fmt: skip
    assert np.array_equal(measure_depth(view, perfect, np.random.default_rng(0)) > 0, returns)


def test_a_turn_goes_round_without_leaving_its_place() -> None:
    (visit,) = room(dwell="turn").traversals
    assert np.ptp(visit.route.knots_xy, axis=0).max() == 0
    assert np.ptp(visit.route.knots_yaw) == pytest.approx(4 * np.pi)


def test_a_pass_is_straight_and_rounds_are_long() -> None:
    (visit,) = room(dwell="pass").traversals
    xy = visit.route.knots_xy
    way_m = np.linalg.norm(np.diff(xy, axis=0), axis=1).sum()
    assert way_m > 2
    assert way_m == pytest.approx(np.linalg.norm(xy[-1] - xy[0]))
    assert seconds(room(dwell="pass")) == [15.0]
    assert seconds(room(dwell="rounds")) == [90.0]


def test_people_are_as_many_as_said_and_keep_off_the_robot() -> None:
    assert not people(room(people="none"))
    assert len(people(room(people="standing"))) == 2
    assert 4 <= len(people(room(people="six"))) <= 6
    made = room(people="six")
    route = made.traversals[0].route
    stamps_ns = np.arange(route.start_ns, route.end_ns, 250_000_000)
    robot = route.derivative(stamps_ns)[:, :2]
    for motion in made.world.motions:
        if motion.shape is next(m.shape for m in made.world.motions if m.thing_id == motion.thing_id):
            way = np.column_stack(
                [np.interp(stamps_ns, motion.stamps_ns, motion.T_world_body[:, k, 3]) for k in (0, 1)]
            )
            assert np.linalg.norm(way - robot, axis=1).min() > 0.5
    spans = [np.ptp(m.T_world_body[:, :2, 3], axis=0).max() for m in room(people="standing").world.motions[::6]]
    assert max(spans) < 0.01


def test_a_carried_thing_stands_elsewhere_afterwards() -> None:
    made = room(people="carrying")
    (pair,) = moves(made)
    carried = [motion for motion in made.world.motions if motion.thing_id == pair[0].thing_id]
    assert len(carried) == 1
    assert pair[0].until_ns == carried[0].stamps_ns[0]
    assert pair[1].since_ns == carried[0].stamps_ns[-1]
    assert moved_m(made)[0] > 0.5


def test_changes_are_as_said() -> None:
    assert (len(came(room(changes="appear"))), len(left(room(changes="appear")))) == (3, 0)
    assert (len(came(room(changes="vanish"))), len(left(room(changes="vanish")))) == (0, 3)
    assert moved_m(room(changes="shifted-0.15")) == pytest.approx([0.15] * 3)
    assert moved_m(room(changes="shifted-0.5")) == pytest.approx([0.5] * 3)
    assert min(moved_m(room(changes="moved"))) > 1.9
    replaced = room(changes="replaced")
    (gone,), (new,) = left(replaced), came(replaced)
    assert np.array_equal(gone.T_world_thing, new.T_world_thing)
    assert replaced.world.thing(gone.thing_id).label == replaced.world.thing(new.thing_id).label
    unchanged = room(changes="unchanged")
    assert moves(unchanged) == came(unchanged) == left(unchanged) == []
    assert len(unchanged.traversals) == 2


def test_what_is_rotated_stays_in_place() -> None:
    made = room(changes="rotated")
    assert len(moves(made)) == 3
    for first, second in moves(made):
        shape = made.world.thing(first.thing_id).shape
        before, after = (box_of(shape, stay.T_world_thing) for stay in (first, second))
        assert np.linalg.norm(before.center - after.center) < 0.15
        turn = np.degrees(abs((after.yaw - before.yaw + np.pi) % (2 * np.pi) - np.pi))
        assert 59.9 <= turn <= 120.1


def test_a_hidden_thing_stays_behind_a_large_new_one() -> None:
    made = room(changes="hidden")
    (new,) = came(made)
    assert not left(made)
    assert box_of(made.world.thing(new.thing_id).shape, new.T_world_thing).size.max() > 0.7


def test_the_second_visit_starts_elsewhere() -> None:
    first, second = (visit.T_world_odom[:2, 3] for visit in room(changes="unchanged").traversals)
    assert np.linalg.norm(first - second) >= 1.0


@pytest.mark.parametrize("seed", [7, 8])
def test_any_levels_together_make_a_world(seed: int) -> None:
    levels = random_levels(seed)
    names = {axis.name for axis in WORLD_AXES}
    made = make_scenario("room", seed, levels={name: level for name, level in levels.items() if name in names})
    assert len(objects(made)) >= 2
