"""Spatial edges of two maps."""

from __future__ import annotations

from supermap_cli.map_merge.relations import merge_edges, reevaluate_edges
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.types.memory import SpatialEdge
from support import memories as m
from support import scenes as s
from support.map_objects import map_object


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
    for obj in (map_object(1, s.TABLE), map_object(2, s.CUP)):
        objects.add(obj)
    ended = SpatialEdge(2, "on", 1, s.ns(1), s.ns(3), 0.9)
    changed: dict[tuple[int, str, int, int], SpatialEdge] = {}
    reevaluate_edges(changed, [ended], objects, {1, 2}, s.ns(5))
    assert (2, "on", 1, s.ns(3)) in changed
    assert [edge.since_ns for edge in changed.values() if edge.relation == "on"] == [s.ns(3)]
