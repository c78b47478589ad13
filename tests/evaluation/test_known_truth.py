"""What of the truth a map can be held to."""

from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.evaluation.known_truth import known_truth
from support import evaluated as e


def test_an_empty_keyframe_list_knows_nothing():
    truth = e.still_life()
    known = known_truth(replace(e.perfect_map(truth), keyframes_ns=np.zeros(0, np.int64)), truth)
    assert (known.traversals, known.end_ns, known.places, known.standing) == ((), None, (), ())
    assert known.visible.shape == known.present.shape == (0, 0)


def test_a_traversal_that_was_not_mapped_is_left_out_with_all_that_began_later():
    truth = e.two_days()
    known = known_truth(replace(e.perfect_map(truth), keyframes_ns=truth.traversals[0].stamps_ns), truth)
    assert [traversal.name for traversal in known.traversals] == ["monday"]
    assert {known.places[k].object.id for k in known.standing} == {"chair-1", "table-1", "plant-1", "bag-1"}
    assert all(place.object.id != "cart-1" for place in known.places)


def test_an_object_is_countable_once_an_image_shows_it_well_where_it_stands():
    objects = (
        e.thing("cup-1", e.stay((0, 0, 0))),
        e.thing("pen-1", e.stay((1, 0, 0))),
        e.thing("jar-1", e.stay((2, 0, 0))),
    )

    def look(object_id, state, second):
        if object_id == "cup-1":
            return e.Sight(pixels=99 if second < 4 else 100)
        return e.Sight(pixels=99) if object_id == "pen-1" else e.Sight(visible=0.1)

    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)])
    known = known_truth(e.empty_map(truth), truth)
    assert [place.well_seen_ns for place in known.places] == [e.ns(4), None, None]
    assert known.in_view_with_object.sum(axis=1).tolist() == [6, 0, 0]


def test_what_only_images_between_the_keyframes_showed_well_is_not_countable():
    objects = e.still_life().objects[:1]
    look = lambda object_id, state, second: e.Sight(pixels=1000 if second == 4 else 99)  # noqa: E731
    truth = e.world(objects, [e.traversal("monday", 0, 9, objects, look)])
    estimate = e.empty_map(truth)
    for stamps_ns, seen in (
        (e.ns(4) + np.array([-4 * e.SECOND, 250_000_000, 5 * e.SECOND]), e.ns(4)),
        (e.ns(4) + np.array([-4 * e.SECOND, 260_000_000, 5 * e.SECOND]), None),
    ):
        [place] = known_truth(replace(estimate, keyframes_ns=stamps_ns), truth).places
        assert place.well_seen_ns == seen


@pytest.mark.parametrize(
    ("mapped", "not_mapped", "partly_mapped", "gap"),
    [
        (lambda at: at >= 0, (), (), None),
        (lambda at: (at >= 2) & (at != 50) & (at <= 107), (), (), None),
        (lambda at: at >= 3, (), ("monday",), "not judged: the map lacks a part of monday"),
        (lambda at: at <= 106, (), ("tuesday",), "not judged: the map lacks a part of tuesday"),
        (lambda at: at < 50, ("tuesday",), (), "not judged: the map lacks tuesday"),
        (lambda at: at > 105, ("monday",), ("tuesday",), "not judged: the map lacks monday and a part of tuesday"),
    ],
)
def test_a_map_of_less_than_all_traversals_has_a_gap(mapped, not_mapped, partly_mapped, gap):
    truth = e.two_days()
    stamps_ns = e.keyframes(truth)
    known = known_truth(replace(e.perfect_map(truth), keyframes_ns=stamps_ns[mapped(stamps_ns / e.SECOND)]), truth)
    assert (known.not_mapped, known.partly_mapped, known.gap) == (not_mapped, partly_mapped, gap)


