"""Parameters of the method: numbers that carry their unit, meaning and source, in frozen sets, one for each file.

A file with numbers declares a set and its defaults::

    @dataclass(frozen=True)
    class LevellingParameters:
        voxel_m: float = parameter(0.05, "m", "edge of the voxels that surfaces are thinned to", TUNED)

    DEFAULT = LevellingParameters()

A dataclass whose fields are such sets, named for their files, is a group: `overridden` changes single values of one,
`described` lists all of them.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import Field, dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar, cast

from supermap_cli.errors import ConfigError

Value = bool | int | float | tuple[int, ...] | tuple[float, ...]
"""What a parameter may be. A TOML array stands for a tuple."""

T = TypeVar("T", bound=Value)
S = TypeVar("S")

TUNED = "tuned on seeds 1-3"
"""The source of a number that was chosen by experiment: seeds 1 to 3 of `supermap simulate office-twice`."""

_MOST_TIMES = 1e6
"""How many times its default, or 1, a parameter may be where nothing else bounds it: no such value makes sense, and
none overflows what is reckoned with it.
"""

_LARGEST_SHOWN = 1e300
"""Whole numbers beyond it are no floats any more."""

_DESCRIPTION = "supermap"
_CURE = "supermap config show lists all parameters"


@dataclass(frozen=True)
class Description:
    """What is known of a parameter besides its value. `at_least` and `at_most` bound it, or each of its numbers."""

    unit: str
    meaning: str
    source: str
    at_least: float | None = None
    at_most: float | None = None


def parameter(
    default: T,
    unit: str,
    meaning: str,
    source: str,
    *,
    at_least: float | None = None,
    at_most: float | None = None,
) -> T:
    """A field of a parameter set. `unit` is "1" where there is none; `source` a paper, a data sheet, or `TUNED`.

    What is not negative by default must never be, unless `at_least` says otherwise; and nothing is a million times its
    default, unless `at_most` says otherwise.
    """
    numbers = default if isinstance(default, tuple) else (default,)
    largest = _MOST_TIMES * max(1.0, *(abs(number) for number in numbers))
    if at_least is None:
        at_least = 0.0 if min(numbers) >= 0 else -largest
    if at_most is None:
        at_most = largest
    return field(default=default, metadata={_DESCRIPTION: Description(unit, meaning, source, at_least, at_most)})


@dataclass(frozen=True)
class ParameterRow:
    """One parameter as it is shown: `file` is the set it belongs to."""

    file: str
    name: str
    value: Value
    default: Value
    unit: str
    meaning: str
    source: str

    @property
    def overridden(self) -> bool:
        """Whether the value is another than the default."""
        return self.value != self.default


def described(group: object) -> Iterator[ParameterRow]:
    """All parameters of a group of sets, in the order in which they are declared."""
    for own in _fields(group):
        parameters = getattr(group, own.name)
        for one in _fields(parameters):
            about: Description = one.metadata[_DESCRIPTION]
            value = getattr(parameters, one.name)
            yield ParameterRow(own.name, one.name, value, _default(one), about.unit, about.meaning, about.source)


def overridden(group: S, values: Mapping[str, Mapping[str, object]]) -> S:
    """A group of sets with other values, by set and name.

    Raises `ConfigError`, naming the entry, for an unknown set or name (with the nearest ones) and for a value that is
    of another type than the default or out of bounds.
    """
    sets = {own.name: getattr(group, own.name) for own in _fields(group)}
    changed = {}
    for file, entries in values.items():
        if file not in sets:
            raise unknown_parameter(f"build.parameters.{file}", file, sets)
        known = {one.name: one for one in _fields(sets[file])}
        given = {}
        for name, value in entries.items():
            where = f"build.parameters.{file}.{name}"
            if name not in known:
                raise unknown_parameter(where, name, known)
            given[name] = _checked(where, value, known[name])
        changed[file] = replace(sets[file], **given)
    return cast("S", replace(cast("Any", group), **changed))


def _fields(of: object) -> tuple[Field[Any], ...]:
    if not is_dataclass(of):
        raise TypeError(f"no dataclass: {of!r}")
    return fields(of)


def unknown_parameter(where: str, name: str, known: Collection[str]) -> ConfigError:
    """The error for a name that is none of the known ones, with the nearest of these."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    hint = f"; is it {' or '.join(near)}?" if near else ""
    return ConfigError(f"there is no parameter {name}{hint}", where=where, cure=_CURE)


def _default(of: Field[Any]) -> Value:
    return cast("Value", of.default)


def _checked(where: str, value: object, of: Field[Any]) -> Value:
    """A value as the parameter's own type. Raises `ConfigError` where it does not fit."""
    default = _default(of)
    about: Description = of.metadata[_DESCRIPTION]
    if not isinstance(default, tuple):
        return _number(where, value, default, about)
    if not isinstance(value, list | tuple) or not value:
        raise ConfigError(f"not a list of numbers: {value!r}", where=where, cure=_CURE)
    if not str(of.type).endswith(", ...]") and len(value) != len(default):
        raise ConfigError(f"{len(default)} numbers are needed, not {len(value)}", where=where, cure=_CURE)
    kind = next((one for one in default if isinstance(one, float)), default[0])
    return tuple(_number(where, one, kind, about) for one in value)


def _shown(number: float) -> str:
    """A number, but not more digits than anybody reads."""
    return f"{number:.6g}" if abs(number) < _LARGEST_SHOWN else "a number of more than 300 digits"


def _range_text(about: Description) -> str:
    return f"give one from {about.at_least:g} to {about.at_most:g}; {_CURE}"


def _number(where: str, value: object, like: float, about: Description) -> bool | int | float:
    """A number of the type of another one; a whole number passes for any."""
    if isinstance(like, bool) or isinstance(value, bool):
        if not (isinstance(like, bool) and isinstance(value, bool)):
            what = f"not {'true or false' if isinstance(like, bool) else 'a number'}: {value!r}"
            raise ConfigError(what, where=where, cure=_CURE)
        return value
    if isinstance(like, int):
        if not isinstance(value, int):
            raise ConfigError(f"not a whole number: {value!r}", where=where, cure=_CURE)
        number: int | float = value
    elif isinstance(value, int | float) and abs(value) < _LARGEST_SHOWN:
        number = float(value)
    else:
        shown = _shown(value) if isinstance(value, int) else repr(value)
        raise ConfigError(f"not a finite number: {shown}", where=where, cure=_CURE)
    if about.at_least is not None and number < about.at_least:
        raise ConfigError(f"{_shown(number)} is less than {about.at_least:g}", where=where, cure=_range_text(about))
    if about.at_most is not None and number > about.at_most:
        raise ConfigError(f"{_shown(number)} is more than {about.at_most:g}", where=where, cure=_range_text(about))
    return number
