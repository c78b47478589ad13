"""Tracking in the image by ByteTrack's two stages (Zhang et al. 2022), with the map's predictions as priors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Recording, Tracker


class ByteTrackOptions(Options):
    """Options of the tracker `bytetrack`.

    The defaults are for detections at 1 to 3 Hz from a moving robot; ByteTrack's own are for video at 30 Hz
    (`high_score` 0.6, `lost_frames` 30). `buffer` is meant as in C-BIoU (Yang et al. 2023). Chosen.
    """

    high_score: float = Field(
        default=0.3, ge=0, le=1, description="detections from this score are matched first and may start a track"
    )
    lost_frames: int = Field(
        default=5, ge=0, description="images a track outlives without a detection or the map's support"
    )
    buffer: float = Field(
        default=0.3,
        ge=0,
        description="share of its size by which a box is widened on each side before boxes are compared",
    )
    least_overlap: float = Field(
        default=0.2, ge=0, le=1, description="least overlap of the widened boxes in the first stage"
    )


@hookimpl
def register_trackers(register: Register) -> None:
    """The tracker `bytetrack`."""
    register("bytetrack", _make_tracker, ByteTrackOptions)


def _make_tracker(options: ByteTrackOptions, recording: Recording) -> Tracker:  # noqa: ARG001 - it needs none
    from supermap_bytetrack.tracker import ByteTracker  # noqa: PLC0415 - loaded when used

    return ByteTracker(options)
