"""What each scenario promises, for several seeds."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.boxes import box_iou
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.scenarios import DAY_NS, MONDAY_NS, SCENARIOS, make_scenario
from supermap_cli.simulation.world import Stay, World, box_of

SEEDS = (1, 2)


@cache
def scenario(name: str, seed: int) -> Scenario:
    return make_scenario(name, seed)


def objects(world: World) -> list[str]:
    return [thing.id for thing in world.things if thing.label != "person"]


def standing(world: World, stamp_ns: int) -> dict[str, Stay]:
    return {stay.thing_id: stay for stay in world.stays if stay.covers(stamp_ns)}


def moved_m(world: World, first: Stay, second: Stay) -> float:
    shape = world.thing(first.thing_id).shape
    return float(np.linalg.norm(box_of(shape, first.T_world_thing).center - box_of(shape, second.T_world_thing).center))


def test_every_scenario_says_what_it_is() -> None:
    assert {"office", "office-twice", "panorama", "tiny", "demo", "room"} == set(SCENARIOS)
    assert all(SCENARIOS.values())


@pytest.mark.parametrize(
    ("name", "seed", "seconds", "match"),
    [("warehouse", 1, None, "no scenario"), ("tiny", -1, None, "seed"), ("tiny", 1, 0.0, "takes time")],
)
def test_what_cannot_be_made_is_an_error_with_a_cure(name: str, seed: int, seconds: float | None, match: str) -> None:
    with pytest.raises(SimulationError, match=match) as caught:
        make_scenario(name, seed, seconds=seconds)
    assert caught.value.cure


@pytest.mark.parametrize("seed", range(1, 5))
def test_tiny_is_one_short_visit_to_one_room(seed: int) -> None:
    made = scenario("tiny", seed)
    assert len(made.plan.rooms) == len(made.traversals) == 1
    assert len(objects(made.world)) == 9
    assert made.traversals[0].route.end_ns - made.traversals[0].route.start_ns == 4_000_000_000
    assert made.traversals[0].route.start_ns == MONDAY_NS
    assert [thing.label for thing in made.world.things].count("person") == 1
    start_ns, end_ns = made.traversals[0].route.start_ns, made.traversals[0].route.end_ns
    assert all(motion.stamps_ns[0] < start_ns and motion.stamps_ns[-1] > end_ns for motion in made.world.motions)


def test_the_same_seed_gives_the_same_world_and_another_seed_another() -> None:
    first, again, other = scenario("tiny", 1), make_scenario("tiny", 1), scenario("tiny", 2)
    assert [thing.id for thing in first.world.things] == [thing.id for thing in again.world.things]
    for one, two in zip(first.world.stays, again.world.stays, strict=True):
        assert np.array_equal(one.T_world_thing, two.T_world_thing)
    for one, two in zip(first.world.motions, again.world.motions, strict=True):
        assert np.array_equal(one.T_world_body, two.T_world_body)
    assert np.array_equal(first.traversals[0].route.knots_xy, again.traversals[0].route.knots_xy)
    assert not np.allclose(first.world.stays[0].T_world_thing, other.world.stays[0].T_world_thing)


def test_world_and_drive_are_the_same_whatever_the_rig() -> None:
    own, other = scenario("tiny", 1), make_scenario("tiny", 1, rig="three-cameras")
    assert (own.rig.name, other.rig.name) == ("rgbd", "three-cameras")
    for one, two in zip(own.world.motions, other.world.motions, strict=True):
        assert np.array_equal(one.stamps_ns, two.stamps_ns)
        assert np.array_equal(one.T_world_body, two.T_world_body)
    assert np.array_equal(own.traversals[0].route.knots_xy, other.traversals[0].route.knots_xy)


def test_an_unknown_rig_is_told_before_a_world_is_made() -> None:
    with pytest.raises(SimulationError, match="no rig"):
        make_scenario("tiny", 1, rig="submarine")


def test_a_longer_visit_does_not_change_the_world() -> None:
    short, long = scenario("tiny", 1), make_scenario("tiny", 1, seconds=6)
    for one, two in zip(short.world.stays, long.world.stays, strict=True):
        assert np.array_equal(one.T_world_thing, two.T_world_thing)
    assert long.traversals[0].route.end_ns - long.traversals[0].route.start_ns == 6_000_000_000


@pytest.mark.parametrize("seed", SEEDS)
def test_office_has_41_objects_and_people_who_walk_through(seed: int) -> None:
    made = scenario("office", seed)
    world = made.world
    assert len(objects(world)) == 41
    assert len({world.thing(object_id).label for object_id in objects(world)}) >= 18
    assert all(stay.since_ns is None and stay.until_ns is None for stay in world.stays)
    (traversal,) = made.traversals
    assert (traversal.name, made.rig.name) == ("office", "rgbd")
    assert 90 <= (traversal.route.end_ns - traversal.route.start_ns) / 1e9 <= 110
    people = {motion.thing_id for motion in world.motions}
    assert 1 <= len(people) <= 2
    for motion in world.motions:
        assert motion.stamps_ns[0] < traversal.route.end_ns
        assert motion.stamps_ns[-1] > traversal.route.start_ns


@pytest.mark.parametrize("name", ["office-twice", "demo"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_second_visit_finds_what_was_promised_and_nothing_else(name: str, seed: int) -> None:
    world = scenario(name, seed).world
    monday, tuesday = scenario(name, seed).traversals
    before, after = standing(world, monday.route.start_ns), standing(world, tuesday.route.end_ns)
    labels = {
        "office-twice": (["chair", "potted plant", "trash can"], ["bucket", "cart", "safety sign"], 2),
        "demo": (["potted plant"], ["bucket"], 1),
    }
    gone, new, relocated = labels[name]
    assert sorted(world.thing(object_id).label for object_id in before.keys() - after.keys()) == gone
    assert sorted(world.thing(object_id).label for object_id in after.keys() - before.keys()) == new
    both = before.keys() & after.keys()
    distances = sorted(d for object_id in both if (d := moved_m(world, before[object_id], after[object_id])) > 0)
    assert len(distances) == relocated + 1
    assert distances[0] == pytest.approx(0.25)
    assert all(distance > 2 for distance in distances[1:])
    assert len(before) == {"office-twice": 41, "demo": 16}[name]


@pytest.mark.parametrize("name", ["office-twice", "demo"])
@pytest.mark.parametrize("seed", SEEDS)
def test_changes_happen_half_way_between_visits_a_day_apart_that_start_in_different_places(
    name: str, seed: int
) -> None:
    made = scenario(name, seed)
    monday, tuesday = made.traversals
    assert (monday.name, tuesday.name) == ("monday", "tuesday")
    assert (monday.route.start_ns, tuesday.route.start_ns) == (MONDAY_NS, MONDAY_NS + DAY_NS)
    half_way_ns = (monday.route.end_ns + tuesday.route.start_ns) // 2
    assert {s for stay in made.world.stays for s in (stay.since_ns, stay.until_ns)} == {None, half_way_ns}
    assert np.linalg.norm(monday.T_world_odom[:2, 3] - tuesday.T_world_odom[:2, 3]) >= 1.0
    for traversal in made.traversals:
        stamps_ns = np.array([traversal.route.start_ns])
        assert np.allclose(traversal.T_world_odom, traversal.route.T_world_base(stamps_ns)[0])
        assert (traversal.route.end_ns - traversal.route.start_ns) / 1e9 == pytest.approx(
            110 if name == "office-twice" else 20
        )


@pytest.mark.parametrize("seed", SEEDS)
def test_one_relocated_thing_is_the_only_one_of_its_kind_and_goes_to_another_room(seed: int) -> None:
    made = scenario("office-twice", seed)
    counts = Counter(thing.label for thing in made.world.things)
    assert counts["suitcase"] == 1
    rooms = [made.plan.room_at(stay.T_world_thing[:2, 3]) for stay in made.world.stays_of("suitcase-1")]
    assert [room.name for room in rooms if room is not None] == ["kitchen", "office"]


@pytest.mark.parametrize("name", ["office-twice", "demo", "panorama"])
def test_places_of_changed_things_stay_free_of_others(name: str) -> None:
    world = scenario(name, 1).world
    boxes = [(stay.thing_id, box_of(world.thing(stay.thing_id).shape, stay.T_world_thing)) for stay in world.stays]
    changed = {stay.thing_id for stay in world.stays if stay.since_ns or stay.until_ns}
    for thing_id, box in boxes:
        if thing_id in changed:
            hits = [other for other, its_box in boxes if other != thing_id and box_iou(box, its_box) > 0.05]
            assert not hits, f"{thing_id} and {hits}"


@pytest.mark.parametrize("seed", SEEDS)
def test_changed_places_come_into_the_robots_view_on_both_visits(seed: int) -> None:
    made = scenario("office-twice", seed)
    obstacles = [box_of(made.world.thing(stay.thing_id).shape, stay.T_world_thing) for stay in made.world.stays]
    free = FreeSpace(made.plan, obstacles, clearance_m=0.3)
    for traversal in made.traversals:
        stamps_ns = np.arange(traversal.route.start_ns, traversal.route.end_ns, 200_000_000)
        x, y, yaw = traversal.route.derivative(stamps_ns).T
        for stay in made.world.stays:
            if stay.since_ns is None and stay.until_ns is None:
                continue
            target = stay.T_world_thing[:2, 3]
            bearing = np.arctan2(target[1] - y, target[0] - x) - yaw
            ahead = np.abs(np.angle(np.exp(1j * bearing))) < np.radians(32)
            near = np.hypot(target[0] - x, target[1] - y) < 5
            seen = free.sees(target, np.column_stack([x, y])) & ahead & near
            assert seen.sum() >= 3, f"{stay.thing_id} on {traversal.name}"


@pytest.mark.parametrize("seed", SEEDS)
def test_panorama_has_a_carried_bag_and_a_trash_can_that_goes(seed: int) -> None:
    made = scenario("panorama", seed)
    world, (traversal,) = made.world, made.traversals
    assert (traversal.name, made.rig.name) == ("panorama", "panorama")
    first, second = world.stays_of("backpack-1")
    (motion,) = [motion for motion in world.motions if motion.thing_id == "backpack-1"]
    assert (first.until_ns, second.since_ns) == (motion.stamps_ns[0], motion.stamps_ns[-1])
    assert np.allclose(motion.T_world_body[0], first.T_world_thing)
    assert np.allclose(motion.T_world_body[-1], second.T_world_thing, atol=0.02)
    assert moved_m(world, first, second) > 1.5
    assert traversal.route.start_ns < motion.stamps_ns[0]
    assert motion.stamps_ns[0] < traversal.route.end_ns
    assert {thing.label for thing in world.things if thing.id in {m.thing_id for m in world.motions}} == {
        "person",
        "backpack",
    }
    vanished = [stay for stay in world.stays if stay.until_ns is not None and stay.thing_id.startswith("trash-can")]
    assert len(vanished) == 1
    assert len(world.stays_of(vanished[0].thing_id)) == 1


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("label", ["trash can", "bucket"])
def test_a_trash_can_goes_and_a_bucket_comes_behind_walls_and_their_places_are_seen_before_and_after(
    label: str, seed: int
) -> None:
    made = scenario("panorama", seed)
    stays = [stay for stay in made.world.stays if made.world.thing(stay.thing_id).label == label]
    (changed,) = [stay for stay in stays if stay.since_ns or stay.until_ns]
    assert (changed.since_ns is None) == (label == "trash can")
    changed_ns = changed.since_ns or changed.until_ns
    assert changed_ns is not None
    route = made.traversals[0].route
    walls = FreeSpace(made.plan, [], clearance_m=0.3)
    stamps_ns = np.arange(route.start_ns, route.end_ns, 250_000_000)
    seen = walls.sees(changed.T_world_thing[:2, 3], route.derivative(stamps_ns)[:, :2])
    around = np.abs(stamps_ns - changed_ns) < 900_000_000
    assert not seen[around].any()
    assert seen[stamps_ns < changed_ns].sum() >= 8
    assert seen[stamps_ns > changed_ns].sum() >= 8


@pytest.mark.parametrize(("name", "seed"), [("office", 1), ("panorama", 1), ("tiny", 1)])
def test_people_keep_off_the_robot_and_appear_out_of_its_view(name: str, seed: int) -> None:
    made = scenario(name, seed)
    walls = FreeSpace(made.plan, [], clearance_m=0.3)
    for person in (thing.id for thing in made.world.things if thing.label == "person"):
        body = next(motion for motion in made.world.motions if motion.thing_id == person)
        for traversal in made.traversals:
            inside = (body.stamps_ns >= traversal.route.start_ns) & (body.stamps_ns < traversal.route.end_ns)
            robot_xy = traversal.route.derivative(body.stamps_ns[inside])[:, :2]
            person_xy = body.T_world_body[inside][:, :2, 3]
            assert np.linalg.norm(robot_xy - person_xy, axis=1).min() > 0.5
            for end in (0, -1):
                if inside[end]:
                    assert not walls.sees(robot_xy[end], person_xy[end][None])[0]