def test_a_place_is_judged_by_its_whole_box_whatever_was_seen_of_it():
    [cube] = e.still_life().objects[:1]
    for seen in (cube.surface_object[:, 0] > 0.19, np.zeros(384, bool), np.ones(384, bool)):
        objects = (replace(cube, surface_seen=seen),)
        truth = e.world(objects, [e.traversal("monday", 0, 9, objects)])
        [place] = known_truth(e.empty_map(truth), truth).places
        np.testing.assert_allclose(place.centroid, [0, 0, 0.2], atol=1e-6)
        np.testing.assert_allclose(place.box.center, [0, 0, 0.2])


def test_keyframes_take_the_nearest_image_within_50_ms():
    truth = e.still_life()
    stamps_ns = np.array([e.ns(2) + 40_000_000, e.ns(5) - 60_000_000, e.ns(7)])
    known = known_truth(replace(e.perfect_map(truth), keyframes_ns=stamps_ns), truth)
    assert known.stamps_ns.tolist() == [stamps_ns[0], stamps_ns[2]]


def test_a_place_is_empty_before_and_after_its_object_stands_there():
    truth = e.two_days()
    known = known_truth(e.empty_map(truth), truth)
    plant, cart = known.place_of("plant-1", 0), known.place_of("cart-1", 0)
    assert known.in_view_empty[plant].tolist() == [False] * 10 + [True] * 10
    assert known.in_view_empty[cart].tolist() == [True] * 10 + [False] * 10
    assert known.in_view_left[plant].tolist() == [False] * 10 + [True] * 10
    assert not known.in_view_left[cart].any()
    assert known.place_of("plant-1", None) is None


def two_cameras():
    """One traversal of 0 to 9 s: every second the left camera shows the cup alone, the right one the pen alone."""
    objects = (e.thing("cup-1", e.stay((0, 0, 0))), e.thing("pen-1", e.stay((1, 0, 0))))
    shown = {"left": "cup-1", "right": "pen-1"}
    one, other = (
        e.traversal("monday", 0, 9, objects, lambda object_id, *_, own=own: e.Sight() if object_id == own else None)
        for own in shown.values()
    )
    rows, more = one.sightings, other.sightings
    sightings = replace(
        rows,
        frame=np.concatenate([2 * rows.frame, 2 * more.frame + 1]),
        **{
            name: np.concatenate([getattr(rows, name), getattr(more, name)])
            for name in ("object", "state", "present", "in_image", "visible", "pixels", "distance_m")
        },
    )
    both = replace(
        one,
        stamps_ns=np.repeat(one.stamps_ns, 2),
        T_world_base=np.repeat(one.T_world_base, 2, axis=0),
        sightings=sightings,
        camera_ids=("left", "right") * 10,
    )
    return e.world(objects, [both])


def test_images_that_several_cameras_took_at_once_are_one_view():
    truth = two_cameras()
    stamps_ns = truth.traversals[0].stamps_ns
    for cameras in ((), ("left", "right") * 10):
        known = known_truth(replace(e.empty_map(truth), keyframes_ns=stamps_ns, keyframe_cameras=cameras), truth)
        assert known.stamps_ns.tolist() == [e.ns(second) for second in range(10)]
        assert known.in_view_with_object.all()


def test_a_keyframe_shows_what_its_own_camera_shows():
    truth = two_cameras()
    stamps_ns = np.array([e.ns(2), e.ns(4), e.ns(4), e.ns(6)])
    cameras = ("left", "left", "right", "right")
    known = known_truth(replace(e.empty_map(truth), keyframes_ns=stamps_ns, keyframe_cameras=cameras), truth)
    assert known.stamps_ns.tolist() == [e.ns(2), e.ns(4), e.ns(6)]
    assert known.in_view.tolist() == [[True, True, False], [False, True, True]]
    assert [place.well_seen_ns for place in known.places] == [e.ns(2), e.ns(4)]


def test_what_only_a_camera_showed_that_was_not_mapped_is_not_countable():
    truth = two_cameras()
    stamps_ns = truth.traversals[0].stamps_ns[::2]
    known = known_truth(replace(e.empty_map(truth), keyframes_ns=stamps_ns, keyframe_cameras=("left",) * 10), truth)
    assert [place.countable for place in known.places] == [True, False]
