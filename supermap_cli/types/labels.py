"""What labels say by themselves."""

from __future__ import annotations

DYNAMIC_CLASSES = frozenset({"person", "people", "pedestrian", "man", "woman", "child", "dog", "cat", "bird"})
"""Classes that move by themselves: one that stands still is no part of the room."""
