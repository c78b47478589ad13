"""Colour and depth that are said to share one calibration: checked on the images, and corrected where they do not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from supermap_cli.errors import RecordingError
from supermap_cli.geometry.arrays import Float32Array, UInt8Array
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.recordings.images import decode_color
from supermap_cli.recordings.messages import read_image
from supermap_cli.recordings.opening import OpenedCamera, OpenedRecording
from supermap_cli.recordings.rig import CameraRig
from supermap_cli.recordings.self_calibration import corrected_color_camera
from supermap_cli.recordings.storage import RawMessage

SAMPLES = 14
"""Images looked at, spread over the whole recording, so that every window of it gets the same camera."""

LEAST_SAMPLES = 8
"""With fewer images of different moments nothing is corrected: they would show one view, and agree by accident."""

_WINDOW_NS = 1_000_000_000
"""ns of log time in which a pair of images is looked for at every sample."""

_ONE_MOMENT_NS = 3_000_000
"""ns; colour and depth further apart than this show the camera's turn (at 65 degrees/s two pixels in 3 ms, at a focal
length of 580) as if it were a wrong calibration.
"""

_SPACING_NS = 500_000_000
"""ns between the colour stamps of two samples, at least, so that they show different views."""


def fitted_rig(opened: OpenedRecording, opened_camera: OpenedCamera) -> CameraRig:
    """The rig of a camera, with the colour camera that its images show; the same one where colour and depth fit, or it
    cannot be told.
    """
    rig = opened_camera.rig
    depth, camera = rig.depth, rig.camera
    checkable = depth is not None and depth.aligned and isinstance(camera, PinholeCamera) and not any(camera.distortion)
    if depth is None or not isinstance(camera, PinholeCamera) or not checkable or not opened.request.fit_color:
        return rig
    size = (camera.height, camera.width)
    images = [
        (rgb, depth_m) for rgb, depth_m in sample_pairs(opened, opened_camera) if rgb.shape[:2] == depth_m.shape == size
    ]
    found = corrected_color_camera(images, camera) if len(images) >= LEAST_SAMPLES else None
    if found is None:
        return rig
    apart_mm = 1000 * float(np.linalg.norm(found.T_color_depth[:3, 3]))
    opened.notes.note(
        f"fit {opened_camera.color}",
        f"{opened.path}, {opened_camera.color}: colour and depth do not share the one calibration "
        f"they are given. By the images the colour camera's focal length is {found.camera.fx:.0f} px, not "
        f"{camera.fx:.0f}, and it stands {apart_mm:.0f} mm beside the depth camera: put right (fit_color = false in "
        f"supermap.toml keeps what is given)",
    )
    return replace(
        rig, camera=found.camera, depth=replace(depth, camera=camera, aligned=False, T_color_depth=found.T_color_depth)
    )


def sample_pairs(opened: OpenedRecording, camera: OpenedCamera) -> Iterator[tuple[UInt8Array, Float32Array]]:
    """Decoded colour and depth images of one moment in order of time, evenly spread over the whole recording.

    Colour stamps are half a second apart at least. A recording too short for `LEAST_SAMPLES` of them yields none.
    """
    color, depth = camera.color, camera.depth
    if depth is None:
        return
    tolerance_ns = min(opened.request.sync_tolerance_s * 1e9, _ONE_MOMENT_NS)
    first_ns, last_ns = opened.storage.start_ns, opened.storage.end_ns - _WINDOW_NS
    count = min(SAMPLES, (last_ns - first_ns) // _SPACING_NS + 1)
    if count < LEAST_SAMPLES:
        return
    taken_ns: int | None = None
    for start_ns in np.linspace(first_ns, last_ns, count).astype(np.int64):
        latest: dict[str, tuple[int, RawMessage]] = {}
        raws = opened.storage.messages([color, depth], int(start_ns), int(start_ns) + _WINDOW_NS)
        for stamp_ns, raw in opened.stamped(raws):
            latest[raw.channel.topic] = (stamp_ns, raw)
            if len(latest) < 2 or abs(latest[color][0] - latest[depth][0]) > tolerance_ns:
                continue
            if taken_ns is not None and latest[color][0] - taken_ns < _SPACING_NS:
                continue
            try:
                images = [opened.decoder.read_strictly(latest[name][1], read_image) for name in (color, depth)]
                pair = decode_color(images[0], opened.decoder.limits), opened.depth_m(images[1], depth)
            except (RecordingError, ValueError):
                continue  # a broken image is reported where it is used
            taken_ns = latest[color][0]
            yield pair
            break
