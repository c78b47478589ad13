"""What depth images hold, looked at over the length of a recording: no returns, one value, or no plausible metres."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import BoolArray, Float32Array
from supermap_cli.recordings import messages
from supermap_cli.recordings.images import decode_depth
from supermap_cli.recordings.opening import OpenedRecording

_IMAGES = 5
"""Images that are looked at, spread evenly: 10 ms each at 640 x 480."""

_HARDLY_ANY, _FEW = 0.001, 0.1
"""Shares of pixels with a return, in the median image: below the first there is no depth, below the second little."""

_LEAST_M, _MOST_M = 0.15, 15.0
"""Metres between which the median depth of a room or a street lies; RGB-D cameras measure from 0.1 to some 10 m."""

_SAME_M = 0.001
"""Metres by which all returns of all images differ at most where a camera tells one value only."""


def depth_doubt(opened: OpenedRecording, topic: str) -> tuple[str, bool] | None:
    """What speaks against a topic of depth, and whether nothing can be mapped with it; `None` for nothing."""
    images = list(_looked_at(opened, topic))
    if not images:
        return None
    shares = [float(np.mean(_returns(pixels))) for pixels in images]
    share, count = float(np.median(shares)), len(images)
    if max(shares) < _HARDLY_ANY:
        return f"its images hold no depth: {max(shares):.1%} of the pixels have a return in {count} looked at", True
    values = np.concatenate([pixels[_returns(pixels)] for pixels in images])
    least_m, most_m, median_m = float(values.min()), float(values.max()), float(np.median(values))
    plausible = _LEAST_M <= median_m <= _MOST_M
    if count > 1 and most_m - least_m <= _SAME_M:
        return f"its images hold one value only, {median_m:.3f} m, in all of {count} looked at", not plausible
    if not plausible:
        side = "far" if median_m > _MOST_M else "near"
        what = f"its depth is implausibly {side}: {median_m:.2f} m in the median of {count} images looked at"
        return f"{what}; 16-bit depth is in millimetres, 32-bit in metres (REP-118): convert it", False
    if share < _FEW:
        return f"its images hold little depth: {share:.1%} of the pixels have a return, in {count} looked at", False
    return None


def depth_problem(opened: OpenedRecording, topic: str) -> RecordingError | None:
    """What makes a topic of depth of no use; what only speaks against it is noted."""
    doubt = depth_doubt(opened, topic)
    if doubt is None:
        return None
    what, useless = doubt
    if useless:
        return RecordingError(
            what,
            where=f"{opened.path}, {topic}",
            cure="name another topic with --topic depth=/... or --topic lidar=/..., or record again",
        )
    opened.notes.note(f"depth values {topic}", f"{opened.path}, {topic}: {what}")
    return None


def _returns(pixels: Float32Array) -> BoolArray:
    found: BoolArray = np.logical_and(np.isfinite(pixels), pixels > 0)
    return found


def _looked_at(opened: OpenedRecording, topic: str) -> Iterator[Float32Array]:
    """Depth images in metres at evenly spread times; those that cannot be decoded are another matter."""
    scale = next((each.depth_scale for each in opened.rig.topics if each.name == topic), 1.0)
    start_ns, end_ns = opened.rig.window.log_range(0)
    times = [log_ns for _, log_ns in opened.storage.log_times([topic], start_ns, end_ns)]
    for at in np.unique(np.linspace(0, len(times) - 1, _IMAGES).astype(int)).tolist() if times else ():
        raws = opened.storage.messages([topic], times[at], times[at] + 1)
        image = next((read for _, read in opened.decoder.each(raws, messages.read_image)), None)
        if image is None:
            continue
        try:
            yield decode_depth(image, opened.decoder.limits) * np.float32(scale)
        except (RecordingError, ValueError):
            continue
