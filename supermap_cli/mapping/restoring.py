"""From what the memory kept back to a map that can be built on."""

from __future__ import annotations

from collections.abc import Iterable

from supermap_cli.mapping.belief import Existence, LabelBelief, ViewpointCell, ViewpointHistory
from supermap_cli.mapping.objects import (
    DEFAULT_SETS,
    MapObject,
    ObjectMap,
    ObjectParameterSets,
    ObjectStatus,
    OpenState,
    VisitCount,
)
from supermap_cli.mapping.recall import FoundBy
from supermap_cli.mapping.relief import ReliefLooks
from supermap_cli.mapping.voxel_map import voxel_map_from_cloud
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import InstanceRecord


def restore_objects(
    instances: Iterable[InstanceRecord], next_number: int, parameters: ObjectParameterSets = DEFAULT_SETS
) -> ObjectMap:
    """The objects of an earlier build; what this traversal sees of them is counted from zero, and so are the pictures
    that are kept: each traversal has its own.
    """
    objects = ObjectMap(next_number, parameters=parameters)
    for instance in instances:
        if instance.merged_into is None:
            restored = restore_object(instance)
            restored.best_crop = 0.0
            objects.add(restored)
    return objects


def restore_object(instance: InstanceRecord) -> MapObject:
    """One object as it was when it was last written. Raises `MemoryStoreError` if its engine state is damaged."""
    state = EngineState.of(instance.engine_state)
    words = {name: dict(counts) for name, counts in state.words.items()} or {"": dict(state.label_counts)}
    by_views = state.log_odds_by_views
    cells = {name: ViewpointCell(*cell) for name, cell in state.viewpoints.items()}
    return MapObject(
        instance.number,
        voxel_map_from_cloud(instance.voxels),
        LabelBelief(dict(state.label_counts), state.label_weight, float(instance.box.size.max()), by_detector=words),
        Existence(instance.existence_log_odds if by_views is None else by_views, ViewpointHistory(cells)),
        OpenState(state.state_index, state.state_first_seen_ns, state.state_empty_before_ns),
        instance.first_seen_ns,
        instance.last_seen_ns,
        instance.observations,
        ObjectStatus(
            confirmed=True,
            stored=True,
            demoted=instance.presence == "doubted",
            present=instance.presence != "absent" and state.gone_ns is None,
            gone_ns=state.gone_ns,
        ),
        visit=VisitCount(earlier_ns=instance.last_seen_ns),
        best_crop=state.best_crop,
        seen_apart={int(number): images for number, images in state.seen_apart.items()},
        relief={label: ReliefLooks(*looks) for label, looks in state.relief.items()},
        found_by={name: FoundBy(*looks) for name, looks in state.found_by.items()},
    )
