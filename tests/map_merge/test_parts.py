"""Which clouds are one thing, what was pushed aside, and which relations go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supermap_cli.geometry.cameras import camera_to_json
from supermap_cli.geometry.voxels import pack_keys, voxel_keys
from supermap_cli.map_merge.depth_consistency import DepthConsistency, stored_view
from supermap_cli.map_merge.displacement import DisplacementHypothesis, displacement_hypothesis
from supermap_cli.map_merge.matching import match_in_place, match_parts
from supermap_cli.map_merge.relations import merge_edges, reevaluate_edges
from supermap_cli.mapping.belief import Existence, LabelBelief
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.mapping.objects import MapObject, ObjectMap, ObjectStatus, OpenState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.memory import KeyframeRecord, SpatialEdge
from support import memories as m
from support import scenes as s

STORED = ObjectStatus(confirmed=True, stored=True)
TABLE = s.Thing("table", (2.0, 0, 0.4), (0.8, 1.6, 0.8), (150, 100, 60))


def thing(number: int, of: s.Thing, low: float = 0.0, high: float = 1.0) -> MapObject:
    """The surface of a box as an object, or only a part of it along its y axis."""
    box_low, box_high = np.array(of.center) - np.array(of.size) / 2, np.array(of.center) + np.array(of.size) / 2
    ticks = [np.arange(a + 0.01, b, 0.02) for a, b in zip(box_low, box_high, strict=True)]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    on_rim = (np.abs(points - box_low) < 0.025).any(axis=1) | (np.abs(points - box_high) < 0.025).any(axis=1)
    along = (points[:, 1] - box_low[1]) / of.size[1]
    points = points[on_rim & (along >= low) & (along <= high)]
    codes = np.unique(pack_keys(voxel_keys(points, 0.02)))
    ones = np.ones(len(codes), np.float32)
    labels = LabelBelief()
    labels.update((Hypothesis(of.label, 0.9),), 2.0)
    voxels = VoxelMap(0.02, codes, ones * 2, ones * 3, ones * 0, np.tile(np.float32(of.rgb), (len(codes), 1)))
    return MapObject(number, voxels, labels, Existence(4.0), OpenState(0, s.ns(0)), s.ns(0), s.ns(5), status=STORED)


def record(things: tuple[s.Thing, ...], eye: s.Point, at_s: float) -> KeyframeRecord:
    scene = s.render((*s.ROOM, *things), s.looking(eye, (2.0, 0, 0.4)), at_s)
    keyframe = scene.keyframe
    return KeyframeRecord(
        keyframe.stamp_ns,
        keyframe.T_map_base,
        keyframe.T_map_camera,
        camera_to_json(keyframe.camera),
        encode_small_depth(keyframe, 2),
        2,
        None,
        detected=True,
    )


def looks(things: tuple[s.Thing, ...]) -> list[KeyframeRecord]:
    return [record(things, (0.0, float(y), 1.6), 100 + k) for k, y in enumerate(np.linspace(-1, 1, 8))]


def test_each_cloud_is_given_to_the_thing_it_lies_on_best() -> None:
    left, right = (thing(k, s.CHAIR.at(1.6, y)) for k, y in ((1, -0.3), (2, 0.3)))
    others = [thing(-1, s.CHAIR.at(1.62, 0.28)), thing(-2, s.CHAIR.at(1.6, -0.25))]
    pairs = {known.number: other.number for known, other in match_in_place([left, right], others)}
    assert pairs == {1: -2, 2: -1}


def test_another_thing_in_that_place_is_not_it() -> None:
    assert (
        match_in_place([thing(1, s.CHAIR)], [thing(-1, replace(s.CHAIR, label="plant", size=(0.15, 0.15, 0.2)))]) == []
    )
    assert match_in_place([thing(1, s.CHAIR)], [thing(-1, s.CHAIR.at(2.8, 1.5))]) == []


def test_what_had_gone_is_only_met_by_what_nothing_standing_explains() -> None:
    gone, stands = thing(1, s.CHAIR), thing(2, s.CHAIR.at(1.6, 0.05))
    gone.mark_absent(None)
    pairs = match_in_place([gone, stands], [thing(-1, s.CHAIR)])
    assert [known.number for known, _ in pairs] == [2]
    assert [known.number for known, _ in match_in_place([gone], [thing(-1, s.CHAIR)])] == [1]


def test_an_end_of_a_thing_is_a_part_of_it() -> None:
    whole, ends = thing(1, TABLE), [thing(-1, TABLE, high=0.3), thing(-2, TABLE, low=0.75)]
    assert [known.number for known, _ in match_parts([whole], ends)] == [1, 1]
    assert match_parts([whole], [thing(-3, TABLE.at(2.0, 1.7))]) == []


def compare(
    known: MapObject, things: tuple[s.Thing, ...], aside: DisplacementHypothesis | None = None
) -> DepthConsistency:
    objects = ObjectMap(10)
    objects.add(known)
    consistency = DepthConsistency(objects, frozenset(), {} if aside is None else {known.number: aside})
    for keyframe in looks(things):
        consistency.add_keyframe(1, keyframe)
    return consistency


def test_a_place_seen_empty_says_that_its_thing_has_gone_since_the_first_look_that_showed_it() -> None:
    known = thing(1, TABLE)
    consistency = compare(known, ())
    assert not known.present
    assert known.gone_ns == s.ns(100)
    assert consistency.views[1, 1].contradicted >= 3


def test_a_thing_that_stands_is_in_view_and_is_believed_less_if_no_detector_finds_it() -> None:
    known = thing(1, TABLE)
    consistency = compare(known, (TABLE,))
    assert known.present
    assert consistency.views[1, 1].in_view >= 6
    assert consistency.views[1, 1].contradicted == 0
    assert known.existence.log_odds < 4.0


def test_a_thing_behind_another_is_neither_there_nor_gone() -> None:
    known = thing(1, TABLE)
    screen = s.Thing("box", (1.2, 0, 1.0), (0.1, 4.0, 2.0))
    consistency = compare(known, (screen,))
    assert known.present
    assert known.existence.log_odds == 4.0
    assert (1, 1) not in consistency.views


def test_a_thing_pushed_aside_is_told_from_one_that_was_seen_from_another_side() -> None:
    armchair = replace(s.CHAIR, label="armchair", center=(2.0, 0, 0.4), size=(0.7, 0.7, 0.8))
    known, pushed = thing(1, armchair), thing(-1, armchair.at(2.05, 0.25))
    aside = displacement_hypothesis(known, pushed)
    assert aside is not None
    np.testing.assert_allclose(aside.shift_m[:2], (0.05, 0.25), atol=0.08)  # of equal ones the least
    compare(known, (armchair.at(2.05, 0.25),), aside)
    assert aside.is_accepted
    assert aside.since_ns is not None

    whole, end = thing(1, TABLE, low=0.5), thing(-1, TABLE, high=0.7)
    askew = displacement_hypothesis(whole, end)
    assert askew is not None
    compare(whole, (TABLE,), askew)
    assert not askew.is_accepted
    assert displacement_hypothesis(known, thing(-1, armchair)) is None


def test_the_stored_depth_is_never_bolder_than_the_image_was() -> None:
    """Around every pixel the nearest return counts, so that no ray went through what none went through."""
    stored = record((TABLE,), (0.0, 0.3, 1.6), 0.0)
    view = stored_view(stored)
    scene = s.render((*s.ROOM, TABLE), s.looking((0.0, 0.3, 1.6), (2.0, 0, 0.4)), 0.0)
    seen = (view.nearest_m > 0) & np.isfinite(view.nearest_m) & (scene.keyframe.depth_m > 0)
    assert seen.mean() > 0.5
    assert (view.nearest_m[seen] <= scene.keyframe.depth_m[seen] + 0.002).mean() > 0.97


def edge(subject: int, relation: str, obj: int, since: float, until: float | None = None) -> SpatialEdge:
    return SpatialEdge(subject, relation, obj, m.ns(since), m.maybe_ns(until), 0.9)


def test_a_relation_that_holds_in_both_goes_on() -> None:
    (joined,) = merge_edges([edge(1, "on", 2, 0)], [edge(1, "on", 2, 100, 150)], {}).values()
    assert joined == edge(1, "on", 2, 0, 150)


def test_a_relation_ends_when_one_of_its_ends_has_left() -> None:
    joined = merge_edges([edge(1, "on", 2, 0)], [edge(1, "on", 2, 100)], {1: m.ns(90)})
    assert set(joined.values()) == {edge(1, "on", 2, 0, 90), edge(1, "on", 2, 100)}
    assert merge_edges([edge(1, "on", 2, 0)], [], {2: m.ns(90)})[1, "on", 2, m.ns(0)].until_ns == m.ns(90)


def test_a_relation_of_which_the_other_memory_says_nothing_is_left_as_it_is() -> None:
    assert merge_edges([edge(1, "on", 2, 0)], [], {}) == {}


def test_a_relation_that_ended_and_holds_again_does_not_go_back_behind_its_end() -> None:
    objects = ObjectMap(3)
    for obj in (thing(1, s.TABLE), thing(2, s.CUP)):
        objects.add(obj)
    ended = SpatialEdge(2, "on", 1, s.ns(1), s.ns(3), 0.9)
    changed: dict[tuple[int, str, int, int], SpatialEdge] = {}
    reevaluate_edges(changed, [ended], objects, {1, 2}, s.ns(5))
    assert (2, "on", 1, s.ns(3)) in changed
    assert [edge.since_ns for edge in changed.values() if edge.relation == "on"] == [s.ns(3)]
