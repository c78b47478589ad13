"""Colours of things: the same label has the same colour in every picture and every export, on every machine."""

from __future__ import annotations

import colorsys
from functools import lru_cache
from zlib import crc32

Rgb = tuple[int, int, int]
"""Red, green and blue, 0 to 255 each, sRGB."""

_HUES = 360
_LIGHTNESS = (0.38, 0.46, 0.54)
_SATURATION = 0.62
"""Dark enough to be read on white, light enough to tell the hue."""


@lru_cache(maxsize=4096)
def colour_of(name: str) -> Rgb:
    """The colour of a label or an id, by its CRC-32: nothing is to be remembered, and none depends on the others."""
    code = crc32(name.casefold().encode("utf-8", "surrogatepass"))
    lightness = _LIGHTNESS[code // _HUES % len(_LIGHTNESS)]
    red, green, blue = colorsys.hls_to_rgb(code % _HUES / _HUES, lightness, _SATURATION)
    return round(255 * red), round(255 * green), round(255 * blue)


def hex_of(rgb: Rgb) -> str:
    """A colour as `#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)
