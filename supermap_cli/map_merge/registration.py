"""Registers another map in this one by the structure in their stored depth images."""

from __future__ import annotations

import numpy as np

from supermap_cli.errors import AlignmentError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.mapping.alignment import align, parse_placement
from supermap_cli.mapping.structure import CoarseDepth, stored_depth
from supermap_cli.memory.store import MapStore
from supermap_cli.stages.map_registration import Placement, describe_alignment

SAMPLED_KEYFRAMES = 40
"""Stored depth images used of each map, evenly spread; tuned on merges of simulated offices."""


def register_map(store: MapStore, other: MapStore, mode: str) -> Placement:
    """Find `T_map_other`; both maps are level. `mode` is "auto", "none" (one common frame) or "x y z yaw_deg".

    Raises `AlignmentError` if registration fails, is ambiguous, or the mode is not understood.
    """
    if mode == "none":
        return Placement(np.eye(4), "taken to have one frame")
    if mode != "auto":
        return Placement(parse_placement(mode, np.eye(4)), f"given: {mode}")
    odom, other_odom = (map_.traversals()[end].T_map_odom for map_, end in ((store, -1), (other, 0)))
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
    """Coarse depth images evenly spread over a map's keyframes; only these are decoded."""
    count = sum(traversal.keyframes for traversal in store.traversals())
    chosen = set(np.linspace(0, count - 1, min(count, SAMPLED_KEYFRAMES)).round().astype(int).tolist())
    return [stored_depth(record) for k, record in enumerate(store.keyframe_depths()) if k in chosen]
