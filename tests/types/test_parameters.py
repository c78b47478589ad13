"""Parameter sets: what is known of each number, and what may take its place."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from supermap_cli.errors import ConfigError
from supermap_cli.types.parameters import described, overridden, parameter


@dataclass(frozen=True)
class RadarParameters:
    sigma_m: float = parameter(0.2, "m", "deviation of a range", "a data sheet", at_most=1.0)
    echoes: int = parameter(3, "1", "echoes kept of a pulse", "tuned", at_least=1)
    offset_m: float = parameter(-0.1, "m", "offset of the ranges", "calibration")
    doppler: bool = parameter(default=True, unit="1", meaning="whether speeds are used", source="tuned")
    gates_m: tuple[float, ...] = parameter((0.5, 1.0), "m", "gates, in turn", "tuned")
    band: tuple[float, float] = parameter((0.0, 2.0), "m", "heights used", "tuned")


@dataclass(frozen=True)
class Group:
    radar: RadarParameters = field(default_factory=RadarParameters)


def test_a_set_is_a_plain_dataclass_of_its_defaults() -> None:
    assert RadarParameters().sigma_m == 0.2
    assert RadarParameters(echoes=1).echoes == 1


def test_everything_known_of_a_parameter_is_described() -> None:
    first, *_ = described(Group(RadarParameters(sigma_m=0.5)))
    assert (first.file, first.name, first.value, first.default) == ("radar", "sigma_m", 0.5, 0.2)
    assert (first.unit, first.meaning, first.source) == ("m", "deviation of a range", "a data sheet")
    assert [row.name for row in described(Group(RadarParameters(sigma_m=0.5))) if row.overridden] == ["sigma_m"]


def test_nothing_given_changes_nothing() -> None:
    assert overridden(Group(), {}) == overridden(Group(), {"radar": {}}) == Group()


@pytest.mark.parametrize(
    ("name", "given", "used"),
    [
        ("sigma_m", 1, 1.0),
        ("echoes", 5, 5),
        ("offset_m", -2.0, -2.0),
        ("doppler", False, False),
        ("gates_m", [1, 2, 3], (1.0, 2.0, 3.0)),
        ("band", [0.5, 1.5], (0.5, 1.5)),
    ],
)
def test_a_value_takes_the_type_of_its_default(name: str, given: object, used: object) -> None:
    changed = overridden(Group(), {"radar": {name: given}})
    value = getattr(changed.radar, name)
    assert value == used
    assert type(value) is type(used)


@pytest.mark.parametrize(
    ("file", "name", "given", "said"),
    [
        ("rader", "sigma_m", 0.1, "there is no parameter rader; is it radar"),
        ("radar", "sigma", 0.1, "there is no parameter sigma; is it sigma_m"),
        ("radar", "weather", 0.1, "there is no parameter weather"),
        ("radar", "sigma_m", "0.1", "not a finite number: '0.1'"),
        ("radar", "sigma_m", float("nan"), "not a finite number"),
        ("radar", "sigma_m", True, "not a number"),
        ("radar", "sigma_m", -0.1, "-0.1 is less than 0"),
        ("radar", "sigma_m", 1.1, "1.1 is more than 1"),
        ("radar", "echoes", 2.5, "not a whole number"),
        ("radar", "echoes", 0, "0 is less than 1"),
        ("radar", "doppler", 1, "not true or false"),
        ("radar", "gates_m", 0.5, "not a list of numbers"),
        ("radar", "gates_m", [], "not a list of numbers"),
        ("radar", "gates_m", [0.5, "far"], "not a finite number: 'far'"),
        ("radar", "band", [0.0], "2 numbers are needed, not 1"),
    ],
)
def test_what_is_wrong_is_named(file: str, name: str, given: object, said: str) -> None:
    with pytest.raises(ConfigError, match=said) as raised:
        overridden(Group(), {file: {name: given}})
    assert f"(build.parameters.{file}" in str(raised.value)
