"""Writing of report files."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.errors import SupermapError


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file, creating its folder. Raises `SupermapError` if that fails."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        what = f"it cannot be written: {error.strerror or error}"
        raise SupermapError(what, where=str(path), cure="name another file, or make room") from error
