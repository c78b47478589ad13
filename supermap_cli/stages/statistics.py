"""What came through each stage of a build, and what to say when nothing did."""

from __future__ import annotations

from dataclasses import dataclass, field

from supermap_cli.errors import DetectorError, OdometryError, RecordingError
from supermap_cli.types.detections import Detections
from supermap_cli.types.memory import MapDelta


@dataclass
class BuildStatistics:
    """How many came through each stage; told when a build ends empty.

    `frames` there were, of which `without_pose` had none; `keyframes` were mapped, of which `perceived` with
    `detections`, so many of these with `masks`.
    `transitions` are objects that appeared, disappeared or moved; `labels` counts what stands
    in the map at the end.
    """

    frames: int = 0
    without_pose: int = 0
    keyframes: int = 0
    perceived: int = 0
    detections: int = 0
    masks: int = 0
    observations: int = 0
    transitions: int = 0
    labels: dict[str, int] = field(default_factory=dict)

    def count_keyframe(self, detections: Detections | None) -> None:
        """A keyframe was mapped, with what was found in it."""
        self.keyframes += 1
        if detections is not None:
            self.perceived += 1
            self.detections += len(detections)
            self.masks += sum(mask is not None for mask in detections.masks)

    def count_changes(self, delta: MapDelta) -> MapDelta:
        """What a keyframe changed; it is given back."""
        self.observations += len(delta.observations)
        self.transitions += len(delta.temporal_edges)
        return delta

    def check_not_empty(self, where: str, detector: str, lost_results: int = 0) -> None:
        """A build never ends silently empty: say at which stage everything was lost, and what helps. `lost_results`
        counts the images for which detections never came.
        """
        if self.keyframes == 0 and self.without_pose:
            raise OdometryError(
                f"none of {self.without_pose} images has a pose",
                where=where,
                cure="see in `supermap inspect` what the odometry covers, or choose another --odometry",
            )
        if self.keyframes == 0:
            raise RecordingError(
                "no image could be mapped", where=where, cure="see `supermap inspect` for what is missing"
            )
        if self.observations or self.transitions:
            return
        if self.detections == 0 and not lost_results:
            raise DetectorError(
                f"the detector {detector!r} found nothing in {self.perceived} images",
                where=where,
                cure="try another model or a lower score (--option, see `supermap plugins`)",
            )
        raise RecordingError(
            f"nothing could be mapped: {self.detections} detections in {self.keyframes} images, "
            f"{self.masks} with a mask, no object confirmed"
            + (f"; for {lost_results} images they never came" if lost_results else ""),
            where=where,
            cure="check the depth (`supermap inspect`), map more images with --rate, or lower --min-confidence",
        )
