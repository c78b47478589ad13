"""The detector of a traversal: what it misses and how it calls things is its own, not the world's."""

from __future__ import annotations

import json
from collections.abc import Mapping

from supermap_cli.memory.values import StoredTraversal

MIN_TRIALS = 5.0
"""Looks at things of a class from which a detector's rate for it is told. Chosen: fewer say little."""


def detector_of(traversal: StoredTraversal) -> str:
    """The identity of a traversal's detector, equal for detectors that err alike; empty if nobody knows.

    Traversals of older versions name the plugin and its options instead.
    """
    config = traversal.config
    if (identity := config.get("detector")) is not None:
        return str(identity)
    used, backends = config.get("used"), config.get("backends")
    name = used.get("detector") if isinstance(used, Mapping) else None
    if name is None:
        return ""
    options = backends.get("options") if isinstance(backends, Mapping) else None
    own = options.get(name) if isinstance(options, Mapping) else None
    return f"{name} {json.dumps(own, sort_keys=True)}" if own else str(name)


def recall_of(traversal: StoredTraversal, label: str) -> float | None:
    """The share of the things of a class in view that a traversal's detector found; `None` where it saw too few."""
    recall = traversal.config.get("detector_recall")
    counts = recall.get(label) if isinstance(recall, Mapping) else None
    if not isinstance(counts, list) or len(counts) != 2 or counts[1] < MIN_TRIALS:
        return None
    return float(counts[0]) / float(counts[1])
