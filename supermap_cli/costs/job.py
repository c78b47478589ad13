"""A measurement as handed to its process, and the results of the processes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from supermap_cli.config import BuildConfig
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.timing import StageTiming

Measurement = Literal["build", "stages", "decode", "growth"]


class CostJob(BaseModel):
    """What to measure. `db` is a database that does not exist yet; `objects` is for `growth`.

    `build`: as `supermap build` does it; `stages`: the same with one stage at a time, so that none waits for another;
    `decode`: the same keyframes and recorded detections, decoded and dropped; `growth`: the second half of the first
    recording, mapped into the map of the first half, which is grown to `objects` objects before.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    measurement: Measurement
    recordings: tuple[Path, ...]
    config: BuildConfig
    request: RecordingRequest
    align: str
    db: Path
    objects: int = 0


@dataclass(frozen=True)
class BuildRun:
    """Costs of a build as a whole, in its own process; sizes in 10^6 bytes."""

    keyframes: int
    detections: int
    objects: int
    recorded_s: float
    total_s: float
    cpu_s: float
    peak_memory_mb: float
    database_mb: float
    backends: dict[str, str]


@dataclass(frozen=True)
class StagesRun:
    """Time of every stage over all recordings; `objects` is the count in the map at the end."""

    keyframes: int
    objects: int
    timings: tuple[StageTiming, ...]


@dataclass(frozen=True)
class DecodeRun:
    """Costs of decoding the keyframes and their recorded detections, without opening and calibration."""

    keyframes: int
    total_s: float
    peak_memory_mb: float


Run = BuildRun | StagesRun | DecodeRun
RESULTS: dict[Measurement, type[BuildRun | StagesRun | DecodeRun]] = {
    "build": BuildRun,
    "stages": StagesRun,
    "decode": DecodeRun,
    "growth": StagesRun,
}
