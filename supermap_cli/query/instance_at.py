"""An instance as of a time: the observations, label, states and evidence known by then."""

from __future__ import annotations

from collections.abc import Sequence

from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import ObservationRef, StoredInstance
from supermap_cli.query.label_consensus import LabelledT, label_consensus_at
from supermap_cli.query.presence_at import PresenceAt
from supermap_cli.query.views import EvidenceView, IntervalView, evidence_of, interval_view


def observations_until(reader: MapReader, instance: StoredInstance, at_ns: int) -> list[ObservationRef]:
    """The observations of an instance up to a time."""
    return [observation for observation in reader.observations(instance) if observation.stamp_ns <= at_ns]


def label_at(presence: PresenceAt, observations: Sequence[LabelledT], at_ns: int) -> str:
    """The label at a time: the consensus of the observations by then, else the label of the state."""
    consensus = label_consensus_at(observations, at_ns)
    return presence.state.label if consensus is None else consensus.label


def intervals_until(instance: StoredInstance, at_ns: int) -> tuple[IntervalView, ...]:
    """The states that had begun by a time, else the first one."""
    states_begun = [state for state in instance.states if state.first_seen_ns <= at_ns]
    return tuple(map(interval_view, states_begun or instance.states[:1]))


def evidence_until(
    reader: MapReader, instance: StoredInstance, observations: Sequence[ObservationRef], at_ns: int
) -> EvidenceView:
    """The evidence of observations, and of the visits of traversals that had begun by a time."""
    begun = {traversal.id for traversal in reader.traversals if traversal.start_ns <= at_ns}
    visits = [visit for visit in instance.visits if visit.traversal_id in begun]
    return evidence_of(observations, visits, reader.traversals)
