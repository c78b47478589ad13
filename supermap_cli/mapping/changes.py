"""What the map has changed since it was last written."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np

from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import (
    InstanceRecord,
    MapDelta,
    Observation,
    StateRecord,
    TemporalEdge,
    Visit,
)


@dataclass
class Changes:
    """Collected while keyframes are mapped, drained into one `MapDelta` a batch."""

    dirty: set[int] = field(default_factory=set)
    observations: list[Observation] = field(default_factory=list)
    closed_states: list[StateRecord] = field(default_factory=list)
    temporal_edges: list[TemporalEdge] = field(default_factory=list)
    merged: list[InstanceRecord] = field(default_factory=list)

    def drain(self, objects: ObjectMap) -> MapDelta:
        """Everything changed, as values; what is tentative still stays out."""
        changed = [objects[n] for n in sorted(self.dirty) if n in objects.by_number and objects[n].confirmed]
        states = self.closed_states + [open_state(each) for each in changed if each.present]
        latest = {(each.object_number, each.index): each for each in states}
        delta = MapDelta(
            observations=tuple(self.observations),
            instances=tuple(instance_record(each) for each in changed) + tuple(self.merged),
            states=tuple(latest[key] for key in sorted(latest)),
            visits=tuple(visit(each) for each in changed),
            temporal_edges=tuple(self.temporal_edges),
        )
        self.dirty, self.observations, self.closed_states = set(), [], []
        self.temporal_edges, self.merged = [], []
        return delta


def open_state(stands: MapObject, gone_ns: int | None = None) -> StateRecord:
    """The state an object is in, as it is known now."""
    shape = stands.shape
    return StateRecord(
        stands.number,
        stands.state.index,
        stands.state.first_seen_ns,
        stands.last_seen_ns,
        gone_ns,
        stands.state.empty_before_ns,
        shape.centroid,
        shape.box,
        stands.label,
        probability(stands.existence),
    )


def probability(log_odds: float) -> float:
    """The probability of log-odds."""
    return float(1 / (1 + np.exp(-log_odds)))


def visit(seen: MapObject) -> Visit:
    """How often this traversal looked at an object."""
    count = seen.visit
    return Visit(
        seen.number,
        count.supported,
        count.in_view,
        count.contradicted,
        count.first_support_ns,
        count.last_support_ns,
    )


def instance_record(known: MapObject, merged_into: int | None = None) -> InstanceRecord:
    """A confirmed object as the memory keeps it."""
    return InstanceRecord(
        number=known.number,
        label=known.label,
        label_belief=known.labels.probabilities(),
        existence_log_odds=known.existence,
        presence="doubted" if known.doubted else "present" if known.present else "absent",
        first_seen_ns=known.first_seen_ns,
        last_seen_ns=known.last_seen_ns,
        centroid_map=known.shape.centroid,
        box=known.shape.box,
        voxels=known.voxels.to_cloud(),
        observations=known.observations,
        merged_into=merged_into,
        engine_state=EngineState(
            label_logs=known.labels.logs,
            unseen_log=known.labels.unseen_log,
            looks=known.labels.looks,
            viewpoints={name: astuple(cell) for name, cell in known.viewpoints.cells.items()},
            state_index=known.state.index,
            state_first_seen_ns=known.state.first_seen_ns,
            state_empty_before_ns=known.state.empty_before_ns,
            gone_ns=known.gone_ns,
            best_crop=known.best_crop,
        ).to_document(),
    )
