"""An object in view that was not detected: whether that counts, and how much."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.mapping.belief import Viewpoint
from supermap_cli.mapping.missed_detections import MissedObject, is_gone_by_misses
from supermap_cli.mapping.objects import VisitCount
from supermap_cli.types.detections import Detections, no_detections
from support import scenes as s
from support.map_objects import map_object

CHAIR_WORLD = (*s.ROOM, s.CHAIR)
SCREEN = s.Thing("", (0.9, 0, 0.8), (0.05, 1.6, 1.8))
EYE = s.looking((0, 0.3, 1.2), (1.6, 0, 0.4))


@pytest.fixture
def run() -> s.Run:
    run = s.Run()
    run.walk(CHAIR_WORLD)
    return run


def missed(run: s.Run, *things: s.Thing, found: Detections | None) -> tuple[MissedObject, ...]:
    view = s.view_of(run.engine, s.render((*s.ROOM, *things), EYE, run.at_s).keyframe)
    return run.engine.check_semantic_consistency(view, set(), found)


def test_an_object_in_its_place_that_was_not_detected_is_missed(run: s.Run) -> None:
    in_view = run.map[1].visit.in_view
    (chair,) = missed(run, s.CHAIR, found=no_detections(s.ns(run.at_s)))
    assert (chair.obj.number, chair.detectability.observable) == (1, True)
    assert chair.expected_recall is not None
    assert 0.0 < chair.expected_recall < 1.0
    assert run.map[1].visit.in_view == in_view + 1


def test_where_no_detector_looked_only_geometry_speaks(run: s.Run) -> None:
    trials = dict(run.engine.recall.trials)
    (chair,) = missed(run, s.CHAIR, found=None)
    assert chair.expected_recall is None
    assert run.engine.recall.trials == trials


def test_what_is_hidden_could_not_be_found(run: s.Run) -> None:
    in_view = run.map[1].visit.in_view
    (chair,) = missed(run, s.CHAIR, SCREEN, found=no_detections(s.ns(run.at_s)))
    assert (chair.detectability.observable, chair.expected_recall) == (False, None)
    assert run.map[1].visit.in_view == in_view


def test_a_miss_at_an_empty_place_says_nothing_on_its_own(run: s.Run) -> None:
    (chair,) = missed(run, found=no_detections(s.ns(run.at_s)))
    assert (chair.detectability.observable, chair.expected_recall) == (True, None)


def test_a_person_who_has_walked_on_is_not_missed() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.PERSON))
    assert run.standing("person")
    assert missed(run, found=no_detections(s.ns(run.at_s))) == ()


@pytest.mark.parametrize(("second", "doubted"), [("weak", False), ("strong", True)])
def test_what_another_detector_never_finds_stays_in_the_map(second: str, doubted: bool) -> None:
    """A chair that one detector found, and that stands there for all the depth says, is missed 60 times on another day
    by one of which nothing is known yet.
    """
    run = s.Run()
    run.engine.recall.detector = "strong"
    run.walk(CHAIR_WORLD, looks=9)
    (chair,) = run.standing("chair")
    chair.existence.log_odds = 3.0
    recall = run.engine.recall
    recall.detector, recall.hits, recall.trials = second, {}, {}
    run.detector = lambda scene, at_s: no_detections(s.ns(at_s))
    for _ in range(6):
        run.walk(CHAIR_WORLD, looks=10)
    assert (chair.visit.contradicted, chair.demoted) == (0, doubted)


def test_what_is_sure_teaches_how_often_the_detector_misses(run: s.Run) -> None:
    run.map[1].existence.log_odds = 8.0
    before = run.engine.recall.expected("chair", 0.05, truncated=False)
    for _ in range(5):
        missed(run, s.CHAIR, found=no_detections(s.ns(run.at_s)))
    assert run.engine.recall.expected("chair", 0.05, truncated=False) < before


@pytest.mark.parametrize(("found_in", "gone"), [(9, True), (3, False)])
def test_what_no_ray_reaches_and_this_visit_never_found_is_gone_if_most_earlier_views_found_it(
    found_in: int, gone: bool
) -> None:
    bin_ = map_object(1, s.Thing("bin", (2.0, 0.0, 0.2), (0.3, 0.3, 0.4)))
    bin_.visit = VisitCount(earlier_ns=s.ns(5))
    for k in range(10):
        view = Viewpoint(s.ns(k), np.array([np.cos(k), np.sin(k), 1.0]), np.array([2.0, 0.0, 0.2]))
        if k < found_in:
            bin_.existence.add_detection(view, 1.0)
        else:
            bin_.existence.add_miss(view, -1.0)
    said = []
    for k in range(100, 110):
        view = Viewpoint(s.ns(k), np.array([2.0 + np.cos(k), np.sin(k), 1.0]), np.array([2.0, 0.0, 0.2]))
        bin_.existence.add_miss(view, -2.0)
        said.append(is_gone_by_misses(bin_, view, -2.0))
    assert said[-1] == gone
    assert not said[0]
