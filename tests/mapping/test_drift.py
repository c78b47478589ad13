"""Drift is put right by the surfaces already known, and the odometry is followed where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import inverse
from supermap_cli.mapping.drift import DriftCorrection, shifted
from supermap_cli.mapping.snapshot import drift_snapshot, restore_drift
from supermap_cli.mapping.structure import CoarseDepth
from support import scenes as s

BOX = s.Thing("", (1.0, 1.2, 0.5), (0.6, 0.6, 1.0))
WORLD = (*s.ROOM, s.CHAIR, s.TABLE, BOX)
ORIGIN = np.zeros(3)


def view(world: tuple[s.Thing, ...], eye: s.Point, drift: FloatArray) -> tuple[CoarseDepth, FloatArray]:
    """A depth image as the odometry has it, and where it has the camera, if `drift` is what it has left the map by."""
    keyframe = s.render(world, s.looking(eye, s.CHAIR.center)).keyframe
    T = inverse(drift) @ keyframe.T_map_camera
    return CoarseDepth(keyframe.depth_m, 1, keyframe.camera, T), T


def off_m(found: FloatArray, drift: FloatArray, drifted: FloatArray) -> float:
    return float(np.linalg.norm((found - drift @ drifted)[:3, 3]))


def test_growing_drift_is_followed_and_put_right() -> None:
    correction = DriftCorrection()
    for k in range(25):
        drift = shifted(np.eye(4), ORIGIN, np.array([0.006 * k, -0.004 * k, 0.0, np.radians(0.1 * k)]))
        seen, drifted = view(WORLD, (-0.4, -1.2 + 0.1 * k, 1.3), drift)
        found = correction.register(seen, drifted)
        assert off_m(found, drift, drifted) < 0.05
    assert off_m(drifted, drift, drifted) > 0.14


def test_an_exact_odometry_is_left_alone() -> None:
    correction = DriftCorrection()
    for k in range(10):
        seen, T = view(WORLD, (-0.4, -0.8 + 0.15 * k, 1.3), np.eye(4))
        assert off_m(correction.register(seen, T), np.eye(4), T) < 0.01


def test_where_nothing_is_known_yet_the_odometry_is_followed() -> None:
    seen, T = view(WORLD, (-0.4, 0, 1.3), np.eye(4))
    np.testing.assert_array_equal(DriftCorrection().register(seen, T), T)


def test_what_is_seen_of_nothing_changes_nothing() -> None:
    correction = DriftCorrection()
    for _ in range(3):
        seen, T = view((), (0, 0, 1), np.eye(4))
        np.testing.assert_array_equal(correction.register(seen, T), T)


def test_a_remembered_place_holds_a_traversal_that_was_placed_a_little_off() -> None:
    correction = DriftCorrection()
    for y in np.linspace(-1.2, 1.2, 8):
        correction.add_view(view(WORLD, (-0.4, float(y), 1.3), np.eye(4))[0])
    drift = shifted(np.eye(4), ORIGIN, np.array([0.08, 0.06, 0.0, np.radians(1.0)]))
    seen, drifted = view(WORLD, (-0.3, 0.1, 1.3), drift)
    assert off_m(correction.register(seen, drifted), drift, drifted) < 0.03


def test_one_wall_leaves_the_way_along_it_to_the_odometry() -> None:
    wall = s.Thing("", (2.5, 0, 1.5), (0.1, 40, 30))
    correction = DriftCorrection()
    for k in range(8):
        keyframe = s.render((wall,), s.looking((0, 0.1 * k, 1.3), (2.5, 0.1 * k, 1.3))).keyframe
        seen = CoarseDepth(keyframe.depth_m, 1, keyframe.camera, keyframe.T_map_camera)
        found = correction.register(seen, keyframe.T_map_camera)
        assert found[1, 3] == pytest.approx(keyframe.T_map_camera[1, 3], abs=0.02)


def test_a_turn_is_about_the_place_and_a_shift_comes_after_it() -> None:
    center = np.array([1.0, 2.0, 3.0])
    T = shifted(np.eye(4), center, np.array([0.1, 0.2, 0.3, 0.5]))
    np.testing.assert_allclose(T[:3, :3] @ center + T[:3, 3], center + np.array([0.1, 0.2, 0.3]))
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.5)


def test_a_jump_of_the_odometry_is_put_right() -> None:
    correction = DriftCorrection()
    jump = shifted(np.eye(4), ORIGIN, np.array([0.25, -0.15, 0.0, np.radians(5.0)]))
    for k in range(16):
        drift = jump if k >= 8 else np.eye(4)
        seen, drifted = view(WORLD, (-0.4, -0.8 + 0.1 * k, 1.3), drift)
        found = correction.register(seen, drifted)
    assert off_m(found, jump, drifted) < 0.05


def test_a_build_that_goes_on_from_a_snapshot_finds_the_same_places() -> None:
    correction, marks, expected = DriftCorrection(), [], []
    seen = [
        view(WORLD, (-0.4, -1.2 + 0.1 * k, 1.3), shifted(np.eye(4), ORIGIN, np.array([0.006 * k, 0, 0, 0.001 * k])))
        for k in range(20)
    ]
    for one in seen:
        expected.append(correction.register(*one))
        marks.append(correction.mark())
    resumed = restore_drift(drift_snapshot(correction, marks[9]))
    for one, found in zip(seen[10:], expected[10:], strict=True):
        np.testing.assert_array_equal(resumed.register(*one), found)


def test_a_bare_wall_proves_no_jump() -> None:
    """What fits in many places fits after a wide search, too."""
    correction = DriftCorrection()
    for k in range(6):
        seen, T = view(WORLD, (-0.4, -0.8 + 0.1 * k, 1.3), np.eye(4))
        correction.register(seen, T)
    keyframe = s.render((s.Thing("", (0.6, 5.0, 1.5), (8, 0.1, 3)),), s.looking((0, 4.0, 1.3), (0, 5.0, 1.3))).keyframe
    bare = CoarseDepth(keyframe.depth_m, 1, keyframe.camera, keyframe.T_map_camera)
    np.testing.assert_allclose(correction.register(bare, keyframe.T_map_camera), keyframe.T_map_camera, atol=0.02)
