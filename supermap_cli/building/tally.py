"""What came through each stage of a build, and what to say when nothing did."""

from __future__ import annotations

from dataclasses import dataclass, field

from supermap_cli.errors import DetectorError, OdometryError, RecordingError


@dataclass
class Tally:
    """What came through each stage: told when a build ends empty. `turns` are things that came, went or moved."""

    frames: int = 0
    without_pose: int = 0
    keyframes: int = 0
    perceived: int = 0
    detections: int = 0
    masks: int = 0
    observations: int = 0
    turns: int = 0
    labels: dict[str, int] = field(default_factory=dict)

    def check_something_came_of_it(self, where: str, detector: str) -> None:
        """A build never ends silently empty: say at which stage everything was lost, and what helps."""
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
        if self.observations or self.turns:
            return
        if self.detections == 0:
            raise DetectorError(
                f"the detector {detector!r} found nothing in {self.perceived} images",
                where=where,
                cure="try another model or a lower score (--option, see `supermap plugins`)",
            )
        raise RecordingError(
            f"nothing could be mapped: {self.detections} detections in {self.keyframes} images, "
            f"{self.masks} with a mask, no object confirmed",
            where=where,
            cure="check the depth (`supermap inspect`), or map more images with --rate",
        )
