"""How a thing enters the map, and how false alarms do not."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.types.detections import Detections, no_detections
from supermap_cli.types.existence import probability_of
from supermap_cli.types.memory import MapDelta
from support import scenes as s

CHAIR_WORLD = (*s.ROOM, s.CHAIR)


def test_a_map_of_nothing_changes_nothing() -> None:
    run = s.Run(detector=lambda _, at_s: no_detections(s.ns(at_s)))
    run.walk(CHAIR_WORLD)
    assert run.take() == MapDelta()


def test_a_thing_enters_the_map_on_its_third_sighting_with_all_that_was_seen_of_it() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 2)
    assert run.take() == MapDelta()
    run.see(CHAIR_WORLD, (0, 0.3, 1.2))
    delta = run.take()
    (chair,) = delta.instances
    assert (chair.number, chair.label, chair.presence, chair.observations) == (1, "chair", "present", 3)
    assert [observation.stamp_ns for observation in delta.observations] == [s.ns(0), s.ns(1 / 3), s.ns(2 / 3)]
    assert {observation.object_number for observation in delta.observations} == {1}
    (state,) = delta.states
    assert (state.index, state.first_seen_ns, state.last_seen_ns, state.gone_ns) == (0, s.ns(0), s.ns(2 / 3), None)
    assert state.confidence == probability_of(chair.existence_log_odds) > 0.5


@pytest.mark.parametrize(("apart_s", "enters"), [(0.2, False), (1.0, True)])
def test_two_strong_sightings_are_enough_if_not_in_quick_succession(apart_s: float, enters: bool) -> None:
    """A slow detector must not need more time in view than a fast one."""
    run = s.Run()
    run.see(CHAIR_WORLD, (0, -0.5, 1.2))
    run.pause(apart_s - 1 / 3)
    run.see(CHAIR_WORLD, (0, 0.5, 1.2))
    assert bool(run.standing("chair")) == enters


def test_who_walks_by_is_not_taken_for_clutter() -> None:
    person = replace(s.CHAIR, label="person")
    run = s.Run()
    run.see((*s.ROOM, person), (0, 0, 1.2))
    run.pause(4)
    run.walk(s.ROOM, 4)
    assert len(run.engine.objects) == 0
    assert sum(run.engine.scores.clutter) == 0


def test_it_stands_where_it_stands_and_is_as_large_as_it_looks() -> None:
    run = s.Run()
    for eye in ((0, -1.3, 1.3), (0, 1.3, 1.3), (1.6, 1.9, 1.3), (1.6, -1.9, 1.3), (0.3, 0, 1.3)):
        run.see(CHAIR_WORLD, eye)
    (chair,) = run.standing("chair")
    np.testing.assert_allclose(chair.shape.box.center, s.CHAIR.center, atol=0.06)
    np.testing.assert_allclose(np.sort(chair.shape.box.size), np.sort(s.CHAIR.size), atol=0.08)


def test_one_false_alarm_never_enters_the_map() -> None:
    def alarmed_once(scene: s.Scene, at_s: float) -> Detections:
        blob = np.zeros(scene.owner.shape, bool)
        blob[80:105, 20:50] = True
        chair = (scene.mask(2), [("chair", 0.8)])
        dog = (blob, [("dog", 0.9)])
        found = [chair, dog] if 0.9 < at_s < 1.1 else [chair]
        return s.detections_of([mask for mask, _ in found], [said for _, said in found], at_s)

    run = s.Run(detector=alarmed_once)
    run.walk(CHAIR_WORLD, 12)
    assert [obj.label for obj in run.map.values()] == ["chair"]
    assert [instance.label for instance in run.take().instances] == ["chair"]


def test_an_alarm_that_lasts_for_a_moment_does_not_enter_either() -> None:
    def alarmed_for_a_moment(scene: s.Scene, at_s: float) -> Detections:
        return s.detect(scene, at_s) if round(3 * at_s) in (3, 4) else no_detections(s.ns(at_s))

    run = s.Run(detector=alarmed_for_a_moment)
    run.walk(CHAIR_WORLD, 6)
    run.walk(CHAIR_WORLD, 6)
    assert not run.map


def test_weak_detections_give_birth_to_nothing_but_support_what_is_there() -> None:
    run = s.Run(detector=lambda scene, at_s: s.detect(scene, at_s, score=0.2))
    run.walk(CHAIR_WORLD)
    assert len(run.engine.objects) == 0
    run.detector = s.detect
    run.walk(CHAIR_WORLD, 3)
    run.detector = lambda scene, at_s: s.detect(scene, at_s, score=0.2)
    run.walk(CHAIR_WORLD, 3)
    assert run.standing("chair")[0].observations == 6


def test_hesitant_detections_need_longer() -> None:
    def looks_needed(score: float) -> int:
        run = s.Run(detector=lambda scene, at_s: s.detect(scene, at_s, score=score))
        for looks in range(1, 30):
            run.see(CHAIR_WORLD, (0, 1.2 * np.sin(looks), 1.2))
            if run.map:
                return looks
        pytest.fail("it never entered the map")

    assert looks_needed(0.9) <= looks_needed(0.6) < looks_needed(0.35)


def test_what_is_found_in_one_image_of_six_for_long_is_there() -> None:
    def found_now_and_then(scene: s.Scene, at_s: float) -> Detections:
        return s.detect(scene, at_s) if round(3 * at_s) % 6 == 0 else no_detections(s.ns(at_s))

    run = s.Run(detector=found_now_and_then)
    for _ in range(5):
        run.walk(CHAIR_WORLD, 6)
    assert [obj.label for obj in run.standing("chair")] == ["chair"]


def test_what_was_believed_in_for_a_moment_and_stands_there_no_more_has_not_left() -> None:
    run = s.Run(detector=lambda scene, at_s: s.detect(scene, at_s, score=0.5))
    run.walk(CHAIR_WORLD, 3)
    assert run.standing("chair")
    assert run.map[1].existence.log_odds < 4
    run.pause(5)
    run.walk(s.ROOM, 6)
    assert [edge.kind for edge in run.take().temporal_edges] == []
    assert run.map[1].demoted


def test_a_detection_without_depth_is_none() -> None:
    run = s.Run(detector=lambda scene, at_s: s.detect(s.render(CHAIR_WORLD, scene.keyframe.T_map_camera), at_s))
    run.walk((), 6)
    assert len(run.engine.objects) == 0


def test_two_things_get_numbers_of_their_own_that_stay() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.CHAIR.at(1.6, 0.5), s.BOX.at(1.6, -0.5)))
    numbers = {obj.label: obj.number for obj in run.standing()}
    run.walk((*s.ROOM, s.BOX.at(1.6, -0.5), s.CHAIR.at(1.6, 0.5)))
    assert sorted(numbers) == ["box", "chair"]
    assert {obj.label: obj.number for obj in run.standing()} == numbers


def test_crops_are_kept_only_of_clearly_better_looks() -> None:
    run = s.Run()
    run.see(CHAIR_WORLD, (-0.5, 0, 1.2))
    for _ in range(5):
        run.see(CHAIR_WORLD, (-0.5, 0.01, 1.2))
    run.see(CHAIR_WORLD, (0.5, 0, 1.2))
    crops = [observation.crop_jpeg is not None for observation in run.take().observations]
    assert crops == [True, False, False, False, False, False, True]


def test_every_observation_says_what_spoke_for_and_against_it() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    first, *later = run.take().observations
    assert first.evidence_for == first.evidence_against == 0
    assert min(observation.evidence_for for observation in later) > 100
    assert all(observation.evidence_against < 0.1 * observation.evidence_for for observation in later)
    assert first.hypotheses[0].label == "chair"
    np.testing.assert_allclose(first.centroid_map, s.CHAIR.center, atol=0.3)


def test_visits_count_support_views_and_contradictions() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 5)
    run.walk(s.ROOM, 2)
    (visit,) = run.take().visits
    assert (visit.supported, visit.contradicted) == (5, 2)
    assert visit.in_view >= 6
    assert (visit.first_support_ns, visit.last_support_ns) == (s.ns(0), s.ns(4 / 3))


THINGS = (s.CHAIR.at(1.6, 0.7), s.BOX.at(1.6, -0.7), s.CUP.at(1.3, 0.0, 0.08))
SCORES = {"chair": 0.8, "box": 0.5, "cup": 0.4}


def standing_at(**lifecycle: float) -> dict[str, float]:
    """What stands in the map after a short walk, with its confidence; the detector is not equally sure of all of it."""

    def unequally_sure(scene: s.Scene, at_s: float) -> Detections:
        seen = [index for index, thing in enumerate(scene.things) if thing.label and scene.mask(index).sum() > 30]
        said = [[(scene.things[index].label, SCORES[scene.things[index].label])] for index in seen]
        return s.detections_of([scene.mask(index) for index in seen], said, at_s)

    parameters = MappingParameters.from_overrides({"lifecycle": lifecycle})
    run = s.Run(engine=MappingEngine(parameters=parameters), detector=unequally_sure)
    run.walk((*s.ROOM, *THINGS), 5)
    shown = {state.object_number: state.confidence for state in run.take().states}
    return {obj.label: shown[obj.number] for obj in run.standing()}


def test_a_higher_threshold_keeps_a_part_of_the_things_and_all_are_at_least_that_sure() -> None:
    thresholds = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9)
    maps = {threshold: standing_at(min_confidence=threshold) for threshold in thresholds}
    for lower, higher in itertools.pairwise(thresholds):
        assert maps[higher].keys() <= maps[lower].keys()
    assert all(sure >= threshold for threshold, things in maps.items() for sure in things.values())
    assert len({len(things) for things in maps.values()}) > 2


def test_nothing_that_is_sure_enough_to_enter_is_demoted_for_not_being_sure() -> None:
    assert standing_at(min_confidence=0.2, demote_confidence=0.99) == standing_at(min_confidence=0.2)


def test_the_line_to_probabilities_is_a_parameter_too() -> None:
    parameters = MappingParameters.from_overrides({"existence": {"slope": 1.0, "intercept": 0.0}})
    run = s.Run(engine=MappingEngine(parameters=parameters))
    run.walk(CHAIR_WORLD)
    delta = run.take()
    (chair,), (state,) = delta.instances, delta.states
    assert state.confidence == probability_of(chair.existence_log_odds, parameters.existence)


def test_when_a_traversal_ends_one_threshold_decides() -> None:
    run = s.Run()
    run.walk(CHAIR_WORLD, 6)
    chair = run.map[1]
    chair.existence.log_odds = 0.5  # a confidence between that of demotion and that of the map
    run.engine.map_merge(s.ns(run.at_s), set())
    assert run.standing("chair")
    run.engine.end_traversal()
    assert chair.demoted
