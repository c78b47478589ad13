"""Files that reports are written to."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.errors import SupermapError


def write_file(path: Path, content: str | bytes) -> None:
    """Write a whole file, and its folder where there is none. Raises `SupermapError` where that is not possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        what = f"it cannot be written: {error.strerror or error}"
        raise SupermapError(what, where=str(path), cure="name another file, or make room") from error
