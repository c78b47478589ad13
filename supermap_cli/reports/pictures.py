"""Pictures for pages: crops of observations, and places cropped from keyframe thumbnails."""

from __future__ import annotations

import base64

import numpy as np

from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.geometry.se3 import inverse, transform_points
from supermap_cli.memory.images import Thumbnail

CONTEXT_SHARE = 0.8
"""Margin around a place on each side, as a share of its size in the image."""

MIN_CROP_PX, PICTURE_HEIGHT_PX = 36, 180
"""Smallest crop (px of the thumbnail), and the height to which a crop is scaled (px)."""


def data_uri(jpeg: bytes) -> str:
    """A JPEG as a data URI."""
    return "data:image/jpeg;base64," + base64.b64encode(jpeg).decode("ascii")


def crop_around_box(image: Thumbnail, box: Box3D) -> bytes | None:
    """The part of a thumbnail that shows a box, with the box drawn on it, as a JPEG; `None` if it is not visible."""
    import cv2  # noqa: PLC0415 - only where a page with pictures is written

    from supermap_cli.geometry.pictures import decode_bgr  # noqa: PLC0415

    picture = decode_bgr(image.jpeg)
    if picture is None:
        return None
    camera = camera_from_json(image.camera)
    pixels, visible = camera.project(transform_points(inverse(image.T_map_camera), box.corners()))
    if visible.sum() < 2:
        return None
    scale = picture.shape[1] / camera.width
    corners = (pixels + 0.5) * scale - 0.5
    low, high = corners[visible].min(axis=0), corners[visible].max(axis=0)
    if high[0] - low[0] > picture.shape[1] / 2 and camera.full_turn:
        return None  # the box crosses the panorama seam
    half = np.maximum((high - low) * (0.5 + CONTEXT_SHARE), MIN_CROP_PX / 2)
    middle = (low + high) / 2
    u0, v0 = np.floor(np.maximum(middle - half, 0)).astype(int)
    u1, v1 = np.ceil(np.minimum(middle + half, (picture.shape[1], picture.shape[0]))).astype(int)
    if u1 - u0 < 4 or v1 - v0 < 4:
        return None
    scale_up = PICTURE_HEIGHT_PX / (v1 - v0)
    size = (max(1, round((u1 - u0) * scale_up)), PICTURE_HEIGHT_PX)
    shown = cv2.resize(picture[v0:v1, u0:u1], size, interpolation=cv2.INTER_CUBIC)
    drawn = np.round((corners - (u0, v0) + 0.5) * scale_up - 0.5).astype(int)
    for first, second in _BOX_EDGES:
        if visible[first] and visible[second]:
            cv2.line(shown, drawn[first].tolist(), drawn[second].tolist(), (0, 200, 255), 1, cv2.LINE_AA)
    _, jpeg = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return jpeg.tobytes()


_BOTTOM_EDGES = [(i, (i + 1) % 4) for i in range(4)]
_BOX_EDGES = _BOTTOM_EDGES + [(i + 4, j + 4) for i, j in _BOTTOM_EDGES] + [(i, i + 4) for i in range(4)]
"""Corner indices of a box's edges; corners 0-3 are the bottom, 4-7 the top."""
