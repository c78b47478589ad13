"""The plugin's hooks. Every run of `supermap` imports this module, so nothing heavy is imported here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from supermap_cli import Options, hookimpl

if TYPE_CHECKING:
    from supermap_cli import Register
    from supermap_cli.protocols import Detector, Recording


class RedOptions(Options):
    """Options of the detector `red`."""

    label: str = Field(default="red thing", min_length=1, description="what the found things are called")
    min_area_px: int = Field(default=200, ge=1, description="smaller spots are left out")
    min_saturation: int = Field(default=150, ge=0, le=255, description="paler red does not count")


@hookimpl
def register_detectors(register: Register) -> None:
    """The detector `red`."""
    register("red", _make_detector, RedOptions)


def _make_detector(options: RedOptions, recording: Recording) -> Detector:  # noqa: ARG001 - it looks at any image
    from supermap_example_detector.detector import RedDetector  # noqa: PLC0415 - loads OpenCV when used

    return RedDetector(options)
