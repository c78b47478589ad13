"""Two things side by side: what images have said of their being two holds, also on the next day."""

from __future__ import annotations

import numpy as np

from supermap_cli.mapping.changes import instance_record
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.types.detections import Detections
from support import scenes as s

BINS = (
    s.Thing("trash can", (1.6, -0.24, 0.3), (0.36, 0.36, 0.6), (90, 90, 95)),
    s.Thing("trash can", (1.6, 0.24, 0.32), (0.4, 0.4, 0.64), (200, 200, 205)),
)
WORLD = (*s.ROOM, *BINS)


def as_one(scene: s.Scene, at_s: float) -> Detections:
    """One mask over both bins."""
    return s.detections_of([scene.mask(2) | scene.mask(3)], [[("trash can", 0.8)]], at_s)


def next_day(run: s.Run) -> s.Run:
    records = [instance_record(obj) for obj in run.map.values()]
    objects = restore_objects(records, run.engine.objects.next_number)
    engine = MappingEngine(objects=objects, free_space=run.engine.free_space)
    return s.Run(engine=engine, traversal=2, at_s=run.at_s + 86_400)


def test_many_images_that_tell_two_apart_outweigh_a_few_masks_over_both_on_the_next_day() -> None:
    monday = s.Run()
    monday.walk(WORLD, 12)
    assert sorted(monday.map) == [1, 2]
    tuesday = next_day(monday)
    tuesday.detector = as_one
    tuesday.walk(WORLD, 2)
    tuesday.detector = s.detect
    tuesday.walk(WORLD, 10)
    assert [obj.number for obj in tuesday.standing()] == [1, 2]
    for obj, true in zip(tuesday.standing(), BINS, strict=True):
        assert s.distance_to(obj, true) < 0.15
        assert np.max(obj.shape.box.size[:2]) < 0.5


def test_what_images_have_told_apart_is_kept_with_the_objects() -> None:
    run = s.Run()
    run.walk(WORLD, 6)
    first, second = (obj.seen_apart for obj in next_day(run).map.values())
    assert first[2] == second[1] >= 3
