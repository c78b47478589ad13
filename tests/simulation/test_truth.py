"""What is true of a scenario: states, motions, sightings, surfaces, changes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.simulation.recording.truth import (
    DetectedImage,
    RecordedTraversal,
    contiguous_motions,
    find_changes,
    make_truth,
)
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.views import PlaceVisibility
from supermap_cli.simulation.world import Motion, SimulatedThing, Stay, World, sample_surface
from supermap_cli.truth_file import to_document
from supermap_cli.types.sensing import MAIN_CAMERA
from supermap_cli.types.truth import GroundTruth, TrueChange
from supermap_schema.json_schemas import load_schema
from support import simulated, simulated_traversals

S = simulated.SECOND_NS
START = simulated.START_NS


def nothing_visible() -> PlaceVisibility:
    whole, share = np.zeros(0, np.int64), np.zeros(0, np.float32)
    return PlaceVisibility(whole, whole, np.zeros(0, bool), share, share, whole, share)


def truth_of(scenario: Scenario, visibility: tuple[PlaceVisibility, ...] = ()) -> GroundTruth:
    """As if the first traversal had these visibility, a second apart, and every second sample had been seen."""
    first = scenario.traversals[0]
    images = tuple(
        DetectedImage(first.route.start_ns + k * S, MAIN_CAMERA, of_image) for k, of_image in enumerate(visibility)
    )
    traversals = [
        RecordedTraversal(traversal, f"{traversal.name}.mcap", images if traversal is first else ())
        for traversal in scenario.traversals
    ]
    surfaces = [
        [(points, np.arange(len(points)) % 2 == 0) for points, _ in (sample_surface(part.shape, 0.1) for part in parts)]
        for parts in (scenario.world.things, scenario.world.fixtures)
    ]
    return make_truth(scenario, traversals, *surfaces)


def with_world(stays: tuple[Stay, ...], motions: tuple[Motion, ...] = ()) -> Scenario:
    """The two traversals (0..5 s, 120..122 s) to a world in which only the ball stands or moves as given."""
    scenario = simulated_traversals.two_traversals()
    world = scenario.world
    return replace(scenario, world=World(world.fixtures, world.things, stays, motions))


def ball(x: float, since_s: float | None = None, until_s: float | None = None) -> Stay:
    since, until = (None if seconds is None else START + round(seconds * S) for seconds in (since_s, until_s))
    return Stay("ball-1", simulated.standing(x, 0, 0), since, until)


def moving_ball(since_s: float, until_s: float) -> Motion:
    stamps = START + np.array([since_s, until_s]) * S
    shape = simulated.small_world().thing("ball-1").shape
    poses = np.stack([simulated.standing(0, 0, 0), simulated.standing(2, 0, 0)])
    return Motion("ball-1", shape, stamps.astype(np.int64), poses)


def changes_of(*stays: Stay, motions: tuple[Motion, ...] = ()) -> list[TrueChange]:
    return list(truth_of(with_world(stays, motions)).changes)


def test_objects_have_their_states_boxes_and_centroids() -> None:
    truth = truth_of(simulated_traversals.two_traversals())
    assert [thing.id for thing in truth.objects] == ["table-1", "cup-1", "chair-1", "ball-1", "box-1"]
    cup, ball_, box = truth.object("cup-1"), truth.object("ball-1"), truth.object("box-1")
    assert (cup.states[0].since_ns, cup.states[0].until_ns, cup.states[0].on) == (
        None,
        simulated.CUP_LEAVES_NS,
        "table-1",
    )
    np.testing.assert_allclose(cup.states[0].box.center, [0.3, 0.1, 0.79])
    np.testing.assert_allclose(ball_.states[0].centroid, [2.2, -1.5, 0.25], atol=0.02)
    np.testing.assert_allclose(
        ball_.states[0].centroid, ball_.surface_world(ball_.states[0], only_seen=False).mean(axis=0), atol=1e-6
    )
    assert [state.since_ns for state in box.states] == [None, simulated.BOX_ARRIVES_NS]
    (motion,) = box.motions
    assert motion.stamps_ns.tolist() == [simulated.BOX_LEAVES_NS, simulated.BOX_ARRIVES_NS]
    np.testing.assert_allclose(motion.centers_world, [[-2.2, -1, 0.15], [-2.2, 1, 0.15]])


def test_surfaces_of_the_building_are_what_was_seen_by_label() -> None:
    truth = truth_of(simulated_traversals.two_traversals())
    assert [surface.label for surface in truth.surfaces] == ["floor", "ceiling", "wall"]
    walls = [fixture for fixture in simulated.room_fixtures() if fixture.label == "wall"]
    seen = sum((len(sample_surface(fixture.shape, 0.1)[0]) + 1) // 2 for fixture in walls)
    assert len(truth.surfaces[2].points_world) == seen


def test_the_truth_follows_its_schema() -> None:
    document = json.loads(
        json.dumps(to_document(truth_of(simulated_traversals.two_traversals(), (nothing_visible(),))))
    )
    Draft202012Validator(load_schema("truth")).validate(document)


def test_sightings_leave_out_what_is_not_in_the_image_and_number_states_in_the_order_of_time() -> None:
    late, early = ball(2, since_s=3), ball(0, until_s=3)
    visibility = PlaceVisibility(
        thing=np.array([3, 3, 3]),
        stay=np.array([0, 1, -1]),
        present=np.array([False, True, False]),
        in_image=np.array([0.5, 1.0, 0.0], np.float32),
        visible=np.array([0.25, 0.75, 0.0], np.float32),
        pixels=np.array([0, 900, 0]),
        distance_m=np.array([3.0, 2.0, 1.0], np.float32),
    )
    truth = truth_of(with_world((late, early)), (nothing_visible(), visibility))
    rows = truth.traversals[0].sightings
    assert rows.frame.tolist() == [1, 1]
    assert rows.object.tolist() == [3, 3]
    assert rows.state.tolist() == [1, 0]
    assert rows.present.tolist() == [False, True]
    assert rows.pixels.tolist() == [0, 900]


def test_a_person_has_one_motion_for_each_passage_at_the_middle_of_the_limbs() -> None:
    limb = simulated.block((0.2, 0.2, 1.0), (0, 0, 0), simulated.CLOTH)

    def walk(start_s: int, at: float) -> Motion:
        poses = np.stack([simulated.standing(at, 0, 0), simulated.standing(at, 2, 0)])
        return Motion("person-1", limb, START + S * np.array([start_s, start_s + 1]), poses)

    motions = (walk(0, -0.2), walk(0, 0.2), walk(3, -0.2), walk(3, 0.2))
    assert [len(limbs) for limbs in contiguous_motions(motions)] == [2, 2]
    world = simulated.small_world()
    person = SimulatedThing("person-1", "person", limb)
    walked = World(world.fixtures, (*world.things, person), world.stays, (*world.motions, *motions))
    truth = truth_of(replace(simulated_traversals.two_traversals(), world=walked))
    found = truth.object("person-1")
    assert (found.kind, found.states, len(found.motions)) == ("person", (), 2)
    np.testing.assert_allclose(found.motions[0].centers_world, [[0, 0, 0.5], [0, 2, 0.5]], atol=1e-9)
    assert not any(change.object_id == "person-1" for change in truth.changes)


def test_nothing_changes_where_everything_stands() -> None:
    assert changes_of(ball(0)) == []
    assert find_changes((), ()) == ()


@pytest.mark.parametrize(
    ("stays", "motions", "expected"),
    [
        ((ball(0, until_s=60),), (), [("disappeared", 0, None, 60, "monday", "tuesday")]),
        ((ball(0, since_s=60),), (), [("appeared", None, 0, 60, "monday", "tuesday")]),
        ((ball(0, since_s=3),), (), [("appeared", None, 0, 3, "monday", "monday")]),
        ((ball(0, since_s=-9),), (), []),
        ((ball(0, until_s=500),), (), []),
        ((ball(0, until_s=60), ball(2, since_s=60)), (), [("moved", 0, 1, 60, "monday", "tuesday")]),
        ((ball(0, until_s=10), ball(2, since_s=60)), (), [("moved", 0, 1, 10, "monday", "tuesday")]),
        ((ball(0, until_s=60), ball(0.05, since_s=60)), (), []),
        (
            (ball(0, until_s=2), ball(2, since_s=4)),
            (moving_ball(2, 4),),
            [("moved", 0, 1, 2, "monday", "monday")],
        ),
        (
            (ball(0, until_s=2), ball(0, since_s=60)),
            (),
            [("disappeared", 0, None, 2, "monday", "monday"), ("appeared", None, 1, 60, "monday", "tuesday")],
        ),
    ],
)
def test_changes(stays: tuple[Stay, ...], motions: tuple[Motion, ...], expected: list[tuple[object, ...]]) -> None:
    found = changes_of(*stays, motions=motions)
    assert [
        (change.kind, change.from_state, change.to_state, (change.stamp_ns - START) / S, *change.between)
        for change in found
    ] == expected


def test_a_move_says_how_far_and_until_when() -> None:
    (change,) = changes_of(ball(0, until_s=2), ball(2, since_s=4), motions=(moving_ball(2, 4),))
    assert change.distance_m == pytest.approx(2)
    assert change.until_ns == START + 4 * S


def test_the_box_of_a_turned_thing_turns_with_it() -> None:
    slab = simulated.block((2.0, 1.0, 0.5), (0, 0, 0), simulated.WOOD)
    world = simulated.small_world()
    T = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1.0, 0, 0])
    turned = World(world.fixtures, (SimulatedThing("slab-1", "slab", slab),), (Stay("slab-1", T),))
    box = truth_of(replace(simulated_traversals.two_traversals(), world=turned)).objects[0].states[0].box
    np.testing.assert_allclose(box.size, [2, 1, 0.5])
    assert box.yaw == pytest.approx(np.pi / 2)
    corners = transform_points(T, slab.vertices)
    np.testing.assert_allclose(np.sort(box.corners().max(axis=0)), np.sort(corners.max(axis=0)), atol=1e-9)
