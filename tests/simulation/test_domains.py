"""Choosing the levels of axes, and the fixed set of worlds made from them."""

from __future__ import annotations

import pytest

from supermap_cli.errors import SimulationError
from supermap_cli.simulation.domains.axes import AXES, apply_levels, choose_levels, random_levels
from supermap_cli.simulation.domains.domain import Axis, Domain, usual_level
from supermap_cli.simulation.domains.suite import RANDOM_WORLDS, USUAL, suite_worlds
from supermap_cli.simulation.rigs import small_rgbd_rig
from supermap_cli.simulation.scenarios import make_scenario


def test_every_axis_has_three_levels_or_more_and_says_what_they_are() -> None:
    for axis in AXES.values():
        assert len(axis.levels) >= 3, axis.name
        assert axis.text
        assert all(level.text for level in axis.levels.values())


def test_the_usual_levels_leave_the_domain_as_it_is() -> None:
    usual = Domain(small_rgbd_rig())
    levels = {axis.name: axis.usual for axis in AXES.values()}
    assert repr(apply_levels(usual, {})) == repr(apply_levels(usual, levels))


def test_named_levels_are_chosen_and_random_draws_the_others() -> None:
    axis, *others = AXES.values()
    level = list(axis.levels)[-1]
    assert choose_levels([], 1) == {}
    assert choose_levels([f"{axis.name}={level}"], 1) == {axis.name: level}
    drawn = choose_levels(["random", f"{axis.name}={level}"], 1)
    assert drawn == random_levels(1) | {axis.name: level}
    assert set(drawn) == {axis.name, *(other.name for other in others)}


def test_random_levels_follow_from_the_seed() -> None:
    assert random_levels(1) == random_levels(1)
    assert len({tuple(random_levels(seed).values()) for seed in range(8)}) > 1


@pytest.mark.parametrize("given", ["masks", "colour=red", "masks=wool"])
def test_what_is_no_level_is_an_error_that_lists_what_there_is(given: str) -> None:
    with pytest.raises(SimulationError) as caught:
        choose_levels([given], 1)
    assert caught.value.cure


def test_two_levels_of_one_axis_are_an_error() -> None:
    axis = next(iter(AXES.values()))
    first, second, *_ = axis.levels
    with pytest.raises(SimulationError, match="two levels"):
        choose_levels([f"{axis.name}={first}", f"{axis.name}={second}"], 1)


def test_an_axis_needs_its_usual_level() -> None:
    with pytest.raises(ValueError, match="usual level"):
        Axis("colour", "the colour", "red", {"blue": usual_level("blue")})


def test_a_fixed_world_takes_no_axis_of_the_world() -> None:
    axis = next(axis for axis in AXES.values() if axis.of_world)
    with pytest.raises(SimulationError, match="fixed"):
        make_scenario("tiny", 1, levels={axis.name: list(axis.levels)[-1]})


def test_the_suite_has_each_level_in_both_halves_and_no_seed_in_two() -> None:
    worlds = suite_worlds()
    seeds = {half: {world.seed for world in worlds if world.half == half} for half in ("development", "report")}
    assert not seeds["development"] & seeds["report"]
    for axis in AXES.values():
        for level in set(axis.levels) - {axis.usual}:
            halves = [world.half for world in worlds if (world.axis, world.level) == (axis.name, level)]
            assert sorted(halves) == ["development", "report"]
    assert sum(world.axis == "random" for world in worlds) == 2 * RANDOM_WORLDS == 12
    assert all(not world.domain for world in worlds if world.axis == USUAL)


def test_every_world_of_the_suite_has_a_usual_world_of_its_room() -> None:
    usual = {world.seed for world in suite_worlds() if world.axis == USUAL}
    assert {world.seed for world in suite_worlds() if world.level} <= usual
