"""Relations over time: they begin, hold, and end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.graph.predicates import PREDICATES
from supermap_cli.graph.scene_graph import SceneGraph, neighbours
from supermap_cli.relations.registry import RELATIONS
from supermap_cli.types.memory import SpatialEdge
from supermap_cli.types.relations import GraphNode, Pair, SpatialPredicate
from support.graph_nodes import node, table


def cup(x: float = 0.3, y: float = 0.1, z: float = 0.75, number: int = 1) -> GraphNode:
    return node(number, "cup", (x, y, z), (0.08, 0.08, 0.1))


def scene(*nodes: GraphNode) -> dict[int, GraphNode]:
    return {node.number: node for node in nodes}


def show(graph: SceneGraph, stamp_ns: int, *nodes: GraphNode) -> dict[tuple[int, str, int], SpatialEdge]:
    """Update with all nodes changed; what was altered, by key."""
    altered = graph.update(scene(*nodes), [node.number for node in nodes], stamp_ns)
    return {(edge.subject, edge.relation, edge.object): edge for edge in altered}


def test_an_empty_scene_and_a_thing_by_itself_have_no_relations() -> None:
    graph = SceneGraph()
    assert graph.update({}, [], 1) == ()
    assert show(graph, 2, cup()) == {}


def test_a_relation_begins_when_it_is_first_seen_and_is_told_once() -> None:
    graph = SceneGraph()
    begun = show(graph, 10, cup(), table())[1, "on", 2]
    assert (begun.since_ns, begun.until_ns) == (10, None)
    assert 0.5 < begun.confidence <= 1
    assert show(graph, 20, cup(), table()) == {}


def test_it_ends_when_it_holds_no_more() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    altered = show(graph, 20, cup(x=3.0, z=0.0), table())
    ended = altered[1, "on", 2]
    assert (ended.since_ns, ended.until_ns) == (10, 20)
    assert graph.held == {}


def test_it_begins_anew_when_it_holds_again() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    show(graph, 20, cup(x=3.0, z=0.0), table())
    again = show(graph, 30, cup(), table())[1, "on", 2]
    assert (again.since_ns, again.until_ns) == (30, None)


def test_all_relations_of_a_thing_that_leaves_end() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), cup(x=0.5, number=3), table())
    ended = graph.update(scene(cup(x=0.5, number=3), table()), [], 20)
    assert {(edge.subject, edge.relation, edge.object) for edge in ended} >= {
        (1, "on", 2),
        (1, "near", 3),
        (3, "near", 1),
    }
    assert all(edge.until_ns == 20 for edge in ended)
    assert all(1 not in (key[0], key[2]) for key in graph.held)
    assert (3, "on", 2) in graph.held


def test_a_relation_that_ends_in_the_moment_it_began_still_lasts() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    (ended,) = (edge for edge in graph.update(scene(table()), [], 10) if edge.relation == "on")
    assert ended.until_ns == 11


def test_relations_end_when_a_thing_left_though_that_is_known_only_later() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    (ended,) = (edge for edge in graph.update(scene(table()), [], 40, {1: 20}) if edge.relation == "on")
    assert (ended.since_ns, ended.until_ns) == (10, 20)


def test_a_relation_found_after_a_thing_had_left_never_held() -> None:
    graph = SceneGraph()
    show(graph, 30, cup(), table())
    (ended,) = (edge for edge in graph.update(scene(table()), [], 40, {1: 20}) if edge.relation == "on")
    assert (ended.since_ns, ended.until_ns) == (30, 30)


def test_relations_of_the_old_place_end_when_a_thing_moved_and_those_of_the_new_one_go_on() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    away = graph.update(scene(cup(x=3.0, z=0.0), table()), [1], 40, {1: 20})
    assert [(edge.relation, edge.until_ns) for edge in away if edge.relation == "on"] == [("on", 20)]
    back = show(graph, 60, cup(), table())[1, "on", 2]
    gone = graph.update(scene(cup(x=3.0, z=0.0), table()), [1], 70, {1: 20})
    assert back.since_ns == 60
    assert [edge.until_ns for edge in gone if edge.relation == "on"] == [70]


def far_away(number: int = 1) -> GraphNode:
    return cup(x=25.0, z=0.0, number=number)


@pytest.mark.parametrize("changed", [[1], []], ids=["noticed", "unnoticed"])
def test_a_thing_that_stands_tens_of_metres_away_has_no_relations_of_its_old_place(changed: list[int]) -> None:
    """Recognised elsewhere within one keyframe, or its shape changed by whoever did not say so."""
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    ended = graph.update(scene(far_away(), table()), changed, 40)
    assert {edge.relation for edge in ended} >= {"on", "near"}
    assert all(edge.until_ns == 40 for edge in ended)
    assert graph.held == {}


def test_a_relation_of_things_that_moved_together_ends_and_begins_anew() -> None:
    graph = SceneGraph()
    show(graph, 10, cup(), table())
    moved = (cup(x=9.3), table(foot=(9, 0, 0)))
    altered = graph.update(scene(*moved), [1, 2], 40, {1: 20, 2: 30})
    on = [(edge.since_ns, edge.until_ns) for edge in altered if edge.relation == "on"]
    assert on == [(10, 20), (40, None)]


def test_a_relation_that_the_memory_kept_ends_when_its_end_is_found_elsewhere() -> None:
    graph = SceneGraph()
    kept = scene(cup(), table())
    graph.resume([SpatialEdge(1, "on", 2, 5, None, 0.9)], kept)
    assert graph.update(kept, [], 10) == ()
    (ended,) = graph.update(scene(far_away(), table()), [], 20)
    assert (ended.since_ns, ended.until_ns) == (5, 20)


moves = st.lists(
    st.tuples(st.sampled_from([1, 3, 4]), st.sampled_from([0.3, 0.6, 2.0, 12.0, 40.0]), st.booleans(), st.booleans()),
    max_size=12,
)


@settings(max_examples=100, deadline=None)
@given(moves)
def test_however_things_move_no_relation_is_held_across_metres(steps: list[tuple[int, float, bool, bool]]) -> None:
    things = {1: cup(), 2: table(), 3: cup(x=0.5, number=3), 4: node(4, "chair", (0, 0.8, 0), (0.45, 0.45, 0.9))}
    graph = SceneGraph()
    graph.update(things, list(things), 10)
    for at, (number, x, noticed, left) in enumerate(steps, start=2):
        things[number] = cup(x=x, number=number)
        graph.update(things, [number] if noticed else [], 10 * at, {number: 10 * at - 5} if left else None)
        for edge in graph.held.values():
            pair = Pair(things[edge.subject], things[edge.object])
            assert RELATIONS[edge.relation].holds(pair, graph.parameters.held_slack) > 0


class WallAtOne:
    """A wall across x = 1, once `views` have shown it."""

    def __init__(self, views: int) -> None:
        self.views, self.asked = views, 0

    def clear_between(self, first: Box3D, second: Box3D) -> bool:
        self.asked += 1
        return self.views < 10 or (first.center[0] < 1) == (second.center[0] < 1)


def test_nothing_is_near_across_a_wall_and_it_is_not_asked_again_and_again() -> None:
    walls = WallAtOne(10)
    graph = SceneGraph(walls=walls)
    things = scene(cup(x=0.9), cup(x=1.1, number=3), cup(x=1.4, number=4))
    graph.update(things, [1, 3, 4], 10)
    assert {tuple(sorted((key[0], key[2]))) for key in graph.held} == {(3, 4)}
    asked = walls.asked
    graph.update(things, [1, 3, 4], 20)
    assert walls.asked == asked
    graph.update(scene(cup(x=1.05), cup(x=1.1, number=3)), [1], 30)
    assert (1, "near", 3) in graph.held


def test_what_turns_out_to_have_a_wall_between_never_held() -> None:
    walls = WallAtOne(1)
    graph = SceneGraph(walls=walls)
    things = scene(cup(x=0.9), cup(x=1.1, number=3))
    graph.update(things, [1, 3], 10)
    assert (1, "near", 3) in graph.held
    walls.views = 10
    never = graph.end_across_walls(things)
    assert {(edge.since_ns, edge.until_ns) for edge in never} == {(10, 10)}
    assert graph.held == {}


def test_a_cup_on_a_table_is_near_it_whatever_walls_there_are() -> None:
    walls = WallAtOne(10)
    graph = SceneGraph(walls=walls)
    graph.update(scene(cup(x=1.2), table(foot=(0.6, 0, 0))), [1, 2], 10)
    assert (1, "on", 2) in graph.held
    assert (1, "near", 2) in graph.held


def test_only_relations_of_changed_things_are_looked_at() -> None:
    graph = SceneGraph()
    nodes = scene(cup(), cup(x=0.5, number=3), table())
    altered = graph.update(nodes, [1], 10)
    assert all(1 in (edge.subject, edge.object) for edge in altered)
    assert (3, "on", 2) not in graph.held
    assert graph.update(nodes, [], 20) == ()


def test_a_measure_that_wavers_at_the_border_does_not_make_a_relation_flicker() -> None:
    """The border of `on` lies between the two heights."""
    graph = SceneGraph()
    low, high = cup(z=0.80), cup(z=0.85)
    on = next(predicate for predicate in PREDICATES if predicate.name == "on")
    assert on.holds(Pair(low, table()), 1.0) > 0 == on.holds(Pair(high, table()), 1.0)
    altered = [show(graph, 10 * i, (low, high)[i % 2], table()).get((1, "on", 2)) for i in range(8)]
    assert altered[0] is not None
    assert all(edge is None or edge.until_ns is None for edge in altered)
    assert graph.held[1, "on", 2].since_ns == 0
    ended = show(graph, 100, cup(z=0.95), table())[1, "on", 2]
    assert ended.until_ns == 100
    assert (1, "on", 2) not in show(graph, 110, high, table())


def test_a_clearly_changed_confidence_is_told_under_the_same_beginning() -> None:
    graph = SceneGraph()
    chair = [node(1, "chair", (0, y, 0), (0.45, 0.45, 0.9)) for y in (0.7, 0.71, 1.0)]
    first = show(graph, 10, chair[0], table())[1, "beside", 2]
    assert (1, "beside", 2) not in show(graph, 20, chair[1], table())
    later = show(graph, 30, chair[2], table())[1, "beside", 2]
    assert later.since_ns == first.since_ns
    assert later.confidence < first.confidence - 0.1
    assert later.until_ns is None


def test_it_goes_on_from_the_relations_the_memory_kept() -> None:
    graph = SceneGraph()
    kept = SpatialEdge(1, "on", 2, 5, None, 0.9)
    graph.resume([kept, SpatialEdge(1, "near", 2, 1, 3, 0.9)])
    assert list(graph.held) == [(1, "on", 2)]
    ended = show(graph, 10, cup(x=3.0, z=0.0), table())[1, "on", 2]
    assert (ended.since_ns, ended.until_ns) == (5, 10)


def test_further_predicates_are_asked_like_the_others() -> None:
    same_label = SpatialPredicate("alike", lambda pair, slack: float(pair.subject.label == pair.other.label))
    graph = SceneGraph((*PREDICATES, same_label))
    altered = show(graph, 10, cup(), cup(x=0.5, number=3), table())
    assert {(1, "alike", 3), (3, "alike", 1)} <= set(altered)
    assert (1, "alike", 2) not in altered


def test_the_order_in_which_things_are_given_does_not_matter() -> None:
    things = [cup(), cup(x=0.5, number=3), table(), node(4, "chair", (0, 0.8, 0), (0.45, 0.45, 0.9))]
    one, other = SceneGraph(), SceneGraph()
    numbers = [thing.number for thing in things]
    assert one.update(scene(*things), numbers, 1) == other.update(scene(*things[::-1]), numbers[::-1], 1)


@pytest.mark.parametrize(("gap_m", "pairs"), [(1.9, [(1, 3)]), (2.3, [])])
def test_only_what_is_within_reach_is_compared(gap_m: float, pairs: list[tuple[int, int]]) -> None:
    reach = float(np.linalg.norm([0.08, 0.08, 0.1]))
    assert neighbours(scene(cup(), cup(x=0.3 + gap_m + reach, number=3)), [1, 3]) == pairs


def test_each_pair_is_compared_once() -> None:
    nodes = scene(cup(), cup(x=0.5, number=3), table())
    assert neighbours(nodes, [3, 2, 1]) == [(1, 2), (1, 3), (2, 3)]
    assert neighbours(nodes, [7]) == []
