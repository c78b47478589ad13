"""All parameters of the method, the mapping engine's and the scene graph's: what `[build.parameters.<file>]` names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields

from supermap_cli.config import BuildConfig
from supermap_cli.graph.parameters import GraphParameters
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.types.parameters import ParameterRow, described, overridden, unknown_parameter


@dataclass(frozen=True)
class MethodParameters:
    """Both groups of sets. No two files have one name."""

    mapping: MappingParameters = field(default_factory=MappingParameters)
    graph: GraphParameters = field(default_factory=GraphParameters)

    @classmethod
    def from_overrides(cls, values: Mapping[str, Mapping[str, object]]) -> MethodParameters:
        """The defaults but for the given values, by file and name. Raises `ConfigError` naming a wrong entry."""
        of_mapping, of_graph = _files(MappingParameters), _files(GraphParameters)
        for file in values:
            if file not in of_mapping and file not in of_graph:
                raise unknown_parameter(f"build.parameters.{file}", file, (*of_mapping, *of_graph))
        return cls(
            MappingParameters.from_overrides({file: values[file] for file in values if file in of_mapping}),
            overridden(GraphParameters(), {file: values[file] for file in values if file in of_graph}),
        )

    def describe(self) -> Iterator[ParameterRow]:
        """All parameters with unit, meaning and source."""
        yield from described(self.mapping)
        yield from described(self.graph)


def _files(group: type[MappingParameters] | type[GraphParameters]) -> tuple[str, ...]:
    return tuple(own.name for own in fields(group))


def stored_config(config: BuildConfig) -> dict[str, object]:
    """The configuration as a traversal stores it: with every parameter of the method, overridden or not.

    Raises `ConfigError` for a parameter that the method does not have.
    """
    parameters: dict[str, dict[str, object]] = {}
    for row in MethodParameters.from_overrides(config.parameters).describe():
        parameters.setdefault(row.file, {})[row.name] = list(row.value) if isinstance(row.value, tuple) else row.value
    return {**config.model_dump(mode="json"), "parameters": parameters}
