"""Detections whose clock is not the camera's: the offset is applied where it is sure, else the option is named."""

import numpy as np
import pytest

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from support import bags

FRAME = "camera_optical_frame"
SECOND = 1_000_000_000
COUNT = 12
UNEVEN = [int(ns) for ns in np.random.default_rng(1).integers(0, 30_000_000, COUNT)]


def write(path, *, off_ns=0, late_ns=0, uneven=False):
    with bags.BagWriter(path) as bag:
        for index in range(COUNT):
            at = bags.stamp(index) + (UNEVEN[index] if uneven else 0)
            bag.camera_info(
                "/camera/camera_info", at, FRAME, (bags.WIDTH, bags.HEIGHT), (bags.FOCAL, bags.FOCAL, 31.5, 23.5)
            )
            bag.image("/camera/image", at, FRAME, bags.color_image(index), "rgb8")
            bag.image("/camera/depth", at, FRAME, bags.depth_image(), "16UC1")
            bag.odometry("/odom", at, bags.pose_at(index), child_frame_id=FRAME)
            found = [([("cup", 0.9)], (24, 16, 40, 32))]
            bag.detections("/detections", at + off_ns, FRAME, found, log_ns=at + late_ns)
    return path


def joined(path, **clocks):
    recording = open_bag_recording(path, RecordingRequest(clocks={f"/{name}": each for name, each in clocks.items()}))
    stamps = set(recording.detection_stamps_ns().tolist())
    return len(stamps & set(recording.frame_stamps_ns().tolist())), recording.warnings


@pytest.mark.parametrize("late_ns", [0, 80_000_000])
def test_tai_is_told_by_its_37_seconds(tmp_path, late_ns):
    found, warnings = joined(write(tmp_path / "a.mcap", off_ns=37 * SECOND, late_ns=late_ns))
    assert found == COUNT
    assert any("/detections: its clock is" in line and "-37.000 s are added" in line for line in warnings)


@pytest.mark.parametrize("off_ns", [-5 * SECOND, 3 * SECOND + 17, 123 * SECOND - bags.START_NS])
def test_uneven_images_tell_the_offset_exactly_though_the_detector_is_slow(tmp_path, off_ns):
    path = write(tmp_path / "a.mcap", off_ns=off_ns, late_ns=230_000_000, uneven=True)
    assert joined(path)[0] == COUNT


@pytest.mark.parametrize("off_ns", [-5 * SECOND, 123 * SECOND - bags.START_NS])
def test_even_images_leave_it_open_and_the_option_that_is_named_mends_it(tmp_path, off_ns):
    path = write(tmp_path / "a.mcap", off_ns=off_ns)
    with pytest.raises(RecordingError, match=r"its clock is .* behind") as failure:
        joined(path)
    named = f"--clock /detections={-off_ns / SECOND:.3f}"
    assert named in failure.value.cure
    assert joined(path, detections=-off_ns / SECOND)[0] == COUNT


def test_a_slow_detector_has_the_cameras_clock(tmp_path):
    found, warnings = joined(write(tmp_path / "a.mcap", late_ns=3 * SECOND))
    assert found == COUNT
    assert not any("clock" in line for line in warnings)
