"""Classes of labels."""

from __future__ import annotations

DYNAMIC_CLASSES = frozenset({"person", "people", "pedestrian", "man", "woman", "child", "dog", "cat", "bird"})
"""Labels of people and animals, which move by themselves: they are no part of the static map even while they stand
still.
"""
