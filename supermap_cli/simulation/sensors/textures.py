"""The patterns of materials as tiles that repeat without a seam, in halving resolutions (Williams 1983, mip maps)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from supermap_cli.geometry.arrays import Float32Array, FloatArray, Int32Array
from supermap_cli.simulation.world import Pattern

SIDE = 512  # texels of a tile's side
LEVELS = 9  # halving resolutions
_BITS = SIDE.bit_length() - 1
_CELLS: dict[Pattern, int] = {"plain": 16, "speckle": 16, "stripes": 16, "checks": 16, "grain": 16, "print": 8}
_SEED = 20_240_229  # of the patterns: the same in every world


def texels_a_cell(pattern: Pattern) -> int:
    """How many texels one `scale_m` of a pattern is wide; a tile holds a whole number of cells."""
    return SIDE // _CELLS[pattern]


@dataclass(frozen=True)
class Atlas:
    """All tiles at all levels in one row of texels, (n,) uint32: red, green, blue as bytes, 128 = as the material is.

    `patterns` are in the order of their tiles; `starts` (patterns * LEVELS,) is where each tile of each level begins.
    """

    texels: NDArray[np.uint32]
    patterns: tuple[Pattern, ...]
    starts: Int32Array

    def look_up(self, pattern: Int32Array, level: Int32Array, across: Int32Array, along: Int32Array) -> Float32Array:
        """(3, n) float32 in [-1, 1] at whole texels of the finest level, `level` in 0..LEVELS - 1."""
        at = self.starts.take(pattern * LEVELS + level)
        at += (across & (SIDE - 1)) >> level
        at += ((along & (SIDE - 1)) >> level) << (_BITS - level)
        found = self.texels.take(at, mode="clip").view(np.uint8).reshape(-1, 4)
        values = np.empty((3, len(found)), np.float32)
        for channel in range(3):
            values[channel] = found[:, channel]
        values -= 128
        values /= 127
        return values


@cache
def atlas() -> Atlas:
    """The atlas, drawn once; always the same."""
    rng = np.random.default_rng(_SEED)
    texels, starts, begin = [], [], 0
    for pattern in _CELLS:
        tile = np.clip(_DRAW[pattern](rng, texels_a_cell(pattern)), -1, 1)
        for _ in range(LEVELS):
            starts.append(begin)
            texels.append(_packed(tile))
            begin += len(texels[-1])
            tile = (tile[:, ::2, ::2] + tile[:, 1::2, ::2] + tile[:, ::2, 1::2] + tile[:, 1::2, 1::2]) / 4
    return Atlas(np.concatenate(texels), tuple(_CELLS), np.array(starts, np.int32))


def _packed(tile: FloatArray) -> NDArray[np.uint32]:
    """(3, side, side) values in [-1, 1] -> (side * side,) texels."""
    rgbx = np.full((tile[0].size, 4), 128, np.uint8)
    rgbx[:, :3] = np.round(tile * 127 + 128).reshape(3, -1).T
    packed: NDArray[np.uint32] = rgbx.view(np.uint32).ravel()
    return packed


def _noise(rng: np.random.Generator, blur_across: float, blur_along: float) -> FloatArray:
    """(SIDE, SIDE) white noise under a periodic Gaussian blur of these standard deviations in texels, of variance 1."""
    k = 2 * np.pi * np.fft.fftfreq(SIDE)
    low_pass = np.exp(-0.5 * ((k[:, None] * blur_along) ** 2 + (k[None, :] * blur_across) ** 2))
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((SIDE, SIDE))) * low_pass).real
    noise -= noise.mean()
    blurred: FloatArray = noise / noise.std()
    return blurred


def _grey(values: FloatArray) -> FloatArray:
    return np.broadcast_to(values, (3, SIDE, SIDE))


def _plain(_rng: np.random.Generator, _cell: int) -> FloatArray:
    return np.zeros((3, SIDE, SIDE))


def _speckle(rng: np.random.Generator, cell: int) -> FloatArray:
    """Fine grains on coarse clouds, with a little colour of their own."""
    tinted = np.stack([_noise(rng, 1.0, 1.0) for _ in range(3)])
    return 0.35 * _noise(rng, 1.0, 1.0) + 0.2 * _noise(rng, cell / 4, cell / 4) + 0.07 * tinted


def _stripes(rng: np.random.Generator, cell: int) -> FloatArray:
    """A stripe each cell, every fourth one broader, on woven threads."""
    at = np.arange(SIDE) / cell
    broad = np.where(np.floor(at) % 4 == 0, 0.7, 0.4)
    stripes = np.where(at % 1 < broad, -0.8, 0.6)
    return _grey(stripes[None, :] + 0.1 * _noise(rng, 0.7, 3.0))


def _checks(rng: np.random.Generator, cell: int) -> FloatArray:
    """Tiles of two shades with dark joints; no two tiles quite alike."""
    row, column = np.mgrid[0:SIDE, 0:SIDE]
    shades = np.kron(rng.normal(0, 0.12, (SIDE // cell, SIDE // cell)), np.ones((cell, cell)))
    tiles = np.where((row // cell + column // cell) % 2 == 0, 0.5, -0.4) + shades
    return _grey(np.where((row % cell < 1) | (column % cell < 1), -0.9, tiles) + 0.05 * _noise(rng, 1.0, 1.0))


def _grain(rng: np.random.Generator, cell: int) -> FloatArray:
    """Year rings that run along, bent by slow noise, and fibres."""
    bend = 0.35 * _noise(rng, cell / 2, cell * 4)
    rings = np.sin(2 * np.pi * (np.arange(SIDE)[None, :] / cell + bend))
    return _grey(0.4 * rings + 0.3 * _noise(rng, 0.8, cell) + 0.15 * _noise(rng, cell, cell * 6))


def _print(rng: np.random.Generator, cell: int) -> FloatArray:
    """Pages, one a cell: some of text in lines, some of pictures, bright or dark; a page's margin is light."""
    tile = np.full((3, SIDE, SIDE), 0.6)
    margin = cell // 10
    for row in range(0, SIDE, cell):
        for column in range(0, SIDE, cell):
            page = tile[:, row + margin : row + cell - margin, column + margin : column + cell - margin]
            _draw_picture(rng, page) if rng.random() < 0.5 else _draw_text(rng, page)
    return tile


