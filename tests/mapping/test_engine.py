"""The engine as a whole: what it promises of its output, its switches, and its part in tracking."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from supermap_cli.config import Ablation
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.types.detections import Detections, no_detections
from supermap_cli.types.memory import MapDelta
from support import scenes as s

CHAIR_WORLD = (*s.ROOM, s.CHAIR)
FIRST = (*s.ROOM, s.TABLE, s.CUP, s.CHAIR.at(1.6, -1.0), s.PERSON.at(2.2, 1.2))
THEN = (*s.ROOM, s.TABLE, s.CUP.at(1.4, 0.4), s.CHAIR.at(1.6, 1.0))


def ablated(*components: Ablation) -> s.Run:
    return s.Run(engine=MappingEngine(ablate=frozenset(components)))


def flat(value: object) -> Iterator[object]:
    """Everything a delta holds, as comparable atoms in order."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from flat(getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        yield value.tobytes()
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key
            yield from flat(item)
    elif isinstance(value, tuple):
        for item in value:
            yield from flat(item)
    else:
        yield value


def a_day() -> list[MapDelta]:
    run, deltas = s.Run(), []
    for things in (FIRST, THEN, FIRST):
        run.walk(things, 5)
        deltas.append(run.take())
    return deltas


def test_the_same_input_gives_the_same_changes_in_the_same_order() -> None:
    one, other = a_day(), a_day()
    assert any(delta.temporal_edges for delta in one)
    for first, second in zip(one, other, strict=True):
        assert list(flat(first)) == list(flat(second))


def test_the_order_of_detections_in_an_image_does_not_matter_to_where_things_are() -> None:
    def backwards(scene: s.Scene, at_s: float) -> Detections:
        found = s.detect(scene, at_s)
        return found.take(np.arange(len(found))[::-1])

    one, other = s.Run(), s.Run(detector=backwards)
    for run in (one, other):
        run.walk(FIRST, 5)
    boxes = [sorted((obj.label, *obj.shape.box.center.tolist()) for obj in run.standing()) for run in (one, other)]
    assert boxes[0] == boxes[1]


def test_changes_are_taken_once() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    assert run.take() != MapDelta()
    assert run.take() == MapDelta()


def test_how_often_the_changes_are_taken_makes_no_difference_to_them() -> None:
    often, seldom = s.Run(), s.Run()
    pieces = []
    for things in (FIRST, THEN):
        for y in np.linspace(-0.5, 0.5, 5):
            often.see(things, (0.0, float(y), 1.2))
            pieces.append(often.take())
        seldom.walk(things, 5)
    whole = seldom.take()
    for field in ("observations", "temporal_edges"):
        assert [a for piece in pieces for a in flat(getattr(piece, field))] == list(flat(getattr(whole, field)))
    latest = {instance.number: instance for piece in pieces for instance in piece.instances}
    for instance in whole.instances:
        assert list(flat(latest.pop(instance.number))) == list(flat(instance))
    assert not latest


def test_the_states_of_one_instance_never_overlap() -> None:
    run, states = s.Run(), {}
    for things in (FIRST, THEN, s.ROOM, FIRST, THEN, s.ROOM):
        run.walk(things, 10)
        run.pause(5)
        states.update({(state.object_number, state.index): state for state in run.take().states})
    assert len(states) > 6
    for (number, index), state in states.items():
        assert state.first_seen_ns <= state.last_seen_ns
        assert state.gone_ns is None or state.last_seen_ns < state.gone_ns
        later = states.get((number, index + 1))
        if later is not None:
            assert state.gone_ns is not None
            assert state.gone_ns <= later.first_seen_ns


def test_the_position_of_an_object_and_of_its_states_is_the_centre_of_the_box() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 3)
    delta = run.take()
    assert delta.instances
    assert delta.states
    for record in (*delta.instances, *delta.states):
        np.testing.assert_array_equal(record.centroid_map, record.box.center)


def test_touched_are_the_objects_of_the_last_keyframe() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 3)
    assert run.engine.touched == {1}
    run.walk(s.ROOM, 1, target=(1.6, 4, 0.4))
    assert run.engine.touched == frozenset()


def test_an_image_no_detector_looked_at_speaks_by_its_geometry_alone() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    before = (run.map[1].existence.log_odds, run.map[1].observations, run.map[1].voxels.log_odds.sum())
    run.detector = lambda scene, at_s: None
    run.walk(CHAIR_WORLD)
    after = (run.map[1].existence.log_odds, run.map[1].observations, run.map[1].voxels.log_odds.sum())
    assert after[:2] == before[:2]
    assert after[2] > before[2]


# -- tracking


def priors_of(run: s.Run, *things: s.Thing) -> dict[int, tuple[np.ndarray, bool]]:
    look = s.view_of(run.engine, s.render((*s.ROOM, *things), s.looking((0, 0.3, 1.2), (1.6, 0, 0.4))).keyframe)
    return {prior.track_id: (prior.box_xyxy, prior.hidden) for prior in run.engine.update_from_map(look)}


