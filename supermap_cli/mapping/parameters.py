"""All parameters of the mapping engine: one set for each file of `supermap_cli/mapping/`, under the file's name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from supermap_cli.mapping.class_sizes import ClassSizeParameters
from supermap_cli.types.parameters import ParameterRow, described, overridden


@dataclass(frozen=True)
class MappingParameters:
    """The sets, each frozen. A new file with numbers gets a line here."""

    class_sizes: ClassSizeParameters = field(default_factory=ClassSizeParameters)

    @classmethod
    def from_overrides(cls, values: Mapping[str, Mapping[str, object]]) -> MappingParameters:
        """The defaults but for the given values, by file and name. Raises `ConfigError` naming a wrong entry."""
        return overridden(cls(), values)

    def describe(self) -> Iterator[ParameterRow]:
        """All parameters with unit, meaning and source."""
        return described(self)
