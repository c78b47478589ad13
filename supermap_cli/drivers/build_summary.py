"""What a build did, for people and programs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from supermap_cli.session import MappingSession
from supermap_cli.stages.map_registration import Placement
from supermap_cli.stages.statistics import BuildStatistics
from supermap_cli.timing import StageTiming
from supermap_cli.types.session import SessionSummary


@dataclass(frozen=True)
class BuildSummary:
    """What one build did. `total_s` is less than the stages' sum: perception runs ahead beside mapping.

    Times in the map are the recording's plus `clock_shift_ns`. `resumed_s`: how far the recording had been mapped when
    the build went on; `None` if it began anew.
    """

    traversal_id: int
    traversal: str
    statistics: BuildStatistics
    placement: Placement
    timings: tuple[StageTiming, ...]
    backends: dict[str, str]
    recorded_s: float
    total_s: float
    instances: int
    warnings: tuple[str, ...]
    clock_shift_ns: int = 0
    resumed_s: float | None = None


def present_labels(session: MappingSession) -> Iterator[str]:
    """The labels of what stands in the map now."""
    return (obj.label for obj in session.engine.objects if obj.confirmed and obj.present and not obj.demoted)


def session_summary(session: MappingSession, warnings: tuple[str, ...], *, complete: bool) -> SessionSummary:
    """What observers are told at the end of a session."""
    statistics = session.statistics
    standing = sum(1 for _ in present_labels(session))
    return SessionSummary(complete, statistics.keyframes, statistics.observations, standing, warnings)
