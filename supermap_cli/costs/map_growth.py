"""Fills a map up with copies of what is in it, laid out as further rooms of a bigger building."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.store import MapStore
from supermap_cli.types.memory import InstanceRecord, MapDelta, SpatialEdge, StateRecord

_GRID_M = 64.0
"""A multiple of every voxel's edge, so that a copy's voxels are those of its model."""
_ROOMS_IN_A_ROW = 8


def fill(store: MapStore, traversal_id: int, wanted: int, reach_m: float) -> None:
    """Copy all present objects, with their states and relations, until `wanted` are in the map.

    Every set of copies lies a room of its own away, farther than `reach_m` from everything else.
    """
    known = [instance for instance in store.load_instances() if instance.presence == "present"]
    states = {state.object_number: state for state in store.load_open_states()}
    edges = store.load_spatial_edges()
    missing, number = wanted - len(known), store.next_object_number()
    room_m = _room_m(known, reach_m)
    room = 0
    while missing > 0 and known:
        room += 1
        offset = room_m * np.array([room // _ROOMS_IN_A_ROW, room % _ROOMS_IN_A_ROW, 0])
        chosen = known[:missing]
        numbers = {instance.number: number + i for i, instance in enumerate(chosen)}
        store.commit(
            traversal_id,
            MapDelta(
                instances=tuple(_copied(instance, numbers[instance.number], offset) for instance in chosen),
                states=tuple(
                    _moved(states[instance.number], numbers, offset) for instance in chosen if instance.number in states
                ),
                spatial_edges=tuple(_between(edges, numbers)),
            ),
        )
        missing, number = missing - len(chosen), number + len(chosen)


def _room_m(known: Sequence[InstanceRecord], reach_m: float) -> float:
    centers = np.array([instance.centroid_map for instance in known]).reshape(-1, 3)
    spread_m = float(np.ptp(centers, axis=0).max()) if len(centers) else 0.0
    return _GRID_M * math.ceil((spread_m + 4 * reach_m) / _GRID_M)


def _copied(model: InstanceRecord, number: int, offset_m: FloatArray) -> InstanceRecord:
    steps = np.rint(offset_m / model.voxels.voxel_m).astype(np.int32)
    return replace(
        model,
        number=number,
        centroid_map=model.centroid_map + offset_m,
        box=_shifted(model.box, offset_m),
        voxels=replace(model.voxels, keys=model.voxels.keys + steps),
    )


def _moved(state: StateRecord, numbers: dict[int, int], offset_m: FloatArray) -> StateRecord:
    return replace(
        state,
        object_number=numbers[state.object_number],
        index=0,
        centroid_map=state.centroid_map + offset_m,
        box=_shifted(state.box, offset_m),
    )


def _between(edges: Sequence[SpatialEdge], numbers: dict[int, int]) -> list[SpatialEdge]:
    return [
        replace(edge, subject=numbers[edge.subject], object=numbers[edge.object])
        for edge in edges
        if edge.subject in numbers and edge.object in numbers
    ]


def _shifted(box: Box3D, offset_m: FloatArray) -> Box3D:
    return Box3D(box.center + offset_m, box.size, box.yaw)
