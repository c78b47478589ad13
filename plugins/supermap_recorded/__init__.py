"""What a recording brings along: the robot's own odometry and detections, both under the name `recorded`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Detector, Odometry, Recording


class RecordedDetectorOptions(Options):
    """Options of the detector `recorded`."""

    score_floor: float = Field(default=0.0, ge=0, le=1, description="detections below this score are left out")
    labels: Path | None = Field(
        default=None, description="names of the classes, one a line, where the recording has only their numbers"
    )


@hookimpl
def register_odometry(register: Register) -> None:
    """The odometry topic, or TF."""
    register("recorded", _make_odometry, needs=("poses",), preference=10)


@hookimpl
def register_detectors(register: Register) -> None:
    """The detections topic, with masks where there are any."""
    register("recorded", _make_detector, RecordedDetectorOptions, needs=("detections",), preference=10)


def _make_odometry(options: Options, recording: Recording | None) -> Odometry:  # noqa: ARG001 - it has no options
    from supermap_recorded.odometry import RecordedOdometry  # noqa: PLC0415 - loaded when used

    return RecordedOdometry(recording)


def _make_detector(options: RecordedDetectorOptions, recording: Recording) -> Detector:
    from supermap_recorded.detector import RecordedDetector  # noqa: PLC0415 - loaded when used

    return RecordedDetector(recording, options.score_floor, options.labels)