def tracked_chair(run: s.Run) -> s.Run:
    run.walk(CHAIR_WORLD)
    scene = s.render(CHAIR_WORLD, s.looking((0, 0, 1.2), (1.6, 0, 0.4)), run.at_s)
    s.integrate(run.engine, s.view_of(run.engine, scene.keyframe), s.detect(scene, run.at_s), np.array([41]))
    return run


def test_a_tracked_object_is_expected_where_it_will_be_seen() -> None:
    run = tracked_chair(s.Run())
    box, hidden = priors_of(run, s.CHAIR)[41]
    seen = s.detect(s.render(CHAIR_WORLD, s.looking((0, 0.3, 1.2), (1.6, 0, 0.4)))).boxes_xyxy[0]
    np.testing.assert_allclose(box, seen, atol=9)
    assert not hidden


def test_behind_a_screen_it_is_still_expected_but_hidden() -> None:
    screen = s.Thing("", (0.9, 0, 0.8), (0.05, 1.6, 1.8))
    ((_, hidden),) = priors_of(tracked_chair(s.Run()), screen).values()
    assert hidden


def test_what_is_not_tracked_or_gone_is_not_expected() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    assert priors_of(run, s.CHAIR) == {}
    run = s.Run()
    run.walk(CHAIR_WORLD, 10)
    tracked_chair(run).pause(5)
    run.walk(s.ROOM)
    assert priors_of(run, s.CHAIR) == {}


def test_each_camera_expects_the_objects_of_its_own_tracker() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    scene = s.render(CHAIR_WORLD, s.looking((0, 0, 1.2), (1.6, 0, 0.4)), run.at_s)
    keyframes = {name: dataclasses.replace(scene.keyframe, camera_id=name) for name in ("left", "right", "rear")}
    for name, track_id in (("left", 7), ("right", 7001)):
        view = s.view_of(run.engine, keyframes[name])
        s.integrate(run.engine, view, s.detect(scene, run.at_s), np.array([track_id]))
    expected = {
        name: [prior.track_id for prior in run.engine.update_from_map(s.view_of(run.engine, keyframe))]
        for name, keyframe in keyframes.items()
    }
    assert expected == {"left": [7], "right": [7001], "rear": []}


# -- ablations


def test_without_the_tracker_a_new_track_is_a_new_thing() -> None:
    """Two walks past one chair, of which the image's own tracker makes two tracks."""
    things = {}
    for name, run in (("whole", s.Run()), ("ablated", ablated("tracker"))):
        for track_id in (41, 42):
            for y in np.linspace(-0.5, 0.5, 6):
                scene = s.render(CHAIR_WORLD, s.looking((0, float(y), 1.2), s.CHAIR.center), run.at_s)
                look = s.view_of(run.engine, scene.keyframe)
                if name == "ablated":
                    assert run.engine.update_from_map(look) == ()
                s.integrate(run.engine, look, s.detect(scene, run.at_s), np.array([track_id]))
                run.at_s += 1 / 3
        things[name] = len(run.standing("chair"))
    assert things == {"whole": 1, "ablated": 2}


def test_without_geometric_consistency_what_is_hidden_counts_as_missed() -> None:
    screen = s.Thing("", (0.8, 0, 1.0), (0.1, 4, 4))
    existence = {}
    for name, run in (("whole", s.Run()), ("ablated", ablated("geometric-consistency"))):
        run.walk(CHAIR_WORLD)
        run.walk((*CHAIR_WORLD, screen))
        existence[name] = run.engine.objects[1].existence.log_odds
    assert existence["ablated"] < existence["whole"]


def test_without_geometric_consistency_nothing_is_seen_to_be_gone() -> None:
    run = ablated("geometric-consistency")
    run.walk(CHAIR_WORLD)
    run.walk(s.ROOM, 12)
    assert run.engine.objects[1].present
    assert run.take().temporal_edges == ()


def test_without_semantic_fusion_the_last_detection_decides_the_label() -> None:
    def mostly_chair(scene: s.Scene, at_s: float) -> Detections:
        label = "couch" if at_s > 1.9 else "chair"
        return s.detections_of([scene.mask(2)], [[(label, 0.6), ("chair" if label == "couch" else "couch", 0.3)]], at_s)

    labels = {}
    for name, run in (("whole", s.Run()), ("ablated", ablated("semantic-fusion"))):
        run.detector = mostly_chair
        run.walk(CHAIR_WORLD, 7)
        labels[name] = run.map[1].label
    assert labels == {"whole": "chair", "ablated": "couch"}


def test_without_semantic_fusion_silence_says_nothing() -> None:
    existence = {}
    for name, run in (("whole", s.Run()), ("ablated", ablated("semantic-fusion"))):
        run.walk(CHAIR_WORLD)
        run.detector = lambda _, at_s: no_detections(s.ns(at_s))
        run.walk(CHAIR_WORLD)
        existence[name] = run.map[1].existence.log_odds
    assert existence["whole"] < existence["ablated"]


@pytest.mark.parametrize("component", ["semantic-fusion", "geometric-consistency"])
def test_with_a_component_switched_off_a_still_world_is_mapped_all_the_same(component: Ablation) -> None:
    run = ablated(component)
    run.walk((*s.ROOM, s.TABLE, s.CUP))
    assert sorted(obj.label for obj in run.standing()) == ["cup", "dining table"]
