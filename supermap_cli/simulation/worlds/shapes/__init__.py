"""Procedural shapes of indoor things, by label: real-world sizes, drawn at random."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from supermap_cli.simulation.world import Shape
from supermap_cli.simulation.worlds.shapes.cleaning import bucket, safety_sign, trash_can
from supermap_cli.simulation.worlds.shapes.decor import book, potted_plant, vase
from supermap_cli.simulation.worlds.shapes.electronics import (
    cell_phone,
    keyboard,
    lamp,
    laptop,
    monitor,
    mouse,
    printer,
    tv,
)
from supermap_cli.simulation.worlds.shapes.kitchen import bottle, bowl, microwave, mug, refrigerator
from supermap_cli.simulation.worlds.shapes.luggage import backpack, handbag, suitcase
from supermap_cli.simulation.worlds.shapes.seating import armchair, chair, couch, stool
from supermap_cli.simulation.worlds.shapes.storage import bookshelf, cabinet, cardboard_box, cart
from supermap_cli.simulation.worlds.shapes.tables import desk, table
from supermap_cli.simulation.worlds.shapes.wall_things import clock, fire_extinguisher, painting, whiteboard

Builder = Callable[[np.random.Generator], Shape]

_STANDING: Mapping[str, Builder] = {
    "armchair": armchair,
    "backpack": backpack,
    "book": book,
    "bookshelf": bookshelf,
    "bottle": bottle,
    "bowl": bowl,
    "bucket": bucket,
    "cabinet": cabinet,
    "cardboard box": cardboard_box,
    "cart": cart,
    "cell phone": cell_phone,
    "chair": chair,
    "couch": couch,
    "desk": desk,
    "handbag": handbag,
    "keyboard": keyboard,
    "lamp": lamp,
    "laptop": laptop,
    "microwave": microwave,
    "monitor": monitor,
    "mouse": mouse,
    "mug": mug,
    "potted plant": potted_plant,
    "printer": printer,
    "refrigerator": refrigerator,
    "safety sign": safety_sign,
    "stool": stool,
    "suitcase": suitcase,
    "table": table,
    "trash can": trash_can,
    "vase": vase,
}
_HANGING: Mapping[str, Builder] = {
    "clock": clock,
    "fire extinguisher": fire_extinguisher,
    "painting": painting,
    "tv": tv,
    "whiteboard": whiteboard,
}

LABELS: tuple[str, ...] = tuple(sorted({**_STANDING, **_HANGING}))
"""All labels that `build_shape` knows; people are made elsewhere."""

HANGING_LABELS: frozenset[str] = frozenset(_HANGING)
"""Those that hang on walls: the middle of their back side's lower edge is the origin."""


def build_shape(label: str, rng: np.random.Generator) -> Shape:
    """A thing of a label in its own frame (see `simulation.world`). Raises `KeyError` for an unknown label."""
    builder = _HANGING.get(label) or _STANDING[label]
    shape = builder(rng)
    low, high = shape.bounds
    middle = (low + high) / 2
    back_or_middle = high[1] if label in _HANGING else middle[1]
    origin = np.array([middle[0], back_or_middle, low[2]])
    return Shape(shape.vertices - origin, shape.triangles, shape.material, shape.materials)
