"""What came through each stage of a build, and what to say when nothing did."""

from __future__ import annotations

from dataclasses import dataclass, field

from supermap_cli.errors import DetectorError, OdometryError, RecordingError
from supermap_cli.types.detections import Detections
from supermap_cli.types.memory import MapDelta

MIN_LOOKS = 20
"""Images in which the detector has looked, from which its silence says something: 7 s at 3 Hz. Chosen."""
STRAY_SHARE = 0.2
"""Detections per image up to which they may be a detector's mistakes in an empty place. Chosen."""


@dataclass
class BuildStatistics:
    """How many came through each stage; told when a build ends empty.

    `frames` there were, of which `without_pose` had none; `keyframes` were mapped, of which `perceived` with
    `detections`, so many of these with `masks`, and `lifted` to points in the map; `tentative` objects were not
    confirmed until the end.
    `transitions` are objects that appeared, disappeared or moved; `labels` counts what stands
    in the map at the end.
    """

    frames: int = 0
    without_pose: int = 0
    keyframes: int = 0
    perceived: int = 0
    detections: int = 0
    masks: int = 0
    lifted: int = 0
    tentative: int = 0
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

    def funnel(self, confirmed: int = 0) -> str:
        """How many came through each stage, and what held most back."""
        return f"{self._counted(confirmed)}; {': '.join(self._narrowest())}"

    def _counted(self, confirmed: int = 0) -> str:
        counts = {
            "images": max(self.frames, self.keyframes + self.without_pose),
            "mapped with a pose": self.keyframes,
            "looked at by the detector": self.perceived,
            "detections": self.detections,
            "lifted into the map": self.lifted,
            "objects left tentative": self.tentative,
            "confirmed": confirmed,
        }
        return ", ".join(f"{count} {what}" for what, count in counts.items())

    def _narrowest(self) -> tuple[str, str]:
        """The first stage that let next to nothing through, and what helps there."""
        if self.perceived == 0:
            return "no image met its detections", "see their times with `supermap inspect`"
        if self.detections == 0:
            return "the detector found nothing", "try another model or a lower score (--option)"
        if self.masks == 0:
            return "no detection got a mask", "see the depth with `supermap inspect --doctor`"
        if self.lifted < self.detections / 10:
            return "most detections met no depth", "see the depth with `supermap inspect --doctor`"
        return "most were held back because too few views agreed", "map more with --rate, or lower --min-confidence"

    def _is_empty_place(self, detections_recorded: bool) -> bool:
        if self.detections == 0:
            return self.perceived > 0 and detections_recorded
        return self.lifted > 0 and self.perceived >= MIN_LOOKS and self.detections <= STRAY_SHARE * self.perceived

    def check_not_empty(
        self,
        where: str,
        detector: str,
        lost_results: int = 0,
        *,
        first_visit: bool = False,
        detections_recorded: bool = False,
    ) -> str | None:
        """A build never ends silently empty: say at which stage everything was lost, and what helps. `lost_results`
        counts the images for which detections never came.

        A first visit to a place that is really empty is a map: what comes later has appeared. So it is where the
        recording itself says that there was nothing (`detections_recorded`), or where hardly anything was found and
        no two looks agreed. Returns the warning for such a map, `None` where something is in it.
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
            return None
        if first_visit and not lost_results and self._is_empty_place(detections_recorded):
            return f"nothing stands in this map: 0 objects ({self.funnel()}); what comes later will have appeared"
        if self.detections == 0 and not lost_results:
            raise DetectorError(
                f"the detector {detector!r} found nothing in {self.perceived} images",
                where=where,
                cure="try another model or a lower score (--option, see `supermap plugins`)",
            )
        held_back, cure = self._narrowest()
        raise RecordingError(
            f"nothing could be mapped: {self.detections} detections in {self.keyframes} images, "
            f"{self.masks} with a mask, no object confirmed"
            + (f"; for {lost_results} images they never came" if lost_results else "")
            + f" ({self._counted()}; {held_back})",
            where=where,
            cure=cure,
        )
