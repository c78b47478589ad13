"""Reading of recordings: bag formats, message decoding, the TF tree, synchronisation, inspection."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from supermap_cli.errors import SupermapError

if TYPE_CHECKING:
    from supermap_cli.hookspecs import RecordingRequest
    from supermap_cli.recordings.bag_recording import BagRecording


def open_bag_recording(path: Path, request: RecordingRequest) -> BagRecording:
    """Open a ROS 1 `.bag`, a ROS 2 `.db3` or `.mcap`, or a rosbag2 folder.

    Raises `RecordingError` or `CalibrationError` (file, topic, cure) for what cannot be read, or has no camera, neither
    depth nor LiDAR, or no calibration. A recording without motion opens (`streams` has no "poses"); its `poses()`
    raises.
    """
    from supermap_cli.recordings.bag_recording import BagRecording  # noqa: PLC0415 - rosbags and cv2 load lazily
    from supermap_cli.recordings.opening import open_recording  # noqa: PLC0415 - rosbags and cv2 load lazily

    opened = open_recording(path, request)
    try:
        return BagRecording(opened)
    except SupermapError as error:
        error.add_warnings(opened.notes.lines)
        raise
