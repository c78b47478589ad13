"""One map's stored depth images compared with another's objects."""

from __future__ import annotations

import numpy as np

from supermap_cli.map_merge.depth_consistency import stored_view
from support import scenes as s
from support.map_objects import TABLE, compare, map_object, record


def test_a_place_seen_empty_says_that_its_thing_has_gone_since_the_first_look_that_showed_it() -> None:
    known = map_object(1, TABLE)
    consistency = compare(known, ())
    assert not known.present
    assert known.gone_ns == s.ns(100)
    assert consistency.views[1, 1].contradicted >= 3


def test_a_thing_that_stands_is_in_view_and_is_believed_less_if_no_detector_finds_it() -> None:
    known = map_object(1, TABLE)
    consistency = compare(known, (TABLE,))
    assert known.present
    assert consistency.views[1, 1].in_view >= 6
    assert consistency.views[1, 1].contradicted == 0
    assert known.existence.log_odds < 4.0


def test_a_thing_behind_another_is_neither_there_nor_gone() -> None:
    known = map_object(1, TABLE)
    screen = s.Thing("box", (1.2, 0, 1.0), (0.1, 4.0, 2.0))
    consistency = compare(known, (screen,))
    assert known.present
    assert known.existence.log_odds == 4.0
    assert (1, 1) not in consistency.views


def test_the_stored_depth_is_never_bolder_than_the_image_was() -> None:
    """Around every pixel the nearest return counts, so that no ray went through what none went through."""
    stored = record((TABLE,), (0.0, 0.3, 1.6), 0.0)
    view = stored_view(stored)
    scene = s.render((*s.ROOM, TABLE), s.looking((0.0, 0.3, 1.6), (2.0, 0, 0.4)), 0.0)
    seen = (view.nearest_m > 0) & np.isfinite(view.nearest_m) & (scene.keyframe.depth_m > 0)
    assert seen.mean() > 0.5
    assert (view.nearest_m[seen] <= scene.keyframe.depth_m[seen] + 0.002).mean() > 0.97
