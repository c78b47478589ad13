"""A panorama is turned so that its seam cuts nothing, and what it had cut in two is one again."""

import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.mapping.depth import depth_view
from supermap_cli.mapping.seam import box_before_turning, turn_px, turned_depth, turned_detections, turned_keyframe
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from supermap_cli.types.keyframe import Keyframe
from support import scenes as s

CAMERA = EquirectangularCamera(360, 180)
T_MAP_CAMERA = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [1.0, 2.0, 0.9])


def found(*regions: tuple[int, int, int, int], labels: str = "chair") -> Detections:
    """Detections of whole boxes (u0, v0, width, height)."""
    masks = tuple(RegionMask(u0, v0, np.ones((h, w), bool)) for u0, v0, w, h in regions)
    boxes = np.array([(u0, v0, u0 + w, v0 + h) for u0, v0, w, h in regions], np.float32)
    names = labels.split() * (len(regions) if " " not in labels else 1)
    return Detections(
        s.ns(0), boxes, np.full(len(regions), 0.8, np.float32), tuple((Hypothesis(n, 0.8),) for n in names), masks
    )


def test_an_image_without_a_mask_at_its_border_stays_as_it_is() -> None:
    assert turn_px(found((100, 50, 30, 30)), CAMERA) == 0
    assert turn_px(found((0, 50, 30, 30)), s.CAMERA) == 0


def test_two_halves_at_the_seam_are_one_thing() -> None:
    detections = found((0, 50, 20, 30), (345, 52, 15, 30), (100, 60, 40, 40))
    by_px = turn_px(detections, CAMERA)
    turned, tracks = turned_detections(detections, np.array([4, 5, 6]), CAMERA.width, by_px)
    assert len(turned) == 2
    assert tracks.tolist() == [4, 6]
    assert turned.masks[0].pixels.shape == (32, 35)
    assert turned.boxes_xyxy[0, 2] - turned.boxes_xyxy[0, 0] == 35
    assert not any(mask.u0 == 0 or mask.u0 + mask.pixels.shape[1] >= CAMERA.width for mask in turned.masks)


@pytest.mark.parametrize(
    "detections",
    [found((0, 50, 20, 30), (345, 100, 15, 30)), found((0, 50, 20, 30), (345, 52, 15, 30), labels="chair couch")],
    ids=["beside one another", "called otherwise"],
)
def test_halves_that_do_not_meet_stay_two(detections: Detections) -> None:
    by_px = turn_px(detections, CAMERA)
    assert len(turned_detections(detections, np.array([1, 2]), CAMERA.width, by_px)[0]) == 2


def test_a_turned_panorama_shows_the_same_world() -> None:
    rng = np.random.default_rng(1)
    depth_m = rng.uniform(1, 5, (180, 360)).astype(np.float32)
    points = rng.normal(0, 2, (50, 3))
    keyframe = Keyframe(s.ns(0), np.zeros((180, 360, 3), np.uint8), depth_m, CAMERA, T_MAP_CAMERA, T_MAP_CAMERA, points)
    view = depth_view(keyframe, 10.0)
    turned = turned_keyframe(keyframe, 77)
    seen = turned_depth(view, turned, 77)
    where = rng.normal(0, 3, (40, 3))
    u, v, depth, _ = view.project(where)
    u_turned, v_turned, depth_turned, _ = seen.project(where)
    assert np.allclose(depth, depth_turned)
    same = ((u - 77) % 360 == u_turned) & (v == v_turned)
    assert same.mean() > 0.95
    assert np.allclose(view.depth_m[v, u][same], seen.depth_m[v_turned, u_turned][same])
    again = depth_view(turned, 10.0)
    assert np.allclose(again.returns.points_camera, seen.returns.points_camera)
    assert np.array_equal(again.returns.u, seen.returns.u)


def test_a_box_is_told_on_the_image_as_it_came() -> None:
    assert box_before_turning(np.array([10, 5, 30, 25], np.float32), 360, 0).tolist() == [10, 5, 30, 25]
    assert box_before_turning(np.array([10, 5, 30, 25], np.float32), 360, 100).tolist() == [110, 5, 130, 25]
    assert box_before_turning(np.array([255, 5, 290, 25], np.float32), 360, 100).tolist() == [0, 5, 30, 25]
