"""Recorded boxes that are not in pixels of their image: of another resolution, in shares of it, or outside it."""

import numpy as np
import pytest

from supermap_cli.errors import RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.detection_scale import find_box_scale
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask
from support import bags

FRAME = "camera_optical_frame"
SIZE = (bags.WIDTH, bags.HEIGHT)


def write(path, boxes, other_size=None):
    with bags.BagWriter(path) as bag:
        K = (bags.FOCAL, bags.FOCAL, 31.5, 23.5)
        bag.camera_info("/camera/camera_info", bags.START_NS, FRAME, SIZE, K)
        bag.image("/camera/image", bags.START_NS, FRAME, bags.color_image(0), "rgb8")
        bag.image("/camera/depth", bags.START_NS, FRAME, bags.depth_image(), "16UC1")
        bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id=FRAME)
        if other_size is not None:
            bag.camera_info("/detector/camera_info", bags.START_NS, "other", other_size, K)
        bag.detections("/detections", bags.START_NS, FRAME, [([("cup", 0.9)], box) for box in boxes])
    return path


def boxes_of(path):
    recording = open_bag_recording(path, RecordingRequest())
    (found,) = recording.detections()
    return found.boxes_xyxy.round(2).tolist(), recording.warnings


def test_boxes_of_twice_the_resolution_are_halved(tmp_path):
    boxes, warnings = boxes_of(write(tmp_path / "a.mcap", [(10, 20, 30, 40), (100, 40, 120, 90)]))
    assert boxes == [[5, 10, 15, 20], [50, 20, 60, 45]]
    assert any("/detections: the boxes reach to (120, 90) pixels" in line for line in warnings)


def test_boxes_of_a_size_that_the_recording_knows_are_scaled_though_none_reaches_its_edge(tmp_path):
    path = write(tmp_path / "a.mcap", [(30, 30, 90, 90)], other_size=(160, 120))
    assert boxes_of(path)[0] == [[12, 12, 36, 36]]


def test_boxes_in_shares_of_the_image_are_multiplied(tmp_path):
    boxes, warnings = boxes_of(write(tmp_path / "a.mcap", [(0.25, 0.5, 0.5, 1.0)]))
    assert boxes == [[16, 24, 32, 48]]
    assert any("all boxes lie within 0 to 1" in line for line in warnings)


def test_boxes_of_images_of_no_known_size_are_refused(tmp_path):
    recording = open_bag_recording(write(tmp_path / "a.mcap", [(300, 20, 700, 45)]), RecordingRequest())
    with pytest.raises(RecordingError, match=r"of images of another size .*/detections\): .*--topic color="):
        list(recording.detections())


def test_a_lone_box_outside_the_image_is_left_out_and_the_others_stay(tmp_path):
    boxes, warnings = boxes_of(write(tmp_path / "a.mcap", [*[(10, 10, 30, 30)] * 12, (200, 10, 220, 30)]))
    assert boxes == [[10, 10, 30, 30]] * 12
    assert any("1 boxes outside their images left out" in line for line in warnings)


def test_boxes_of_cut_things_that_stick_out_on_all_sides_stay_as_they_are(tmp_path):
    sticking_out = [(-30, -20, 40, 40), (20, 10, 100, 80)]
    boxes, warnings = boxes_of(write(tmp_path / "a.mcap", sticking_out))
    assert boxes == [list(box) for box in sticking_out]
    assert not any("boxes" in line for line in warnings)


def test_masks_that_came_with_their_boxes_are_scaled_with_them():
    mask = RegionMask(100, 40, np.ones((50, 20), bool))
    box = np.array([[100, 40, 120, 90]], np.float32)
    given = Detections(0, box, np.array([0.9], np.float32), ((Hypothesis("cup", 0.9),),), (mask,))
    scaled, outside = find_box_scale([given], SIZE, [], "a.mcap").apply(given)
    assert outside == 0
    assert (scaled.masks[0].u0, scaled.masks[0].v0, scaled.masks[0].pixels.shape) == (50, 20, (25, 10))
