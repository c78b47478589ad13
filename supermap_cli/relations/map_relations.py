"""The relations of a map: the built-in ones with the parameters it was built with, and those of plugins.

A build writes into its traversal's configuration what it needs: all parameters, and the names and words of what plugins
defined, so that a map can be asked where the plugin is not installed. Without it such a relation is only known by its
edges.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

from supermap_cli.geometry.boxes import Reach
from supermap_cli.relations.predicates import never
from supermap_cli.relations.registry import RELATIONS, RelationRegistry
from supermap_cli.types.relations import DEFAULT, UNBOUNDED, PredicateParameters, SpatialRelation

CONFIG_ENTRY = "relations"
"""The entry of a traversal's configuration that holds `described`."""
HELD_SLACK = 1.3
"""The slack of a relation that holds, where a configuration does not tell: `SceneGraphParameters.held_slack`."""


def described(further: Iterable[SpatialRelation]) -> list[dict[str, object]]:
    """What a map keeps of the relations of plugins."""
    return [
        {
            "name": relation.name,
            "words": {language: list(phrases) for language, phrases in relation.words.items()},
            "inverse": relation.inverse,
            "symmetric": relation.symmetric,
            "clear_between": relation.clear_between,
            "reach": None if relation.reach == UNBOUNDED else [relation.reach.floor_m, relation.reach.height_m],
        }
        for relation in further
    ]


def relations_of_configs(configs: Iterable[str | Mapping[str, Any]]) -> tuple[RelationRegistry, float]:
    """The relations by the configurations of a map's traversals, the newest one last, and the slack of what holds.

    Where these are damaged, or written by hand, the built-in values are taken.
    """
    registry, slack = RELATIONS, HELD_SLACK
    for config in configs:
        parsed = _parsed(config)
        further = parsed.get(CONFIG_ENTRY)
        for entry in further if isinstance(further, list) else ():
            if isinstance(entry, dict) and isinstance(entry.get("name"), str):
                registry = registry.with_further([_relation(entry)])
        parameters = parsed.get("parameters")
        if isinstance(parameters, dict):
            registry = replace(registry, parameters=_parameters(parameters.get("predicates")))
            slack = _number(parameters.get("scene_graph"), "held_slack", HELD_SLACK)
    return registry, slack


def _parsed(config: str | Mapping[str, Any]) -> Mapping[str, Any]:
    if not isinstance(config, str):
        return config
    try:
        found = json.loads(config)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _parameters(values: object) -> PredicateParameters:
    known = {entry.name: _number(values, entry.name, getattr(DEFAULT, entry.name)) for entry in fields(DEFAULT)}
    return PredicateParameters(**known)


def _number(values: object, name: str, otherwise: float) -> float:
    found = values.get(name) if isinstance(values, dict) else None
    return float(found) if isinstance(found, (int, float)) and not isinstance(found, bool) else otherwise


def _relation(entry: Mapping[str, Any]) -> SpatialRelation:
    words, reach = entry.get("words"), entry.get("reach")
    spoken = {
        str(language): tuple(map(str, phrases))
        for language, phrases in (words.items() if isinstance(words, dict) else ())
        if isinstance(phrases, list)
    }
    inverse = entry.get("inverse")
    return SpatialRelation(
        entry["name"],
        never,
        spoken,
        Reach(float(reach[0]), float(reach[1])) if isinstance(reach, list) and len(reach) == 2 else UNBOUNDED,
        inverse if isinstance(inverse, str) else None,
        symmetric=entry.get("symmetric") is True,
        clear_between=entry.get("clear_between") is True,
    )
