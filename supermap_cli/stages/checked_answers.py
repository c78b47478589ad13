"""Answers of backends, which anybody may have written, as they enter: the error for what is none names the backend."""

from __future__ import annotations

import numpy as np

from supermap_cli.errors import DetectorError, PluginError
from supermap_cli.geometry.arrays import IntArray
from supermap_cli.types.detections import Detections, RegionMask, Tracks, plainly_labelled
from supermap_cli.types.sensing import CameraFrame, StampedPose

_CURE = "tell its authors, or use another one (see `supermap plugins`)"


def checked_detections(answer: object, backend: object, frame: CameraFrame) -> Detections | None:
    """A detector's answer for an image, its labels spelled plainly; what has no label is left out.

    Raises `DetectorError` for what are no detections, and for numbers that are not finite, scores beyond 0 to 1 and
    labels that are no text.
    """
    if answer is None:
        return None
    if not isinstance(answer, Detections):
        raise DetectorError(f"{_named(backend)} answers with {type(answer).__name__}, not with Detections", cure=_CURE)
    sound = (
        np.isfinite(answer.boxes_xyxy).all()
        and ((answer.scores >= 0) & (answer.scores <= 1)).all()
        and all(isinstance(each.label, str) for ranked in answer.hypotheses for each in ranked)
        and all(0 <= each.score <= 1 for ranked in answer.hypotheses for each in ranked)
    )
    if not sound:
        what = (
            f"{_named(backend)} answers with boxes that are not finite, scores beyond 0 to 1, or labels that are none"
        )
        raise DetectorError(what, where=f"image at {frame.stamp_ns} ns", cure=_CURE)
    return plainly_labelled(answer)


def checked_stamps(answer: object, backend: object) -> IntArray | None:
    """The stamps of images that a detector has an answer for. Raises `DetectorError` for what are none."""
    if answer is None:
        return None
    if not isinstance(answer, np.ndarray) or answer.ndim != 1 or not np.issubdtype(answer.dtype, np.integer):
        raise DetectorError(f"{_named(backend)} says with no stamps which images it knows", cure=_CURE)
    return answer


def checked_masks(answer: object, backend: object, count: int) -> tuple[RegionMask | None, ...]:
    """A segmenter's answer for `count` detections. Raises `PluginError` for anything but as many masks or `None`."""
    sound = isinstance(answer, tuple | list) and len(answer) == count
    if not sound or not all(mask is None or isinstance(mask, RegionMask) for mask in answer):  # type: ignore[attr-defined]
        raise PluginError(f"{_named(backend)} answers with no {count} masks", cure=_CURE)
    return tuple(answer)  # type: ignore[arg-type]


def checked_tracks(answer: object, backend: object, count: int) -> Tracks:
    """A tracker's answer for `count` detections. Raises `PluginError` for anything but as many whole numbers."""
    ids = np.asarray(answer.track_ids) if isinstance(answer, Tracks) else np.zeros(())
    if not isinstance(answer, Tracks) or ids.shape != (count,) or not np.issubdtype(ids.dtype, np.integer):
        raise PluginError(f"{_named(backend)} answers with no track numbers of {count} detections", cure=_CURE)
    return answer


def checked_pose(answer: object, backend: object) -> StampedPose | None:
    """An odometry's answer. Raises `PluginError` for what is no pose, and for one that is not finite."""
    if answer is None:
        return None
    if not isinstance(answer, StampedPose) or not np.isfinite(answer.T_odom_base).all():
        raise PluginError(f"{_named(backend)} answers with what is no finite pose", cure=_CURE)
    return answer


def _named(backend: object) -> str:
    """Where a backend's code is: its module begins with the name of the plugin's package."""
    return f"the plugin {type(backend).__module__}.{type(backend).__qualname__}"
