"""Readable names: an instance's text id ("dining-table-1") and a traversal's name ("monday")."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable
from pathlib import Path

from supermap_cli.errors import ConfigError
from supermap_cli.output_files import NAME_BYTES
from supermap_cli.printable import printable_line


def label_slug(label: str) -> str:
    """A label as the first part of a text id: lower case, words joined by hyphens."""
    return "-".join(re.findall(r"[^\W_]+", label.lower())) or "object"


_NO_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")
"""Control characters but tab and line ends, and what stands for bytes that are no UTF-8."""


def clean_text(text: str) -> str:
    """A text as it enters the map: valid UTF-8 without NUL and control characters, which become U+FFFD."""
    return _NO_TEXT.sub("\ufffd", text)


def checked_name(name: str) -> str:
    """A traversal's name that somebody gave. Raises `ConfigError` for one that is no line of text."""
    cure = "give a short name in letters, such as --name monday"
    if not name.strip():
        raise ConfigError("--name is empty", cure=cure)
    if printable_line(name) != name:
        raise ConfigError(f"--name {name!r} holds line ends or control characters", cure=cure)
    if len(name.encode()) > NAME_BYTES:
        raise ConfigError(f"--name {name[:20]!r}... has more than {NAME_BYTES} bytes", cure=cure)
    return name


class InstanceIds:
    """Assigns text ids: the label of an instance when it is first written, and a counter for each label."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._last: Counter[str] = Counter()
        for text_id in taken:
            slug, _, counter = text_id.rpartition("-")
            self._last[slug] = max(self._last[slug], int(counter))

    def next_id(self, label: str) -> str:
        """The next free id of a label."""
        slug = label_slug(label)
        self._last[slug] += 1
        return f"{slug}-{self._last[slug]}"


def traversal_name(recording: str, taken: Collection[str]) -> str:
    """A recording's name without folder and suffix, made unique by a counter ("monday", "monday-2")."""
    return unique_name(printable_line(Path(recording).stem) or "traversal", taken)


def unique_name(wanted: str, taken: Collection[str]) -> str:
    """A name, with a counter if it is taken."""
    name, counter = wanted, 1
    while name in taken:
        counter += 1
        name = f"{wanted}-{counter}"
    return name
