"""The spatial relations that the scene graph keeps: those of the registry (`supermap_cli.relations`) that are stored.

The class-dependent predicates of the paper's sec. IV-C.
"""

from __future__ import annotations

from supermap_cli.relations.registry import RELATIONS

PREDICATES = RELATIONS.stored
