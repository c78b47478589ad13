"""One measurement, as it is handed to the process that makes it, and what that process found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from supermap_cli.config import BuildConfig
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.timing import StageTiming

Measurement = Literal["build", "stages", "decode", "growth"]


class Job(BaseModel):
    """What to measure. `db` is a database that is not there yet; `objects` is for `growth`.

    `build`: everything as `supermap build` does it; `stages`: the same with one stage at a time, so that none waits for
    another; `decode`: the same keyframes and recorded detections, decoded and dropped; `growth`: the second half of the
    first recording, mapped into what the first half left, filled up to so many objects.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    what: Measurement
    recordings: tuple[Path, ...]
    config: BuildConfig
    wanted: RecordingRequest
    align: str
    db: Path
    objects: int = 0


@dataclass(frozen=True)
class BuildRun:
    """What a build as a whole took, in its own process; sizes in 10^6 bytes."""

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
    """What every stage took, over all recordings; `objects` stand in the map at the end."""

    keyframes: int
    objects: int
    timings: tuple[StageTiming, ...]


@dataclass(frozen=True)
class DecodeRun:
    """What it took to decode the keyframes with what was recorded for them, opening and calibration apart."""

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
