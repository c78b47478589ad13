"""What the memory keeps of a keyframe: its poses, a thumbnail, and a small depth image."""

from __future__ import annotations

import cv2
import numpy as np

from supermap_cli.config import KeyframeConfig
from supermap_cli.geometry.cameras import camera_to_json
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord


def keyframe_record(keyframe: Keyframe, config: KeyframeConfig, *, detected: bool) -> KeyframeRecord:
    """A keyframe as the memory keeps it; `detected`: a detector spoke of it."""
    return KeyframeRecord(
        stamp_ns=keyframe.stamp_ns,
        T_map_base=keyframe.T_map_base,
        T_map_camera=keyframe.T_map_camera,
        camera=camera_to_json(keyframe.camera),
        depth_png=encode_small_depth(keyframe, config.depth_step),
        depth_step=config.depth_step,
        thumbnail_jpeg=thumbnail(keyframe, config.thumbnail_px) if config.thumbnail_px else None,
        detected=detected,
        camera_id=keyframe.camera_id,
    )


def thumbnail(keyframe: Keyframe, width_px: int) -> bytes:
    """A small JPEG of a keyframe's image."""
    height_px = max(1, round(width_px * keyframe.camera.height / keyframe.camera.width))
    small = keyframe.rgb
    while small.shape[1] >= 2 * width_px and small.shape[0] % 2 == small.shape[1] % 2 == 0:  # exact and quick
        small = np.asarray(
            cv2.resize(small, (small.shape[1] // 2, small.shape[0] // 2), interpolation=cv2.INTER_AREA), np.uint8
        )
    if small.shape[:2] != (height_px, width_px):
        small = np.asarray(cv2.resize(small, (width_px, height_px), interpolation=cv2.INTER_AREA), np.uint8)
    _, jpeg = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 75])
    return jpeg.tobytes()
