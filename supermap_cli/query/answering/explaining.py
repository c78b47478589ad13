"""A typed question as text: its tree without what was not said."""

from __future__ import annotations

from dataclasses import fields, is_dataclass


def tree_text(value: object) -> str:
    """A part of a typed question as it would be written in Python, without fields that have their default."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(tree_text, value))}]"
    if not is_dataclass(value) or isinstance(value, type):
        return repr(value)
    named = [(each.name, getattr(value, each.name), each.default) for each in fields(value)]
    said = [f"{name}={tree_text(content)}" for name, content, default in named if content != default]
    return f"{type(value).__name__}({', '.join(said)})"
