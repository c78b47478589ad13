"""A LiDAR's returns under a mask: which they are, and what is left of their noise."""

import numpy as np
import pytest

from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.mapping.lifting import is_truncated
from supermap_cli.mapping.returns import DEFAULT, returns_on_image, spacing_m
from supermap_cli.types.detections import RegionMask

CAMERA = EquirectangularCamera(1440, 720)
FOCAL_PX = CAMERA.focal_px()


def wall(noise_m: float, count: int = 4000) -> np.ndarray:
    """Returns (n, 3), in the optical frame, from a wall 2 m ahead with a box before its left half."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-0.5, 0.5, count), rng.uniform(-0.3, 0.3, count)
    points = np.column_stack([x, y, np.where(x < 0, 1.7, 2.0)])
    range_m = np.linalg.norm(points, axis=1)
    return points * ((range_m + rng.normal(0, noise_m, count)) / range_m)[:, None]


def test_no_returns_lie_under_no_mask() -> None:
    returns = returns_on_image(CAMERA, np.zeros((0, 3)), 12.0)
    assert not len(returns.under(RegionMask(0, 0, np.ones((720, 1440), bool)), np.ones((720, 1440), bool)))


def test_returns_are_found_under_a_mask_and_only_within_range() -> None:
    points = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 0.0, 20.0]])
    returns = returns_on_image(CAMERA, points, 12.0)
    mask = RegionMask(710, 350, np.ones((20, 20), bool))
    assert len(returns.u) == 2
    assert returns.depth_m[returns.under(mask, mask.pixels)] == pytest.approx([2.0])


def test_noise_is_averaged_out_on_a_surface_and_not_over_an_edge() -> None:
    returns = returns_on_image(CAMERA, wall(DEFAULT.range_sigma_m), 12.0)
    smoothed = returns.smoothed(np.arange(len(returns.u)))
    true_z = np.where(smoothed[:, 0] < 0, 1.7, 2.0)
    away = np.abs(smoothed[:, 0]) > 0.03
    assert np.std((smoothed[:, 2] - true_z)[away]) < 0.5 * DEFAULT.range_sigma_m
    assert np.abs(smoothed[:, 2] - true_z)[away].max() < 5 * DEFAULT.range_sigma_m


def test_a_quarter_of_the_returns_lie_twice_as_far_apart() -> None:
    assert spacing_m(25, 400, 3.0, FOCAL_PX) == pytest.approx(2 * spacing_m(100, 400, 3.0, FOCAL_PX))


@pytest.mark.parametrize(
    ("box", "truncated"), [((0, 300, 40, 400), False), ((1400, 300, 1439, 400), False), ((600, 0, 700, 90), True)]
)
def test_the_seam_of_a_full_turn_cuts_nothing(box: tuple[int, int, int, int], truncated: bool) -> None:
    assert is_truncated(np.array(box, np.float32), CAMERA) == truncated


def test_returns_of_many_ranges_on_one_pixel_stay_where_they_are() -> None:
    """Of more on one pixel than are averaged, a return may not be among its own neighbours."""
    points = np.column_stack([np.zeros((400, 2)), np.linspace(1.0, 11.0, 400)])
    returns = returns_on_image(CAMERA, points, 12.0)
    smoothed = returns.smoothed(np.arange(400))
    assert np.isfinite(smoothed).all()
    np.testing.assert_allclose(smoothed, points, atol=3 * np.sqrt(2) * DEFAULT.range_sigma_m)