def _draw_text(rng: np.random.Generator, page: FloatArray) -> None:
    """Words of random length on lines three texels apart; paragraphs end short of the margin."""
    width = page.shape[2]
    for line in range(1, page.shape[1] - 1, 3):
        at, end = 0, width if rng.random() < 0.8 else int(width * rng.random())
        while at < end:
            word = int(rng.integers(2, 9))
            page[:, line : line + 2, at : min(at + word, end)] = rng.uniform(-0.9, -0.5)
            at += word + 1


def _draw_picture(rng: np.random.Generator, page: FloatArray) -> None:
    """A coloured ground with a few coloured discs and bars on it."""
    height, width = page.shape[1:]
    row, column = np.mgrid[0:height, 0:width]
    page[:] = rng.uniform(-1, 1, (3, 1, 1)) + np.linspace(-0.2, 0.2, height)[None, :, None]
    for _ in range(int(rng.integers(3, 8))):
        v, u, size = rng.uniform(0, height), rng.uniform(0, width), rng.uniform(0.08, 0.35) * width
        round_one = rng.random() < 0.5
        inside = (
            np.hypot(row - v, column - u) < size if round_one else (abs(row - v) < size / 3) & (abs(column - u) < size)
        )
        page[:, inside] = rng.uniform(-1, 1, (3, 1))


_DRAW: dict[Pattern, Callable[[np.random.Generator, int], FloatArray]] = {
    "plain": _plain,
    "speckle": _speckle,
    "stripes": _stripes,
    "checks": _checks,
    "grain": _grain,
    "print": _print,
}
