"""An instance as it leaves: as it is believed to be today, or as it was at the time that was asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.memory.values import LabelledObservation, StoredInstance, StoredVisit
from supermap_cli.query.details import log_odds
from supermap_cli.query.naming import label_shares, name_by
from supermap_cli.query.standing import Known, Standing
from supermap_cli.types.memory import Presence, StateRecord


@dataclass(frozen=True)
class Leaving:
    """An instance with those of its states that leave, oldest first.

    As of a time, all that is told of it is of then: `standing` says what its presence rests on, `states` is the one
    that it speaks of, and the label, the counts and times are those of what had been seen.
    """

    number: int
    id: str
    label: str
    label_belief: Mapping[str, float]
    presence: Presence | Known
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
    standing: Standing | None = None

    def presence_in(self, state: StateRecord) -> str:
        """The presence as far as a state says: "ended" in all but the newest; as of a time, what is known of then."""
        return self.presence if self.standing is not None or state.index == self.newest.index else "ended"

    @property
    def gap_ns(self) -> tuple[int | None, int | None]:
        """The bounds within which it left or came, as far as that is known; of a time only."""
        return (None, None) if self.standing is None else (self.standing.not_before_ns, self.standing.not_after_ns)


def leaving_today(instance: StoredInstance, states: tuple[StateRecord, ...]) -> Leaving:
    """An instance as it is believed to be today."""
    return Leaving(
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


def leaving_as_of(
    instance: StoredInstance, standing: Standing, at_ns: int, said: Sequence[LabelledObservation]
) -> Leaving:
    """An instance as it was at a time, by what had been said of it (`said`: all that ever was, or none)."""
    state, seen = standing.state, [each for each in said if each.stamp_ns <= at_ns]
    name = name_by(seen, at_ns)
    return Leaving(
        number=instance.number,
        id=instance.id,
        label=state.label if name is None else name.label,
        label_belief=label_shares(seen),
        presence=standing.presence,
        existence_log_odds=log_odds(state),
        first_seen_ns=instance.first_seen_ns,
        last_seen_ns=max((each.stamp_ns for each in seen), default=instance.first_seen_ns),
        centroid_map=state.centroid_map,
        box=state.box,
        observations=len(seen),
        traversal_id=instance.traversal_id,
        states=(state,),
        newest=instance.states[-1],
        visits=instance.visits,
        standing=standing,
    )
