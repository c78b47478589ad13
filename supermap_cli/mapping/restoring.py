"""From what the memory kept back to a map that can be built on."""

from __future__ import annotations

from collections.abc import Iterable

from supermap_cli.mapping.belief import Cell, LabelBelief, Viewpoints
from supermap_cli.mapping.objects import MapObject, ObjectMap, OpenState
from supermap_cli.mapping.voxel_map import voxel_map_from_cloud
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import InstanceRecord


def restore_objects(instances: Iterable[InstanceRecord], next_number: int) -> ObjectMap:
    """The objects of an earlier build; what this traversal sees of them is counted from zero, and so are the pictures
    that are kept: each traversal has its own.
    """
    objects = ObjectMap(next_number)
    for instance in instances:
        if instance.merged_into is None:
            restored = restore_object(instance)
            restored.best_crop = 0.0
            objects.add(restored)
    return objects


def restore_object(instance: InstanceRecord) -> MapObject:
    """One object as it was when it was last written. Raises `MemoryStoreError` if its engine state is damaged."""
    state = EngineState.of(instance.engine_state)
    return MapObject(
        instance.number,
        voxel_map_from_cloud(instance.voxels),
        LabelBelief(dict(state.label_logs), state.unseen_log, state.looks, float(instance.box.size.max())),
        instance.first_seen_ns,
        instance.last_seen_ns,
        instance.existence_log_odds,
        OpenState(state.state_index, state.state_first_seen_ns, state.state_empty_before_ns),
        confirmed=True,
        entered=True,
        present=instance.presence != "absent",
        doubted=instance.presence == "doubted",
        gone_ns=state.gone_ns,
        observations=instance.observations,
        before_visit_ns=instance.last_seen_ns,
        viewpoints=Viewpoints({name: Cell(*cell) for name, cell in state.viewpoints.items()}),
        best_crop=state.best_crop,
    )
