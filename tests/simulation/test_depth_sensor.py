import numpy as np
import pytest

from supermap_cli.simulation.rigs import DepthSensor
from supermap_cli.simulation.sensors.depth_sensor import measure_depth
from supermap_cli.simulation.views import RenderedView

PERFECT = DepthSensor(noise_per_m=0.0, lost_share=0.0)
SHAPE = (60, 80)


def view_of(depth_m: np.ndarray, slant_cos: float | np.ndarray = 1.0) -> RenderedView:
    shape = depth_m.shape
    slant = np.broadcast_to(np.asarray(slant_cos, np.float32), shape).copy()
    return RenderedView(
        0, depth_m.astype(np.float32), np.zeros(shape, np.int32), slant, np.zeros((*shape, 3), np.uint8)
    )


def step(near_m: float = 1.0, far_m: float = 2.0) -> np.ndarray:
    depth_m = np.full(SHAPE, near_m)
    depth_m[:, 40:] = far_m
    return depth_m


def test_where_nothing_is_nothing_returns() -> None:
    assert not measure_depth(view_of(np.zeros(SHAPE)), DepthSensor(), np.random.default_rng(0)).any()


def test_a_perfect_sensor_reports_the_exact_depth() -> None:
    view = view_of(np.full(SHAPE, 2.0))
    np.testing.assert_array_equal(measure_depth(view, PERFECT, np.random.default_rng(0)), view.depth_m)


@pytest.mark.parametrize("depth_m", [1.0, 2.0, 6.0])
def test_noise_grows_with_the_square_of_the_depth(depth_m: float) -> None:
    measured = measure_depth(view_of(np.full((200, 200), depth_m)), DepthSensor(), np.random.default_rng(0))
    error = measured[measured > 0] - depth_m
    assert error.std() == pytest.approx(0.0015 * depth_m**2, rel=0.05)
    assert abs(error.mean()) < 0.0001 * depth_m**2
    assert (measured == 0).mean() == pytest.approx(0.005, rel=0.3)


@pytest.mark.parametrize(("depth_m", "returns"), [(0.25, False), (0.35, True), (7.9, True), (8.1, False)])
def test_nothing_returns_beyond_the_limits(depth_m: float, returns: bool) -> None:
    assert measure_depth(view_of(np.full(SHAPE, depth_m)), PERFECT, np.random.default_rng(0)).any() == returns


@pytest.mark.parametrize(("slant_deg", "returns"), [(0, True), (81, True), (83, False)])
def test_nothing_returns_from_grazing_surfaces(slant_deg: float, returns: bool) -> None:
    view = view_of(np.full(SHAPE, 2.0), np.cos(np.radians(slant_deg)))
    assert measure_depth(view, PERFECT, np.random.default_rng(0)).any() == returns


@pytest.mark.parametrize("edge_px", [0, 1, 3])
def test_holes_and_flying_pixels_lie_beside_depth_edges(edge_px: int) -> None:
    view = view_of(np.tile(step(), (20, 1)))
    sensor = DepthSensor(noise_per_m=0.0, lost_share=0.0, edge_px=edge_px)
    measured = measure_depth(view, sensor, np.random.default_rng(0))
    changed = measured != view.depth_m
    assert set(np.nonzero(changed)[1].tolist()) == set(range(40 - edge_px, 40 + edge_px))
    if edge_px:
        beside = measured[:, 40 - edge_px : 40 + edge_px]
        flying = (beside != 0) & (beside != 1) & (beside != 2)
        assert (beside == 0).mean() == pytest.approx(0.7, abs=0.05)
        assert flying.mean() == pytest.approx(0.08, abs=0.03)
        assert ((beside[flying] > 1) & (beside[flying] < 2)).all()


def test_a_floor_that_runs_away_is_no_edge() -> None:
    rows = np.arange(20, 200)[:, None]
    floor = view_of(np.broadcast_to(1.1 * 465 / rows, (180, 80)) * (rows > 64)[:, :1])  # 1.1 m below, up to 8 m away
    measured = measure_depth(floor, PERFECT, np.random.default_rng(0))
    np.testing.assert_array_equal(measured, floor.depth_m)


def test_the_same_draws_give_the_same_image() -> None:
    first, again, other = (
        measure_depth(view_of(step()), DepthSensor(), np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
