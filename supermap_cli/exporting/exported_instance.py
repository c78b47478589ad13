"""An instance as it is exported: as believed today, or as of a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.values import LabelledObservation, StoredInstance, StoredVisit
from supermap_cli.query.instance_at import label_at
from supermap_cli.query.label_consensus import label_shares
from supermap_cli.query.presence_at import PresenceAt, PresenceValue
from supermap_cli.types.existence import log_odds_of
from supermap_cli.types.memory import Presence, StateRecord


@dataclass(frozen=True)
class ExportedInstance:
    """An instance with its exported states, oldest first.

    As of a time, all values are as of then: `presence_then` gives the basis of the presence, `states` holds its one
    state, and label, counts and times are those of the observations by then.
    """

    number: int
    id: str
    label: str
    label_belief: Mapping[str, float]
    presence: Presence | PresenceValue
    existence_log_odds: float
    first_seen_ns: int
    last_seen_ns: int
    centroid_map: FloatArray
    box: Box3D
    observations: int
    traversal_id: int
    states: tuple[StateRecord, ...]
    newest: StateRecord
    visits: tuple[StoredVisit, ...]
    presence_then: PresenceAt | None = None

    def presence_in(self, state: StateRecord) -> str:
        """The presence in one state: "ended" in all but the newest; as of a time, the presence then."""
        return self.presence if self.presence_then is not None or state.index == self.newest.index else "ended"

    @property
    def change_bounds_ns(self) -> tuple[int | None, int | None]:
        """As of a time: the bounds within which it left or came, where known."""
        return (
            (None, None)
            if self.presence_then is None
            else (self.presence_then.not_before_ns, self.presence_then.not_after_ns)
        )


def export_current(instance: StoredInstance, states: tuple[StateRecord, ...]) -> ExportedInstance:
    """An instance as believed today."""
    return ExportedInstance(
        number=instance.number,
        id=instance.id,
        label=instance.label,
        label_belief=instance.label_belief,
        presence=instance.presence,
        existence_log_odds=instance.existence_log_odds,
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=instance.last_seen_ns,
        centroid_map=instance.centroid_map,
        box=instance.box,
        observations=instance.observations,
        traversal_id=instance.traversal_id,
        states=states,
        newest=instance.states[-1],
        visits=instance.visits,
    )


def export_as_of(
    instance: StoredInstance, presence_then: PresenceAt, at_ns: int, observations: Sequence[LabelledObservation]
) -> ExportedInstance:
    """An instance as of a time; `observations` are all of its observations, or none."""
    state = presence_then.state
    seen_by_then = [observation for observation in observations if observation.stamp_ns <= at_ns]
    return ExportedInstance(
        number=instance.number,
        id=instance.id,
        label=label_at(presence_then, seen_by_then, at_ns),
        label_belief=label_shares(seen_by_then),
        presence=presence_then.value,
        existence_log_odds=log_odds_of(state.confidence),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=max((observation.stamp_ns for observation in seen_by_then), default=instance.first_seen_ns),
        centroid_map=state.centroid_map,
        box=state.box,
        observations=len(seen_by_then),
        traversal_id=instance.traversal_id,
        states=(state,),
        newest=instance.states[-1],
        visits=instance.visits,
        presence_then=presence_then,
    )
