"""The TF tree: chains, interpolation, and faults by name."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.recordings.messages import PoseMessage
from supermap_cli.recordings.transforms import HOLD_NS, Link, MovingTransforms, TransformTree

SECOND = 1_000_000_000


def link(parent, child, x=0.0, yaw=0.0, at=0):
    q = np.array([0, 0, np.sin(yaw / 2), np.cos(yaw / 2)])
    return PoseMessage(at, parent, child, np.array([x, 0, 0]), q)


def tree_of(*links, static=True):
    tree = TransformTree()
    for link in links:
        tree.add(link, static)
    return tree


def test_a_frame_stands_on_itself():
    assert np.array_equal(TransformTree().lookup("a", "a", 0), np.eye(4))


def test_frames_that_are_unknown_or_apart_are_named():
    tree = tree_of(link("a", "b"), link("c", "d"))
    with pytest.raises(CalibrationError, match="knows no frame 'x'"):
        tree.lookup("a", "x", 0)
    with pytest.raises(CalibrationError, match="does not connect 'b' and 'd'"):
        tree.lookup("b", "d", 0)
    assert not tree.connects("b", "d")
    assert tree.roots() == ("a", "c")


def test_a_loop_is_named():
    tree = tree_of(link("a", "b"), link("b", "c"), link("c", "a"))
    with pytest.raises(CalibrationError, match=r"loop: .*a.*b.*c"):
        tree.lookup("a", "c", 0)


@given(*[st.floats(-3, 3)] * 6)
def test_chains_go_through_the_common_ancestor(x1, yaw1, x2, yaw2, x3, yaw3):
    tree = tree_of(link("root", "a", x1, yaw1), link("root", "b", x2, yaw2), link("b", "c", x3, yaw3))
    T_a_c = tree.lookup("a", "c", 0)
    expected = inverse(tree.lookup("root", "a", 0)) @ tree.lookup("root", "b", 0) @ tree.lookup("b", "c", 0)
    assert np.allclose(T_a_c, expected, atol=1e-9)
    assert np.allclose(T_a_c @ tree.lookup("c", "a", 0), np.eye(4), atol=1e-9)


def test_moving_links_are_interpolated_by_slerp():
    tree = tree_of(link("odom", "base", 0, 0, at=0), link("odom", "base", 2, 1.0, at=SECOND), static=False)
    T = tree.lookup("odom", "base", SECOND // 4)
    assert T[0, 3] == pytest.approx(0.5)
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.25)


def test_late_samples_find_their_place():
    tree = tree_of(*(link("odom", "base", t, at=t * SECOND) for t in (0, 2, 1)), static=False)
    assert tree.lookup("odom", "base", SECOND + SECOND // 2)[0, 3] == pytest.approx(1.5)


def test_beyond_its_samples_a_moving_link_holds_for_a_moment_only():
    tree = tree_of(link("odom", "base", 1, at=SECOND), link("odom", "base", 2, at=2 * SECOND), static=False)
    assert tree.lookup("odom", "base", 2 * SECOND + HOLD_NS)[0, 3] == 2
    assert tree.lookup("odom", "base", 2 * SECOND + HOLD_NS + 1) is None
    assert tree.lookup("odom", "base", SECOND - HOLD_NS - 1) is None


def test_a_link_seen_once_holds_forever():
    tree = tree_of(link("base", "camera", 1, at=SECOND), static=False)
    assert tree.lookup("base", "camera", 3600 * SECOND)[0, 3] == 1


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_transforms_that_are_not_finite_are_not_taken(broken):
    tree = TransformTree()
    assert not tree.add(link("a", "b", broken), static=True)
    assert not tree.add(PoseMessage(0, "a", "b", np.zeros(3), np.zeros(4)), static=True)
    assert tree.edges == ()


def test_of_two_parents_the_last_counts_unless_one_is_chosen():
    assert tree_of(link("a", "c"), link("b", "c")).parent_of("c") == "b"
    tree = TransformTree({"c": Link("a", "c", static=True)})
    assert tree.add(link("a", "c"), static=True)
    assert not tree.add(link("b", "c"), static=True)
    assert not tree.add(link("a", "c", 5), static=False)
    assert tree.parent_of("c") == "a"


def test_a_moving_tree_keeps_only_seconds():
    def moving():
        for index in range(6000):
            yield index * SECOND // 100, link("odom", "base", index / 100, at=index * SECOND // 100)

    transforms = MovingTransforms([link("base", "camera", 1)], moving)
    held = []
    for second in range(0, 59, 5):
        assert transforms.lookup("odom", "camera", second * SECOND)[0, 3] == pytest.approx(second + 1)
        held.append(max(len(edge.samples) for edge in transforms.tree.edges))
    assert max(held) < 1000
