"""Pairs the traversals of a map with those of the truth, by the fingerprints of the recordings, never by name."""

from __future__ import annotations

from supermap_cli.errors import EvaluationError
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.recordings.fingerprint import window_fingerprint
from supermap_cli.types.truth import GroundTruth, TrueTraversal

TraversalPairs = dict[int, tuple[TrueTraversal, ...]]
"""Id of a map's traversal -> its true traversals; several only where they are paired by time."""


def pair_traversals(reader: MapReader, truth: GroundTruth) -> TraversalPairs:
    """Find every traversal of the map in the truth. The truth may know of more.

    Raises `EvaluationError` where the truth belongs to other recordings, and where the map holds a traversal that it
    does not know: what that one changed could not be judged.
    """
    pairs = {traversal.id: true_traversals(traversal, truth) for traversal in reader.traversals}
    if not any(pairs.values()):
        raise EvaluationError(
            "this truth belongs to other recordings than those in the map",
            where=reader.where,
            cure="give the truth.json that lies beside the recordings in the map",
        )
    if unknown := [traversal.name for traversal in reader.traversals if not pairs[traversal.id]]:
        raise EvaluationError(
            f"the truth does not know {', '.join(unknown)}, which the map holds: objects at its end cannot be judged",
            where=reader.where,
            cure="build a map of the recordings that the truth is about, and no others",
        )
    return pairs


def true_traversals(mapped: StoredTraversal, truth: GroundTruth) -> tuple[TrueTraversal, ...]:
    """The true traversals of a mapped one, by fingerprint; by time where the truth has none."""
    same = [true for true in truth.traversals if _is_same_recording(mapped, true)]
    without_fingerprint = [true for true in truth.traversals if true.fingerprint is None]
    return tuple(same or [true for true in without_fingerprint if _overlap_in_time(mapped, true)])


def _is_same_recording(mapped: StoredTraversal, true: TrueTraversal) -> bool:
    """Whether it is a build of that recording, or of a stretch of it."""
    if true.fingerprint is None:
        return False
    return mapped.fingerprint == window_fingerprint(true.fingerprint, *_recorded_span(mapped))


def _overlap_in_time(mapped: StoredTraversal, true: TrueTraversal) -> bool:
    start_ns, end_ns = _recorded_span(mapped)
    return start_ns <= true.end_ns and true.start_ns <= end_ns


def _recorded_span(mapped: StoredTraversal) -> tuple[int, int]:
    """Start and end by the recording's own clock."""
    return mapped.start_ns - mapped.clock_shift_ns, mapped.end_ns - mapped.clock_shift_ns
