"""The colour of a thing by the eleven basic colour terms (Berlin and Kay, 1969), from the colours of its voxels.

Every solid voxel votes for the term whose typical colour is nearest by CIE94 (CIE 116-1995, the weights for textiles:
of lightness, which a shadow changes, half counts). The typical colours are those that 222,500 people gave these names
on screens (R. Munroe, Color Survey Results, 2010, the list of 954 names).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from supermap_cli.geometry.arrays import FloatArray, IntArray, UInt8Array
from supermap_cli.types.memory import VoxelCloud

TYPICAL_SRGB = {
    "black": ("000000",),
    "white": ("ffffff",),
    "grey": ("929591",),
    "red": ("840000", "e50000", "ff474c"),
    "green": ("033500", "15b01a", "96f97b"),
    "blue": ("00035b", "0343df", "95d0fc"),
    "yellow": ("d5b60a", "ffff14", "fffe7a"),
    "orange": ("c65102", "f97306", "fdaa48"),
    "brown": ("341c02", "653700", "ad8150"),
    "pink": ("cb416b", "ff81c0", "ffd1df"),
    "purple": ("35063e", "7e1e9c", "bf77f6"),
}
"""Typical colours of each term, sRGB in hexadecimal digits: what was called dark, plain, and light so (a dark grey
is half a black)."""

LIGHTNESS_WEIGHT, CHROMA_WEIGHT, HUE_WEIGHT = 2.0, 0.048, 0.014
"""kL, K1 and K2 of CIE94 for textiles."""

MIN_VOXELS = 20
"""Solid voxels from which a colour is told. Chosen."""
MIN_SHARE = 0.5
"""More than this share of the voxels has the thing's colour. Chosen: half of them."""
ALSO_SHARE = 0.2
"""Share of the voxels from which a colour is named beside another one. Chosen."""

MAY_BE_WHITE, MAY_BE_BLACK = 60.0, 40.0
"""Lightness (L*) from which, or up to which, a grey thing may be a white one in the shade, or a black one in the light.
Chosen: 20 from the borders of grey.
"""

_RGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE_D65 = np.array([0.95047, 1.0, 1.08883])
"""From linear sRGB to CIE XYZ, and its white (IEC 61966-2-1)."""


@dataclass(frozen=True)
class ColourReading:
    """A thing's colour: `name`, or `None` where no colour has most of it; `also` are all that have a good part of it,
    the largest first; `words` say it with the shares; `lightness` is its median CIELAB L*, 0-100.
    """

    name: str | None
    also: tuple[str, ...]
    words: str
    shares: dict[str, float]
    lightness: float = 50.0

    def may_be(self, name: str) -> bool:
        """Whether the light, or a good part of it, lets it be called so although another colour has most of it."""
        in_light = {"white": self.lightness >= MAY_BE_WHITE, "black": self.lightness <= MAY_BE_BLACK}
        grey = self.name == "grey" and in_light.get(name, False)
        return name in self.also or not self.also or grey


def read_colour(cloud: VoxelCloud) -> ColourReading:
    """The colour of a thing from its voxels."""
    solid = (cloud.log_odds > 0) & (cloud.inside >= cloud.outside)
    if np.count_nonzero(solid) < MIN_VOXELS:
        return ColourReading(None, (), "too little of it was seen to tell its colour", {})
    counts = np.bincount(nearest_terms(cloud.rgb[solid]), minlength=len(TYPICAL_SRGB))
    shares = {name: float(count) / counts.sum() for name, count in zip(TYPICAL_SRGB, counts, strict=True) if count}
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    also = tuple(name for name, share in ranked if share >= ALSO_SHARE) or (ranked[0][0],)
    words = " and ".join(f"{name} ({shares[name]:.0%})" for name in also)
    name = also[0] if shares[also[0]] > MIN_SHARE else None
    lightness = float(np.median(to_lab(cloud.rgb[solid].astype(np.float64))[:, 0]))
    return ColourReading(name, also, words if name else f"no one colour: {words}", dict(ranked), lightness)


def nearest_terms(rgb: UInt8Array) -> IntArray:
    """(n,) the index of the term nearest to each colour; `rgb` is (n, 3), sRGB 0-255."""
    lab, terms = to_lab(np.asarray(rgb, np.float64)), _typical_lab()
    lightness = (terms[None, :, 0] - lab[:, None, 0]) / LIGHTNESS_WEIGHT
    chroma, chromas = np.hypot(*lab[:, 1:].T)[:, None], np.hypot(*terms[:, 1:].T)[None, :]
    squared_ab = ((terms[None, :, 1:] - lab[:, None, 1:]) ** 2).sum(axis=2)
    squared_hue = np.maximum(squared_ab - (chromas - chroma) ** 2, 0.0)
    distance = (
        lightness**2
        + ((chromas - chroma) / (1 + CHROMA_WEIGHT * chromas)) ** 2
        + squared_hue / (1 + HUE_WEIGHT * chromas) ** 2
    )
    term_of_shade = np.repeat(np.arange(len(TYPICAL_SRGB)), [len(shades) for shades in TYPICAL_SRGB.values()])
    nearest: IntArray = term_of_shade[distance.argmin(axis=1)].astype(np.int64)
    return nearest


def to_lab(rgb: FloatArray) -> FloatArray:
    """(n, 3) CIELAB of sRGB colours (n, 3), 0-255."""
    share = rgb / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    xyz = linear @ _RGB_TO_XYZ.T / _WHITE_D65
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


@cache
def _typical_lab() -> FloatArray:
    shades = [list(bytes.fromhex(digits)) for of_term in TYPICAL_SRGB.values() for digits in of_term]
    return to_lab(np.array(shades, np.float64))
