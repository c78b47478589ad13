"""Which objects of two maps are one, by their places."""

from __future__ import annotations

from dataclasses import replace

from supermap_cli.map_merge.matching import match_in_place, match_parts
from support import scenes as s
from support.map_objects import TABLE, map_object


def test_each_cloud_is_given_to_the_thing_it_lies_on_best() -> None:
    left, right = (map_object(k, s.CHAIR.at(1.6, y)) for k, y in ((1, -0.3), (2, 0.3)))
    others = [map_object(-1, s.CHAIR.at(1.62, 0.28)), map_object(-2, s.CHAIR.at(1.6, -0.25))]
    pairs = {known.number: other.number for known, other in match_in_place([left, right], others)}
    assert pairs == {1: -2, 2: -1}


def test_another_thing_in_that_place_is_not_it() -> None:
    assert (
        match_in_place(
            [map_object(1, s.CHAIR)], [map_object(-1, replace(s.CHAIR, label="plant", size=(0.15, 0.15, 0.2)))]
        )
        == []
    )
    assert match_in_place([map_object(1, s.CHAIR)], [map_object(-1, s.CHAIR.at(2.8, 1.5))]) == []


def test_what_had_gone_is_only_met_by_what_nothing_standing_explains() -> None:
    gone, stands = map_object(1, s.CHAIR), map_object(2, s.CHAIR.at(1.6, 0.05))
    gone.mark_absent(None)
    pairs = match_in_place([gone, stands], [map_object(-1, s.CHAIR)])
    assert [known.number for known, _ in pairs] == [2]
    assert [known.number for known, _ in match_in_place([gone], [map_object(-1, s.CHAIR)])] == [1]


def test_an_end_of_a_thing_is_a_part_of_it() -> None:
    whole, ends = map_object(1, TABLE), [map_object(-1, TABLE, high=0.3), map_object(-2, TABLE, low=0.75)]
    assert [known.number for known, _ in match_parts([whole], ends)] == [1, 1]
    assert match_parts([whole], [map_object(-3, TABLE.at(2.0, 1.7))]) == []
