"""Every relation is defined once: what the scene graph stores and what a question computes agree, whatever the pair."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.query.relations import STORED_FORMS, holds
from supermap_cli.relations.map_relations import CONFIG_ENTRY, described, relations_of_configs
from supermap_cli.relations.registry import RELATIONS, NoWalls, RelationContext, possible
from supermap_cli.types.relations import GraphNode, Pair, SpatialRelation
from support.graph_nodes import node, surface, table

LABELS = ("table", "chair", "cup", "cabinet", "wall", "box", "shelf", "")
sides = st.floats(0.05, 2.0)


@st.composite
def things(draw: st.DrawFn, number: int) -> GraphNode:
    """A closed box of any label, or one of which only the box is known."""
    x, y = draw(st.floats(-1.5, 1.5)), draw(st.floats(-1.5, 1.5))
    size = np.array([draw(sides), draw(sides), draw(sides)])
    foot = draw(st.sampled_from([0.0, 0.0, 0.4, 0.75, 1.2]))
    box = Box3D(np.array([x, y, foot + size[2] / 2]), size, draw(st.floats(-1.5, 1.5)))
    points = surface(box, 0.15) if draw(st.booleans()) else np.zeros((0, 3))
    return GraphNode(number, draw(st.sampled_from(LABELS)), box, points)


def stored_edges(first: GraphNode, second: GraphNode) -> set[tuple[int, str, int]]:
    graph = SceneGraph()
    graph.update({1: first, 2: second}, [1, 2], 10)
    return set(graph.held)


def answered_by_edges(name: str, first: GraphNode, second: GraphNode) -> bool:
    """Whether the stored edges answer a question for the first thing, as `query.relation_matching` reads them."""
    edges = stored_edges(first, second)
    return any(
        ((second.number, form.relation, first.number) if form.turned else (first.number, form.relation, second.number))
        in edges
        and (not form.checked or RELATIONS[name].holds(Pair(first, second), 1.0) > 0)
        for form in STORED_FORMS[name]
    )


@settings(max_examples=300, deadline=None)
@given(things(1), things(2))
def test_what_the_graph_stores_is_what_a_question_computes(first: GraphNode, second: GraphNode) -> None:
    for relation in RELATIONS:
        if STORED_FORMS[relation.name]:
            assert answered_by_edges(relation.name, first, second) == holds(relation.name, first, second), relation.name


@settings(max_examples=300, deadline=None)
@given(things(1), things(2))
def test_inverse_and_symmetric_relations_hold_the_other_way_round(first: GraphNode, second: GraphNode) -> None:
    for relation in RELATIONS:
        inverse = RELATIONS.inverse(relation.name)
        if inverse is not None:
            there, back = RELATIONS.holds(relation.name, first, second), RELATIONS.holds(inverse, second, first)
            assert there == pytest.approx(back, abs=1e-9), relation.name


@settings(max_examples=300, deadline=None)
@given(things(1), things(2))
def test_what_holds_is_within_reach_and_more_slack_never_makes_it_fail(first: GraphNode, second: GraphNode) -> None:
    for relation in RELATIONS:
        strict = RELATIONS.holds(relation.name, first, second)
        assert 0 <= strict <= 1
        if strict > 0:
            assert RELATIONS.holds(relation.name, first, second, RelationContext(slack=1.3)) > 0
            assert possible(RELATIONS.reach(relation.name), first.box, second.box, 1.0, 0.06), relation.name


@settings(max_examples=200, deadline=None)
@given(things(1), things(2))
def test_kinds_of_nearness_imply_it_and_what_is_far_is_not_near(first: GraphNode, second: GraphNode) -> None:
    for name in ("beside", "on", "inside", "attached to", "at", "around", "against"):
        if holds(name, first, second):
            assert holds("near", first, second), name
    assert not (holds("near", first, second) and holds("far from", first, second))


@settings(max_examples=100, deadline=None)
@given(things(1), things(2))
def test_a_wall_between_ends_the_nearness_of_what_does_not_overlap(first: GraphNode, second: GraphNode) -> None:
    assume(Pair(first, second).overlap_m2 == 0)
    walled = RelationContext(clear_between=lambda _first, _second: False)
    assert not any(holds(name, first, second, walled) for name in ("beside", "at", "around", "against"))


def test_chairs_pushed_in_at_a_table_are_at_it_and_a_cup_on_it_is_not() -> None:
    pushed_in, cup = node(1, "chair", (0, 0.5, 0), (0.45, 0.45, 0.9)), node(1, "cup", (0.3, 0.1, 0.75), (0.1, 0.1, 0.1))
    assert holds("at", pushed_in, table())
    assert holds("around", pushed_in, table())
    assert not holds("at", cup, table())
    assert not holds("around", cup, table())


@pytest.mark.parametrize(
    ("label", "contains"),
    [("bin", True), ("bookshelf", True), ("kitchen cabinet", True), ("coffee table", False), ("Office Chair", False)],
)
def test_whether_a_thing_contains_what_is_within_its_box_is_told_by_its_kind(label: str, contains: bool) -> None:
    inner = node(1, "cup", (0, 0, 0.1), (0.1, 0.1, 0.1))
    assert holds("inside", inner, node(2, label, (0, 0, 0), (0.5, 0.5, 0.5))) == contains


def test_phrases_are_unique_and_the_longest_come_first() -> None:
    phrases = RELATIONS.phrases("en")
    assert len({phrase for phrase, _ in phrases}) == len(phrases)
    lengths = [len(phrase.split()) for phrase, _ in phrases]
    assert lengths == sorted(lengths, reverse=True)


def test_a_plugins_relation_is_stored_and_can_be_asked_by_its_words() -> None:
    taller = SpatialRelation(
        "taller than",
        lambda pair, slack: float(pair.subject.box.size[2] * slack > pair.other.box.size[2]),
        {"en": ("taller than", "higher than")},
        inverse="shorter than",
    )
    registry = RELATIONS.with_further([taller])
    assert taller in registry.stored
    assert ("higher than", "taller than") in registry.phrases()
    shelf, cup = node(1, "shelf", (0, 0, 0), (0.4, 0.4, 2.0)), node(2, "cup", (1, 0, 0), (0.1, 0.1, 0.1))
    assert registry.holds("taller than", shelf, cup) == 1.0
    assert RELATIONS.with_further([SpatialRelation("on", taller.holds)])["on"] is RELATIONS["on"]


def test_a_map_keeps_the_words_of_a_plugins_relation_and_the_parameters_it_was_built_with() -> None:
    alike = SpatialRelation("alike", lambda pair, slack: 1.0, {"de": ("wie",)}, symmetric=True)
    config = {
        CONFIG_ENTRY: described([alike]),
        "parameters": {"predicates": {"near_gap_m": 2.0}, "scene_graph": {"held_slack": 1.5}},
    }
    registry, slack = relations_of_configs([config])
    assert registry["alike"].phrases("de") == ("wie",)
    assert registry["alike"].phrases("en") == ("alike",)
    assert registry.inverse("alike") == "alike"
    assert (registry.parameters.near_gap_m, slack) == (2.0, 1.5)
    assert relations_of_configs(["no JSON", {CONFIG_ENTRY: 3}, "[]"])[0].relations == RELATIONS.relations


def test_nothing_is_known_of_walls_where_none_were_seen() -> None:
    box = table().box
    assert NoWalls().clear_between(box, box)
