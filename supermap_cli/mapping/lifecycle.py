"""The life of an object: tentative, confirmed, demoted, forgotten.

The paper enters every unprojected detection into the map; here an object is tentative until several detections over a
span of time speak for it, since detectors imagine things.
"""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.mapping.belief import Existence, LabelBelief, ViewpointHistory
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.motion import MotionState
from supermap_cli.mapping.objects import DEFAULT_SETS, MapObject, MissEvidence, ObjectParameterSets, OpenState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class LifecycleParameters:
    """Existence (log-odds, or the calibrated probability of `types.existence`) at which an object's status changes."""

    initial_log_odds: float = parameter(-1.0, "1", "existence before its first detection: more likely not there", TUNED)
    min_confidence: float = parameter(
        0.5,
        "1",
        "confidence (the probability of being right) from which a tentative object enters the map, and a demoted one "
        "comes back",
        "the best F1 F is had at a threshold of F / 2 (Lipton 2014), here .45; flat from .45 to .6 on the domain "
        "suite's development half",
        at_most=1.0,
    )
    confirm_observations: int = parameter(2, "1", "detections it must have: one may be an error", TUNED)
    confirm_span_s: float = parameter(
        0.5,
        "s",
        "time that its detections must span, for some in quick succession share their errors",
        TUNED,
    )
    demote_confidence: float = parameter(
        0.42,
        "1",
        "a confirmed object of this confidence or less, or of less than min_confidence where that is lower, is "
        "demoted: it leaves the answers until confirmed anew",
        "as much speaks for its existence as against it: log-odds of 0",
        at_most=1.0,
    )
    left_log_odds: float = parameter(
        10.0,
        "1",
        "existence from which an object that stands there no more has left, in the traversal that first found it: what "
        "was believed less was never there",
        "calibrated .92 (types.existence): nine in ten claimed changes shall be right",
    )
    forget_log_odds: float = parameter(
        -3.0,
        "1",
        "a tentative object at or below this is forgotten: what is forgotten and found anew has lost all that spoke "
        "for it (books of the desk of TUM fr1_rpy were, three times each)",
        TUNED,
    )


DEFAULT = LifecycleParameters()


def initialize(
    number: int,
    detection: LiftedDetection,
    stamp_ns: int,
    camera_id: str,
    *,
    parameters: LifecycleParameters = DEFAULT,
    sets: ObjectParameterSets = DEFAULT_SETS,
) -> MapObject:
    """A tentative object from one unexplained detection of a camera; its evidence is fused by the caller."""
    return MapObject(
        number,
        VoxelMap(sets.voxel_map.finest_voxel_m),
        LabelBelief(parameters=sets.belief, size_parameters=sets.class_sizes),
        Existence(parameters.initial_log_odds, ViewpointHistory(parameters=sets.belief)),
        OpenState(0, stamp_ns),
        stamp_ns,
        stamp_ns,
        track_ids={camera_id: detection.track_id} if detection.track_id >= 0 else {},
        misses=MissEvidence(viewpoints=ViewpointHistory(parameters=sets.belief)),
        motion=MotionState(parameters=sets.motion),
        parameters=sets,
    )


def ready_to_confirm(tentative: MapObject, parameters: LifecycleParameters = DEFAULT) -> bool:
    """Whether a tentative object is believed enough to enter the map, whatever it is called: its label has a
    probability of its own.
    """
    if tentative.confidence < parameters.min_confidence:
        return False
    if tentative.observations < parameters.confirm_observations:
        return False
    return tentative.last_seen_ns - tentative.first_seen_ns >= parameters.confirm_span_s * 1e9


def is_demoted(confirmed: MapObject, parameters: LifecycleParameters = DEFAULT) -> bool:
    """Whether a confirmed object is believed in no more; one that was demoted must be confirmed anew."""
    least = min(parameters.demote_confidence, parameters.min_confidence)
    return confirmed.confidence <= (parameters.min_confidence if confirmed.demoted else least)


def has_left(obj: MapObject, parameters: LifecycleParameters = DEFAULT) -> bool:
    """Whether an object whose place is empty has left it, rather than never having been there: one of an earlier
    traversal, or one that is believed in firmly.
    """
    return obj.visit.earlier_ns is not None or obj.existence_log_odds >= parameters.left_log_odds
