"""Every spatial relation, in the smallest scene that shows it."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.graph.predicates import PREDICATES
from supermap_cli.types.relations import GraphNode, Pair
from support.graph_nodes import Point, node, table

CUP: Point = (0.08, 0.08, 0.1)
CHAIR: Point = (0.45, 0.45, 0.9)
NAMES = [predicate.name for predicate in PREDICATES]


def relations(subject: GraphNode, other: GraphNode) -> set[str]:
    """The relations that begin to hold."""
    return {predicate.name for predicate in PREDICATES if predicate.holds(Pair(subject, other), 1.0) > 0}


def confidence(name: str, subject: GraphNode, other: GraphNode, slack: float = 1.0) -> float:
    (predicate,) = (candidate for candidate in PREDICATES if candidate.name == name)
    return predicate.holds(Pair(subject, other), slack)


def holds(name: str, subject: GraphNode, other: GraphNode) -> bool:
    return confidence(name, subject, other) > 0


def test_names_are_unique() -> None:
    assert len(set(NAMES)) == len(NAMES)


def test_a_cup_stands_on_a_table_and_not_the_other_way_round() -> None:
    cup = node(1, "cup", (0.3, 0.1, 0.75), CUP)
    assert relations(cup, table()) >= {"on", "near"}
    assert relations(cup, table()).isdisjoint({"under", "above", "inside", "beside"})
    assert "on" not in relations(table(), cup)
    assert "under" not in relations(table(), cup)


@pytest.mark.parametrize("error_m", [-0.05, 0.05])
def test_heights_that_are_measured_a_little_wrong_do_not_matter_to_what_stands_on_what(error_m: float) -> None:
    assert holds("on", node(1, "cup", (0.3, 0.1, 0.75 + error_m), CUP), table())


@pytest.mark.parametrize(
    ("foot", "why"),
    [
        ((0.3, 0.1, 1.1), "it hangs over it"),
        ((0.3, 0.1, 0.0), "it stands below it"),
        ((0.9, 0.1, 0.75), "it is beside it"),
    ],
)
def test_a_cup_elsewhere_is_not_on_the_table(foot: Point, why: str) -> None:
    assert not holds("on", node(1, "cup", foot, CUP), table()), why


def test_what_stands_at_the_edge_and_reaches_over_it_is_on_the_table() -> None:
    laptop: Point = (0.3, 0.3, 0.2)
    assert holds("on", node(1, "laptop", (0.7, 0, 0.75), laptop), table())
    assert not holds("on", node(1, "laptop", (0.85, 0, 0.75), laptop), table())


def test_what_lies_on_a_seat_is_on_the_chair_though_its_back_is_higher() -> None:
    seat, back = node(2, "chair", (0, 0, 0), (0.45, 0.45, 0.45)), node(2, "chair", (-0.2, 0, 0.45), (0.05, 0.45, 0.45))
    chair = GraphNode(2, "chair", node(2, "chair", (0, 0, 0), CHAIR).box, np.concatenate([seat.points, back.points]))
    assert holds("on", node(1, "book", (0.08, 0, 0.45), (0.2, 0.25, 0.05)), chair)


def test_what_stands_where_a_desk_was_not_seen_is_on_it_by_the_top_of_its_box() -> None:
    whole = table()
    away = np.linalg.norm(whole.points[:, :2] - [0.3, 0.1], axis=1) > 0.25
    partly = GraphNode(2, "desk", whole.box, whole.points[away])
    panel = node(2, "desk", (0.3, 0.1, 0.0), (0.02, 0.3, 0.5)).points
    for points in (partly.points, np.concatenate([partly.points, panel])):
        desk = GraphNode(2, "desk", whole.box, points)
        assert holds("on", node(1, "mug", (0.3, 0.1, 0.77), CUP), desk)
        assert not holds("on", node(1, "mug", (0.3, 0.1, 0.95), CUP), desk)


def test_what_is_as_high_as_a_chairs_back_is_not_on_the_chair() -> None:
    seat, back = node(2, "chair", (0, 0, 0), (0.45, 0.45, 0.45)), node(2, "chair", (-0.2, 0, 0.45), (0.05, 0.45, 0.45))
    chair = GraphNode(2, "chair", node(2, "chair", (0, 0, 0), CHAIR).box, np.concatenate([seat.points, back.points]))
    assert not holds("on", node(1, "book", (0.08, 0, 0.9), (0.2, 0.25, 0.05)), chair)


def test_a_stack_is_a_chain() -> None:
    lower, upper = node(1, "book", (0, 0, 0.75), (0.3, 0.2, 0.05)), node(3, "book", (0, 0, 0.8), (0.25, 0.2, 0.05))
    assert holds("on", upper, lower)
    assert holds("on", lower, table())
    assert not holds("on", lower, upper)


def test_a_bag_stands_under_a_table() -> None:
    bag = node(1, "handbag", (0.2, 0, 0), (0.3, 0.2, 0.35))
    assert holds("under", bag, table())
    assert not holds("under", table(), bag)
    assert not holds("on", bag, table())


def test_a_table_is_not_under_what_stands_on_it() -> None:
    assert not holds("under", table(), node(1, "cup", (0.3, 0.1, 0.75), CUP))


def test_a_lamp_hangs_above_a_table() -> None:
    lamp = node(1, "lamp", (0, 0, 1.6), (0.4, 0.4, 0.3))
    assert holds("above", lamp, table())
    assert not holds("above", table(), lamp)
    assert not holds("on", lamp, table())
    assert not holds("above", node(1, "lamp", (2.0, 0, 1.6), (0.4, 0.4, 0.3)), table())


def test_a_chair_stands_beside_a_table_and_the_table_beside_the_chair() -> None:
    chair = node(1, "chair", (0, 0.8, 0), CHAIR)
    assert holds("beside", chair, table())
    assert holds("beside", table(), chair)
    assert not holds("on", chair, table())


def test_a_chair_pushed_in_under_the_edge_is_beside_the_table_still() -> None:
    assert holds("beside", node(1, "chair", (0, 0.6, 0), CHAIR), table())


@pytest.mark.parametrize(
    ("foot", "why"), [((0, 2.0, 0), "too far"), ((0, 0.8, 1.0), "higher up"), ((0.3, 0.1, 0.75), "on it")]
)
def test_what_is_not_beside_a_table(foot: Point, why: str) -> None:
    assert not holds("beside", node(1, "cup", foot, CUP), table()), why


def test_a_cup_lies_inside_a_bin_but_not_inside_a_chair() -> None:
    cup = node(1, "cup", (0, 0, 0.05), CUP)
    assert holds("inside", cup, node(2, "bin", (0, 0, 0), (0.3, 0.3, 0.4)))
    assert not holds("inside", cup, node(2, "chair", (0, 0, 0), CHAIR))
    assert not holds("inside", node(2, "bin", (0, 0, 0), (0.3, 0.3, 0.4)), cup)


def test_what_stands_before_a_bin_or_mostly_sticks_out_of_it_is_not_inside() -> None:
    bin_ = node(2, "bin", (0, 0, 0), (0.3, 0.3, 0.4))
    assert not holds("inside", node(1, "cup", (0.3, 0, 0.05), CUP), bin_)
    assert not holds("inside", node(1, "umbrella", (0, 0, 0.3), (0.1, 0.1, 0.8)), bin_)


def test_a_painting_is_attached_to_a_wall() -> None:
    wall = node(2, "wall", (0, 1, 0), (4, 0.1, 2.6))
    assert holds("attached to", node(1, "painting", (0, 0.93, 1.2), (0.8, 0.04, 0.6)), wall)
    assert not holds("attached to", node(1, "couch", (0, 0.5, 0), (1.8, 0.8, 0.8)), wall)
    assert not holds("attached to", node(1, "painting", (0, 0.3, 1.2), (0.8, 0.04, 0.6)), wall)
    assert not holds(
        "attached to", node(1, "painting", (0, 0.93, 1.2), (0.8, 0.04, 0.6)), node(2, "chair", (0, 1, 0), CHAIR)
    )


def test_near_is_measured_with_the_things_themselves() -> None:
    """Half a metre is near for two cups; a metre is not, but is so for a chair and a table."""
    cup = node(1, "cup", (0, 0, 0), CUP)
    assert holds("near", cup, node(2, "cup", (0.5, 0, 0), CUP))
    assert not holds("near", cup, node(2, "cup", (1.0, 0, 0), CUP))
    assert holds("near", node(1, "chair", (0, 1.6, 0), CHAIR), table())
    assert not holds("near", node(1, "chair", (0, 3.0, 0), CHAIR), table())


def test_near_counts_the_height_between() -> None:
    low, high = node(1, "cup", (0, 0, 0), CUP), node(2, "cup", (0, 0, 1.5), CUP)
    assert not holds("near", low, high)
    assert not holds("near", high, low)


def test_the_nearer_the_surer() -> None:
    chairs = [node(1, "chair", (0, y, 0), CHAIR) for y in (0.75, 0.9, 1.05)]
    sure = [confidence("beside", chair, table()) for chair in chairs]
    assert sure[0] > sure[1] > sure[2] > 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "subject",
    [
        node(1, "cup", (0.3, 0.1, 0.75), CUP),
        node(1, "chair", (0, 0.8, 0), CHAIR),
        node(1, "handbag", (0.2, 0, 0), (0.3, 0.2, 0.35)),
        node(1, "lamp", (0, 0, 1.6), (0.4, 0.4, 0.3)),
        node(1, "chair", (0, 1.7, 0), CHAIR),
    ],
    ids=["cup on it", "chair beside it", "bag under it", "lamp above it", "chair near it"],
)
def test_confidences_are_probabilities_and_slack_only_helps(name: str, subject: GraphNode) -> None:
    for other in (table(), table(label="cabinet")):
        strict, lenient = (confidence(name, subject, other, slack) for slack in (1.0, 1.3))
        assert 0 <= strict <= 1
        assert 0 <= lenient <= 1
        assert lenient >= strict


@pytest.mark.parametrize("name", ["near", "beside"])
def test_near_and_beside_are_mutual(name: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        places, sizes = rng.uniform(-1, 1, (2, 3)), rng.uniform(0.05, 1, (2, 3))
        one, other = (node(i, "box", tuple(places[i]), tuple(sizes[i]), float(places[i, 0])) for i in (0, 1))
        assert confidence(name, one, other) == pytest.approx(confidence(name, other, one))


def test_a_turned_pair_is_the_pair_seen_from_the_other_side() -> None:
    cup = node(1, "cup", (0.3, 0.1, 0.75), CUP)
    pair = Pair(cup, table())
    assert pair.overlap_share == pytest.approx(1.0)
    assert pair.gap_m == 0.0
    turned = pair.turned()
    assert (turned.subject.number, turned.other.number) == (2, 1)
    assert turned.overlap_share == pytest.approx(0.08 * 0.08 / (1.6 * 0.9), rel=0.01)
    assert turned.gap_m == 0.0


@pytest.mark.parametrize(("low_m", "is_on"), [(0.695, True), (0.70, True), (0.66, False), (0.60, False)])
def test_a_thin_thing_measured_within_a_thin_table_top_lies_on_it(low_m: float, is_on: bool) -> None:
    book: Point = (0.3, 0.22, 0.03)
    with_points = node(2, "dining table", (0, 0, 0.66), (2.0, 0.9, 0.08))
    for top in (with_points, GraphNode(2, "dining table", with_points.box, np.zeros((0, 3)))):
        assert holds("on", node(1, "book", (0.3, 0.1, low_m), book), top) == is_on
        assert not holds("on", top, node(1, "book", (0.3, 0.1, low_m), book))


def test_what_stands_within_shelves_is_on_them_and_in_them() -> None:
    book, inside = (0.05, 0.2, 0.25), (0.3, 0, 0.8)
    for label in ("bookshelf", "wall shelf", "cabinet"):
        shelf = node(2, label, (0, 0, 0), (1.0, 0.4, 1.8))
        assert relations(node(1, "book", inside, book), shelf) >= {"on", "inside"}
    box = node(2, "box", (0, 0, 0), (1.0, 0.4, 1.8))
    assert "on" not in relations(node(1, "book", inside, book), box)
