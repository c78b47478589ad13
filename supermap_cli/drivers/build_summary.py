"""What a build did, for people and programs."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.stages.map_registration import Placement
from supermap_cli.stages.statistics import BuildStatistics
from supermap_cli.timing import StageTiming


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
