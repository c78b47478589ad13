"""Grows a map to a number of objects by copies of its objects, laid out beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.store import MapStore
from supermap_cli.types.memory import InstanceRecord, MapDelta, SpatialEdge, StateRecord

_OFFSET_STEP_M = 64.0
"""Metres; a multiple of every voxel edge, so that a copy has the voxel grid of its original."""
_COPIES_PER_ROW = 8
"""Copies of the whole map beside each other along y before the next row begins."""


def fill_map(store: MapStore, traversal_id: int, target_count: int, reach_m: float) -> None:
    """Copy all present objects, with their states and relations, until `target_count` are in the map.

    Every set of copies lies farther than `reach_m` from everything else.
    """
    originals = [instance for instance in store.load_instances() if instance.presence == "present"]
    states = {state.object_number: state for state in store.load_open_states()}
    edges = store.load_spatial_edges()
    missing, number = target_count - len(originals), store.next_object_number()
    spacing_m = _spacing_m(originals, reach_m)
    copy = 0
    while missing > 0 and originals:
        copy += 1
        offset = spacing_m * np.array([copy // _COPIES_PER_ROW, copy % _COPIES_PER_ROW, 0])
        chosen = originals[:missing]
        numbers = {instance.number: number + index for index, instance in enumerate(chosen)}
        store.commit(
            traversal_id,
            MapDelta(
                instances=tuple(_copy_instance(instance, numbers[instance.number], offset) for instance in chosen),
                states=tuple(
                    _copy_state(states[instance.number], numbers, offset)
                    for instance in chosen
                    if instance.number in states
                ),
                spatial_edges=tuple(_copy_edges(edges, numbers)),
            ),
        )
        missing, number = missing - len(chosen), number + len(chosen)


def _spacing_m(originals: Sequence[InstanceRecord], reach_m: float) -> float:
    centers = np.array([instance.centroid_map for instance in originals]).reshape(-1, 3)
    spread_m = float(np.ptp(centers, axis=0).max()) if len(centers) else 0.0
    return _OFFSET_STEP_M * math.ceil((spread_m + 4 * reach_m) / _OFFSET_STEP_M)


def _copy_instance(original: InstanceRecord, number: int, offset_m: FloatArray) -> InstanceRecord:
    steps = np.rint(offset_m / original.voxels.voxel_m).astype(np.int32)
    return replace(
        original,
        number=number,
        centroid_map=original.centroid_map + offset_m,
        box=_shift_box(original.box, offset_m),
        voxels=replace(original.voxels, keys=original.voxels.keys + steps),
    )


def _copy_state(state: StateRecord, numbers: dict[int, int], offset_m: FloatArray) -> StateRecord:
    return replace(
        state,
        object_number=numbers[state.object_number],
        index=0,
        centroid_map=state.centroid_map + offset_m,
        box=_shift_box(state.box, offset_m),
    )


def _copy_edges(edges: Sequence[SpatialEdge], numbers: dict[int, int]) -> list[SpatialEdge]:
    return [
        replace(edge, subject=numbers[edge.subject], object=numbers[edge.object])
        for edge in edges
        if edge.subject in numbers and edge.object in numbers
    ]


def _shift_box(box: Box3D, offset_m: FloatArray) -> Box3D:
    return Box3D(box.center + offset_m, box.size, box.yaw)
