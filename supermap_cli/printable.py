"""Texts from recordings and maps on terminals and in logs, where control characters would act."""

from __future__ import annotations

import re

_ACTS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ufff9-\ufffb\ud800-\udfff]")
"""Control characters (ANSI sequences begin with one), overrides and isolates of direction, line breaks."""


def printable(text: str) -> str:
    """The text with what would act on a terminal spelt out by its code; tabs and line feeds stay."""
    return _ACTS.sub(lambda found: _spelt(found[0]), text)


def printable_line(text: str) -> str:
    """As `printable`, and on one line."""
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")


def printable_paragraph(text: str) -> str:
    """As `printable_line`, with the empty lines before and after it that set it apart."""
    line = text.strip("\n")
    start = text.index(line)
    return text[:start] + printable_line(line) + text[start + len(line) :]


def _spelt(letter: str) -> str:
    code = ord(letter)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
