"""Recorded detections of every message type that is read, as boxes with labels, each type by one reader.

Sources: vision_msgs of ROS 1, of Foxy and Galactic and 4.x; yolo_msgs and yolov8_msgs (yolo_ros); ultralytics_ros;
darknet_ros_msgs; depthai_ros_msgs; zed_msgs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.messages import header_of, stamp_ns_of
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, cut_mask, no_detections, plain_hypotheses
from supermap_cli.types.sensing import MAIN_CAMERA

_ZED_PERCENT = 100.0
"""zed_msgs gives confidence in percent, 1 to 99."""


@dataclass(frozen=True)
class _Found:
    """One detection as it was recorded: labels with scores, (u0, v0, u1, v1) in pixels, its mask if it has one."""

    hypotheses: tuple[tuple[str, float], ...]
    box_xyxy: tuple[float, float, float, float]
    mask: RegionMask | None = None


def read_detections(
    message: Any, stamp_ns: int, camera_id: str = MAIN_CAMERA, limits: Limits | None = None
) -> Detections:
    """A camera's detections of any type in `DETECTION_TYPES`, its stamp that of the image.

    The k-th of them belongs to the array's k-th detection: one without a usable label or box is kept as an empty box
    of score 0, so that mask numbers stay right (drop it after the masks are in). Raises what readers of a message that
    is not what its type says raise.
    """
    limits = limits or Limits()
    items = list(_items(message))
    if len(items) > limits.list_items:
        raise ValueError(f"{len(items)} detections, the limit list_items allows {limits.list_items}")
    if not items:
        return no_detections(stamp_ns, camera_id)
    found = [_found(item) for item in items]
    with np.errstate(over="ignore"):
        boxes = np.array([each.box_xyxy for each in found], np.float32)
    hypotheses = tuple(_ranked(each.hypotheses, limits) for each in found)
    broken = ~np.isfinite(boxes).all(axis=1)
    boxes[broken] = 0
    scores = np.array([ranked[0].score for ranked in hypotheses], np.float32)
    scores[broken] = 0
    return Detections(stamp_ns, boxes, scores, hypotheses, tuple(each.mask for each in found), camera_id)


def own_stamp_ns(message: Any) -> int | None:
    """The stamp of the image by what a message says of it besides its own header: darknet's `image_header`, the array
    that ultralytics_ros wraps, or the headers of the detections where they agree; `None` where nothing says it.
    """
    if hasattr(message, "image_header"):
        return stamp_ns_of(message.image_header.stamp) or None
    inner = getattr(message, "detections", None)
    if hasattr(inner, "detections"):
        return header_of(inner, 0)[0] or own_stamp_ns(inner)
    stamps = {stamp_ns_of(item.header.stamp) for item in _items(message) if hasattr(item, "header")}
    return stamps.pop() or None if len(stamps) == 1 else None


def _items(message: Any) -> Iterable[Any]:
    for name in ("detections", "bounding_boxes", "objects"):
        if hasattr(message, name):
            listed = getattr(message, name)
            return _items(listed) if hasattr(listed, "detections") else listed
    raise ValueError("no list of detections")


def _found(item: Any) -> _Found:
    for field, reader in _READERS.items():
        if hasattr(item, field):
            return reader(item)
    raise ValueError("a detection of an unknown layout")


def _of_vision(item: Any) -> _Found:
    """vision_msgs and depthai: `class_id` or `id` is the label, in an inner hypothesis or not."""
    hypotheses = []
    for result in item.results:
        inner = getattr(result, "hypothesis", result)
        label = inner.class_id if hasattr(inner, "class_id") else inner.id
        hypotheses.append((str(label), float(inner.score)))
    center, box = getattr(item.bbox.center, "position", item.bbox.center), item.bbox
    return _Found(tuple(hypotheses), _around(center.x, center.y, box.size_x, box.size_y))


def _of_yolo(item: Any) -> _Found:
    """yolo_msgs: a name, a score, a box, and a mask as a polygon."""
    label = str(item.class_name) or str(item.class_id)
    box = item.bbox
    xyxy = _around(box.center.position.x, box.center.position.y, box.size.x, box.size.y)
    return _Found(((label, float(item.score)),), xyxy, _polygon(getattr(item, "mask", None)))


def _of_darknet(item: Any) -> _Found:
    label = str(getattr(item, "class_id", "") or getattr(item, "Class", "") or item.id)
    return _Found(
        ((label, float(item.probability)),), (float(item.xmin), float(item.ymin), float(item.xmax), float(item.ymax))
    )


def _of_zed(item: Any) -> _Found:
    corners = np.array([np.asarray(corner.kp, np.float64)[:2] for corner in item.bounding_box_2d.corners])
    (u0, v0), (u1, v1) = corners.min(axis=0), corners.max(axis=0)
    return _Found(
        ((str(item.label), float(item.confidence) / _ZED_PERCENT),), (float(u0), float(v0), float(u1), float(v1))
    )


_READERS: Mapping[str, Callable[[Any], _Found]] = {
    "results": _of_vision,
    "class_name": _of_yolo,
    "probability": _of_darknet,
    "bounding_box_2d": _of_zed,
}
"""A field that only one layout has, and its reader."""


def _around(u: float, v: float, width: float, height: float) -> tuple[float, float, float, float]:
    half_width, half_height = float(width) / 2, float(height) / 2
    return float(u) - half_width, float(v) - half_height, float(u) + half_width, float(v) + half_height


def _polygon(mask: Any) -> RegionMask | None:
    """The region of a polygon in pixels; `None` where there is none."""
    points = [] if mask is None else [(float(point.x), float(point.y)) for point in mask.data]
    outline = np.array(points, np.float64).reshape(-1, 2)
    if len(outline) < 3 or not np.isfinite(outline).all() or np.abs(outline).max() > 1 << 14:
        return None
    corners = np.rint(outline).astype(np.int32)
    u0, v0 = np.maximum(corners.min(axis=0), 0)
    width, height = np.maximum(corners.max(axis=0) + 1 - (u0, v0), 0)
    if not width or not height:
        return None
    pixels = np.zeros((int(height), int(width)), np.uint8)
    cv2.fillPoly(pixels, [corners - np.array([u0, v0], np.int32)], 1)
    region = cut_mask(pixels.astype(bool))
    return None if region is None else RegionMask(region.u0 + int(u0), region.v0 + int(v0), region.pixels)


def _ranked(hypotheses: Iterable[tuple[str, float]], limits: Limits) -> tuple[Hypothesis, ...]:
    """Best first; never empty."""
    read = []
    for label, score in hypotheses:
        if len(label) > limits.string_bytes:
            raise ValueError(f"a label of {len(label)} characters, the limit string_bytes allows {limits.string_bytes}")
        if np.isfinite(score):
            read.append(Hypothesis(label, min(max(score, 0.0), 1.0)))
    return plain_hypotheses(read) or (Hypothesis("object", 0.0),)
