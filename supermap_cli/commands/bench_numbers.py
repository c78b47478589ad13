"""Numbers of objects, as they are written on the command line."""

from __future__ import annotations

from supermap_cli.commands.whole_numbers import is_whole
from supermap_cli.errors import ConfigError


def parse_objects(text: str | None, option: str = "--objects", example: str = "40,400") -> tuple[int, ...]:
    """`"40,400"` -> (40, 400). Raises `ConfigError` for anything else."""
    parts = [part.strip() for part in text.split(",")] if text is not None else []
    if not all(is_whole(part) and int(part) > 0 for part in parts):
        raise ConfigError(f"{option} {text!r} is not understood", cure=f"write {option} {example}")
    return tuple(dict.fromkeys(map(int, parts)))
