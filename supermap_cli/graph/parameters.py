"""All parameters of the scene graph: one set for each file of `supermap_cli/graph/`, under the file's name."""

from __future__ import annotations

from dataclasses import dataclass, field

from supermap_cli.graph.predicates import PredicateParameters
from supermap_cli.graph.scene_graph import SceneGraphParameters


@dataclass(frozen=True)
class GraphParameters:
    """The sets, each frozen."""

    predicates: PredicateParameters = field(default_factory=PredicateParameters)
    scene_graph: SceneGraphParameters = field(default_factory=SceneGraphParameters)
