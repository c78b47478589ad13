"""Depth images that hold no depth, one value, or no plausible metres: what `inspect` and its doctor say."""

import numpy as np
import pytest

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings.inspection import inspect_recording
from support import bags

FRAME = "camera_optical_frame"
DEPTH = "/camera/depth/image_raw"


def verdict_of(path, pixels, encoding="16UC1"):
    with bags.BagWriter(path) as bag:
        for index in range(8):
            at, size, K = bags.stamp(index), (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, 31.5, 23.5)
            bag.camera_info("/camera/color/camera_info", at, FRAME, size, K)
            bag.image("/camera/color/image_raw", at, FRAME, bags.color_image(index), "rgb8")
            bag.image(DEPTH, at, FRAME, pixels, encoding)
            bag.odometry("/odom", at, bags.pose_at(index), child_frame_id=FRAME)
    report = inspect_recording(path, RecordingRequest())
    return next(each for each in report.verdicts if each.role == "depth")


def few():
    pixels = np.zeros((bags.HEIGHT, bags.WIDTH), np.uint16)
    pixels[:3] = np.arange(1500, 1500 + bags.WIDTH)
    return pixels


def missing():
    return np.full((bags.HEIGHT, bags.WIDTH), np.nan, np.float32)


@pytest.mark.parametrize(
    ("pixels", "encoding", "verdict", "why"),
    [
        (np.zeros((bags.HEIGHT, bags.WIDTH), np.uint16), "16UC1", "missing", "no depth: 0.0% of the pixels"),
        (missing(), "32FC1", "missing", "no depth: 0.0% of the pixels"),
        (np.full((bags.HEIGHT, bags.WIDTH), 65535, np.uint16), "16UC1", "missing", "one value only, 65.535 m"),
        (np.full((bags.HEIGHT, bags.WIDTH), 1800, np.uint16), "16UC1", "weak", "one value only, 1.800 m"),
        (bags.depth_image() * 10, "16UC1", "weak", "implausibly far: 20.00 m"),
        ((bags.depth_image() // 100), "16UC1", "weak", "implausibly near: 0.02 m"),
        (few(), "16UC1", "weak", "little depth"),
        (bags.depth_image(), "16UC1", "good", ""),
    ],
)
def test_what_depth_is_worth(tmp_path, pixels, encoding, verdict, why):
    found = verdict_of(tmp_path / "run.mcap", pixels, encoding)
    assert (found.verdict, found.topic) == (verdict, DEPTH)
    assert why in found.why
