"""Where one memory stands in another: by its structure, as the stored depth images show it."""

from __future__ import annotations

import numpy as np

from supermap_cli.building.placing import Placement, describe_alignment
from supermap_cli.errors import AlignmentError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.mapping.alignment import align, placed_by_hand
from supermap_cli.mapping.structure import CoarseDepth, stored_depth
from supermap_cli.memory.store import MapStore

SAMPLED_KEYFRAMES = 40
"""Stored depth images, spread over each memory, by which they are laid over one another."""


def place_memory(store: MapStore, other: MapStore, wish: str) -> Placement:
    """Find `T_map_other`; both maps are level. `wish` is "auto", "none" (they have one frame), or "x y z yaw_deg".

    Raises `AlignmentError` if there is no such place, or more than one, or the wish is not understood.
    """
    if wish == "none":
        return Placement(np.eye(4), "taken to have one frame")
    if wish != "auto":
        return Placement(placed_by_hand(wish, np.eye(4)), f"given: {wish}")
    odom, other_odom = (each.traversals()[end].T_map_odom for each, end in ((store, -1), (other, 0)))
    try:
        found = align(_spread_views(store), _spread_views(other), np.eye(4), [odom @ inverse(other_odom)])
    except AlignmentError as error:
        raise AlignmentError(
            f"the two maps cannot be laid over one another: {error.what}",
            where=other.where,
            cure="give the place of its origin with --align 'x y z yaw_deg', or --align none if they have one frame",
        ) from error
    return Placement(found.T_map_odom, describe_alignment(found))


def _spread_views(store: MapStore) -> list[CoarseDepth]:
    """Coarse depth images of a memory, evenly spread over its keyframes; only these are decoded."""
    count = sum(each.keyframes for each in store.traversals())
    chosen = set(np.linspace(0, count - 1, min(count, SAMPLED_KEYFRAMES)).round().astype(int).tolist())
    return [stored_depth(record) for k, record in enumerate(store.keyframe_depths()) if k in chosen]
