"""What was corrected or left out, collected while a recording is read."""

from __future__ import annotations


class Notes:
    """Warnings by key, one line each: noting a key again replaces its line, so that a stream may be read twice."""

    def __init__(self) -> None:
        self._lines: dict[str, str] = {}

    def note(self, key: str, line: str) -> None:
        """Keep one line under `key`."""
        self._lines[key] = " ".join(line.split())

    def take(self, other: Notes) -> None:
        """Keep all lines of another collection too."""
        self._lines.update(other._lines)

    @property
    def lines(self) -> tuple[str, ...]:
        """All lines in the order of their first note."""
        return tuple(self._lines.values())
