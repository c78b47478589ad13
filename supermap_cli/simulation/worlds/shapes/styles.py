"""Other shapes of things than those that a label has by itself, by label and style."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from supermap_cli.simulation.world import Shape
from supermap_cli.simulation.worlds.shapes import containers, glass, hung, leaning, overhanging, thin
from supermap_cli.simulation.worlds.shapes.containers import Builder

_STYLES: Mapping[tuple[str, str], Builder] = {
    ("table", "thin"): thin.thin_table,
    ("stool", "thin"): thin.thin_stool,
    ("chair", "thin"): thin.thin_chair,
    ("bookshelf", "thin"): thin.wire_shelf,
    ("lamp", "thin"): thin.tripod_lamp,
    ("clothes rack", "thin"): thin.clothes_rack,
    ("table", "overhanging"): overhanging.pedestal_table,
    ("desk", "overhanging"): overhanging.cantilever_desk,
    ("stool", "overhanging"): overhanging.bar_stool,
    ("lamp", "overhanging"): overhanging.arc_lamp,
    ("board", "leaning"): leaning.leaning_board,
    ("broom", "leaning"): leaning.broom,
    ("suitcase", "leaning"): leaning.tilted_suitcase,
    ("painting", "leaning"): leaning.leaning_painting,
    ("ladder", "leaning"): leaning.ladder,
    **{("cardboard box", f"closed {size}"): containers.closed_box(size) for size in ("large", "medium", "small")},
    **{("book", f"lying {size}"): containers.lying_book(size) for size in ("large", "medium", "small")},
    ("basket", "open"): containers.basket,
    ("trash can", "outer"): containers.square_bin("outer"),
    ("trash can", "inner"): containers.square_bin("inner"),
    ("lamp", "hung"): hung.ceiling_lamp,
    ("potted plant", "hung"): hung.hanging_plant,
    ("coat", "hung"): hung.coat,
    ("table", "glass"): glass.glass_table,
    ("cabinet", "glass"): glass.vitrine,
}
STYLES: tuple[tuple[str, str], ...] = tuple(_STYLES)
"""All labels and styles that `build_styled` knows."""

_ON_WALLS = {("coat", "hung")}


def build_styled(label: str, style: str, rng: np.random.Generator) -> Shape:
    """A thing in its own frame, its origin as in `build_shape`. Raises `KeyError` for an unknown style."""
    shape = _STYLES[label, style](rng)
    low, high = shape.bounds
    middle = (low + high) / 2
    origin = np.array([middle[0], high[1] if (label, style) in _ON_WALLS else middle[1], low[2]])
    return Shape(shape.vertices - origin, shape.triangles, shape.material, shape.materials)
