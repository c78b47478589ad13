"""Changes claimed within a first traversal in which nothing changes: each of them is false."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import known_truth
from supermap_cli.evaluation.objects import PERSON
from supermap_cli.types.truth import GroundTruth, TrueObject, TrueTraversal


@dataclass(frozen=True)
class ClaimedChange:
    """An event that the map holds and that never happened."""

    kind: str
    instance_id: str
    label: str


def claimed_changes(estimate: EstimatedMap, truth: GroundTruth) -> tuple[ClaimedChange, ...] | None:
    """All events of things (not of people) that the map dates to its first traversal; `None` where something changes in
    it. Later traversals are scored by their diff (`evaluation.changes`).
    """
    first = known_truth(estimate, truth).traversals[0]
    if any(_changes_within(obj, first) for obj in truth.objects if obj.label != PERSON):
        return None
    return tuple(
        ClaimedChange(event.kind, event.object_id, event.label)
        for event in estimate.events
        if event.label != PERSON and first.start_ns <= event.at_ns <= first.end_ns
    )


def _changes_within(obj: TrueObject, traversal: TrueTraversal) -> bool:
    """Whether an object comes, goes or moves during a traversal."""
    ends = [end for state in obj.states for end in (state.since_ns, state.until_ns) if end is not None]
    ends += [int(stamp_ns) for motion in obj.motions for stamp_ns in motion.stamps_ns]
    return any(traversal.start_ns <= end <= traversal.end_ns for end in ends)
