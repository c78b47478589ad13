"""People: limbs that belong together, ways round obstacles, things carried from hand to place."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.simulation.motion.free_space import FreeSpace
from supermap_cli.simulation.motion.people import PERSON_CLEARANCE_M, carried_by_person, walking_person
from supermap_cli.simulation.world import Material, Shape, SimulatedThing
from support.small_office import furniture, two_rooms

START_NS = 1_700_000_000_000_000_000
PERSON, MOTIONS = walking_person(
    "person-1",
    two_rooms(),
    furniture(),
    np.random.default_rng(0),
    start_xy=np.array([0.8, 5.2]),
    goal_xy=np.array([7.4, 3.0]),
    start_ns=START_NS,
)
CUBE = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (0, 0.2)], float)
BAG = SimulatedThing(
    "bag-1", "handbag", Shape(CUBE, np.array([[0, 1, 2]]), np.zeros(1, np.int64), (Material((9, 9, 9)),))
)
T_FROM = make_transform(np.eye(3), [2.0, 3.9, 0.74])
T_TO = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [6.2, 3.0, 0.0])
CARRIAGE = carried_by_person(
    "person-2",
    BAG,
    T_FROM,
    T_TO,
    two_rooms(),
    furniture(),
    np.random.default_rng(1),
    start_ns=START_NS,
    come_from_xy=np.array([1.0, 0.8]),
    leave_to_xy=np.array([7.5, 0.8]),
)


def test_all_limbs_share_the_id_the_label_and_the_time() -> None:
    assert PERSON.label == "person"
    assert {motion.thing_id for motion in MOTIONS} == {PERSON.id}
    assert len(MOTIONS) == 6
    assert all(np.array_equal(motion.stamps_ns, MOTIONS[0].stamps_ns) for motion in MOTIONS)
    assert MOTIONS[0].stamps_ns[0] == START_NS


@pytest.mark.parametrize("motions", [MOTIONS, CARRIAGE.person_motions], ids=["walking", "carrying"])
def test_the_limbs_stay_together_in_a_box_of_a_persons_size(motions: tuple) -> None:
    for k in range(0, len(motions[0].stamps_ns), 7):
        points = np.vstack([transform_points(motion.T_world_body[k], motion.shape.vertices) for motion in motions])
        size = np.ptp(points, axis=0)
        assert 1.5 < size[2] < 1.95
        assert np.hypot(*size[:2]) < 1.7
        assert -0.06 < points[:, 2].min() < 0.05


def test_legs_swing_against_one_another() -> None:
    forward = np.array([motion.T_world_body[:, 2, 1] for motion in MOTIONS[3::2]])
    assert np.allclose(forward[0], -forward[1], atol=1e-9)
    assert np.abs(forward).max() > 0.3


def test_a_person_walks_at_the_speed_round_all_obstacles() -> None:
    way = MOTIONS[0].T_world_body[:, :2, 3]
    free = FreeSpace(two_rooms(), furniture(), clearance_m=PERSON_CLEARANCE_M - 0.06)
    assert free.are_free(way).all()
    speed = np.linalg.norm(np.diff(way, axis=0), axis=1) / np.diff(MOTIONS[0].stamps_ns) * 1e9
    assert speed.max() < 1.25
    assert np.median(speed) == pytest.approx(1.1, abs=0.1)
    assert np.allclose(way[[0, -1]], [[0.8, 5.2], [7.4, 3.0]])


def test_a_person_faces_where_it_walks() -> None:
    T = MOTIONS[0].T_world_body
    step = np.diff(T[:, :2, 3], axis=0)
    going = np.linalg.norm(step, axis=1) > 0.04
    front = -T[:-1, :2, 1]
    cosine = np.einsum("ij,ij->i", step, front)[going] / np.linalg.norm(step, axis=1)[going]
    assert np.median(cosine) > 0.95
    assert cosine.min() > 0.4


def test_a_carried_thing_goes_from_its_place_to_the_other_without_a_jump() -> None:
    motion = CARRIAGE.thing_motion
    assert motion.thing_id == BAG.id
    assert np.allclose(motion.T_world_body[0], T_FROM)
    assert np.allclose(motion.T_world_body[-1], T_TO)
    speed = np.linalg.norm(np.diff(motion.T_world_body[:, :3, 3], axis=0), axis=1) / np.diff(motion.stamps_ns) * 1e9
    assert speed.max() < 2.5


def test_a_carried_thing_is_moved_while_the_person_is_there_and_within_its_reach() -> None:
    motion, body = CARRIAGE.thing_motion, CARRIAGE.person_motions[0]
    assert body.stamps_ns[0] < motion.stamps_ns[0] < motion.stamps_ns[-1] < body.stamps_ns[-1]
    for k in range(0, len(motion.stamps_ns), 5):
        T_world_person = body.at(int(motion.stamps_ns[k]))
        assert T_world_person is not None
        assert np.linalg.norm(T_world_person[:2, 3] - motion.T_world_body[k, :2, 3]) < 1.2


def test_a_thing_out_of_reach_cannot_be_fetched() -> None:
    with pytest.raises(ValueError, match="no free place"):
        carried_by_person(
            "person-3",
            BAG,
            make_transform(np.eye(3), [30.0, 0, 0]),
            T_TO,
            two_rooms(),
            furniture(),
            np.random.default_rng(1),
            start_ns=START_NS,
            come_from_xy=np.array([1.0, 0.8]),
            leave_to_xy=np.array([1.0, 0.8]),
        )
