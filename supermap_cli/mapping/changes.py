"""What the map has changed since it was last written."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

from supermap_cli.mapping.belief import LabelBelief
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
class PendingChanges:
    """Collected while keyframes are mapped, drained into one `MapDelta` a batch."""

    dirty: set[int] = field(default_factory=set)
    observations: list[Observation] = field(default_factory=list)
    closed_states: list[StateRecord] = field(default_factory=list)
    temporal_edges: list[TemporalEdge] = field(default_factory=list)
    merged: list[InstanceRecord] = field(default_factory=list)

    def drain(self, objects: ObjectMap) -> MapDelta:
        """Everything changed, as values; what is tentative still stays out."""
        numbers = [number for number in sorted(self.dirty) if number in objects.by_number]
        changed = [objects[number] for number in numbers if objects[number].confirmed]
        states = self.closed_states + [open_state(obj) for obj in changed if obj.present]
        latest = {(state.object_number, state.index): state for state in states}
        delta = MapDelta(
            observations=tuple(self.observations),
            instances=tuple(instance_record(obj) for obj in changed) + tuple(self.merged),
            states=tuple(latest[key] for key in sorted(latest)),
            visits=tuple(visit_record(obj) for obj in changed),
            temporal_edges=tuple(self.temporal_edges),
        )
        self.dirty, self.observations, self.closed_states = set(), [], []
        self.temporal_edges, self.merged = [], []
        return delta


def open_state(obj: MapObject, gone_ns: int | None = None) -> StateRecord:
    """The state an object is in, as it is known now."""
    shape = obj.shape
    return StateRecord(
        obj.number,
        obj.state.index,
        obj.state.first_seen_ns,
        obj.last_seen_ns,
        gone_ns,
        obj.state.empty_before_ns,
        shape.box.center,
        shape.box,
        obj.label,
        obj.confidence,
    )


def visit_record(obj: MapObject) -> Visit:
    """How often this traversal looked at an object."""
    count = obj.visit
    return Visit(
        obj.number,
        count.supported,
        count.in_view,
        count.contradicted,
        count.first_support_ns,
        count.last_support_ns,
    )


def _words_of(labels: LabelBelief) -> dict[str, dict[str, float]]:
    """The label counts of each detector; none where no detector is known, for then all counts are of one."""
    if not any(labels.by_detector):
        return {}
    return {name: dict(sorted(counts.items())) for name, counts in sorted(labels.by_detector.items())}


def instance_record(obj: MapObject, merged_into: int | None = None) -> InstanceRecord:
    """A confirmed object as the memory keeps it."""
    return InstanceRecord(
        number=obj.number,
        label=obj.label,
        label_belief=obj.labels.probabilities(),
        existence_log_odds=obj.existence_log_odds,
        presence="doubted" if obj.demoted else "present" if obj.present else "absent",
        first_seen_ns=obj.first_seen_ns,
        last_seen_ns=obj.last_seen_ns,
        centroid_map=obj.shape.box.center,
        box=obj.shape.box,
        voxels=obj.voxels.to_cloud(),
        observations=obj.observations,
        merged_into=merged_into,
        engine_state=EngineState(
            label_counts=obj.labels.counts,
            label_weight=obj.labels.weight,
            viewpoints={name: astuple(cell) for name, cell in obj.existence.viewpoints.cells.items()},
            state_index=obj.state.index,
            state_first_seen_ns=obj.state.first_seen_ns,
            state_empty_before_ns=obj.state.empty_before_ns,
            gone_ns=obj.gone_ns,
            best_crop=obj.best_crop,
            seen_apart={str(number): images for number, images in sorted(obj.seen_apart.items())},
            words=_words_of(obj.labels),
            log_odds_by_views=obj.existence.log_odds,
            relief={label: (looks.flat, looks.raised) for label, looks in sorted(obj.relief.items())},
            found_by={name: (looks.found, looks.missed) for name, looks in sorted(obj.found_by.items())},
        ).to_document(),
    )
