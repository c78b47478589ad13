"""Texts on pictures: any label is shown as it is, never as markup, in fonts that have its letters."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from supermap_cli.printable import printable_line

LONGEST = 60
"""Letters of a text on a picture; a longer one is cut."""
_FONTS = (
    "DejaVu Sans",
    "Noto Sans CJK SC",
    "Noto Sans CJK JP",
    "WenQuanYi Zen Hei",
    "Droid Sans Fallback",
    "Noto Sans",
)
"""Fonts that are looked through for a letter, as far as they are installed; the first comes with matplotlib."""


def plain(text: str) -> str:
    """One line without control characters, cut where it is long. Draw it with `parse_math=False`: `$` is no markup."""
    line = printable_line(text)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


@contextmanager
def figure_style() -> Iterator[None]:
    """How pictures are drawn: installed fonts, text in SVG as text, the same file for the same map.

    A letter that no installed font has is an empty box, without a warning for each.
    """
    from matplotlib import rc_context  # noqa: PLC0415 - keeps start-up light

    style: Any = {
        "font.family": list(_installed_fonts()),
        "svg.fonttype": "none",
        "svg.hashsalt": "supermap",
        "text.parse_math": False,
    }
    with rc_context(style), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        yield


@cache
def _installed_fonts() -> tuple[str, ...]:
    from matplotlib.font_manager import fontManager  # noqa: PLC0415 - keeps start-up light

    installed = {font.name for font in fontManager.ttflist}
    return tuple(name for name in _FONTS if name in installed) or ("sans-serif",)
