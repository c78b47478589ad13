"""Recorded detections with their masks, however late either comes."""

import numpy as np
import pytest

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.detection_messages import DetectionArrival, join_masks, with_mask_image
from supermap_cli.types.detections import Detections, Hypothesis, no_detections
from support import bags

SECOND = 1_000_000_000
FRAME = "camera_optical_frame"


def one(stamp_ns, box=(2, 2, 6, 6)):
    boxes = np.array([box], np.float32)
    return Detections(stamp_ns, boxes, np.array([0.9], np.float32), ((Hypothesis("cup", 0.9),),), (None,))


def open_with(path, write, **options):
    with bags.BagWriter(path, **options) as bag:
        write_camera(bag)
        write(bag)
    return open_bag_recording(path, RecordingRequest())


def write_camera(bag):
    K = (bags.FOCAL, bags.FOCAL, 32, 24)
    bag.camera_info("/camera/camera_info", bags.START_NS, FRAME, (bags.WIDTH, bags.HEIGHT), K)
    bag.image("/camera/image", bags.START_NS, FRAME, bags.color_image(0), "rgb8")
    bag.image("/camera/depth", bags.START_NS, FRAME, bags.depth_image(), "16UC1")
    bag.odometry("/odom", bags.START_NS, np.eye(4), child_frame_id=FRAME)


def test_no_messages_are_no_detections():
    assert list(join_masks(iter(()), SECOND)) == []


def test_an_image_in_which_nothing_was_found_is_kept(tmp_path):
    recording = open_with(tmp_path / "a.mcap", lambda bag: bag.detections("/detections", bags.START_NS, FRAME, []))
    (found,) = recording.detections()
    assert len(found) == 0
    assert found.stamp_ns == bags.START_NS
    assert recording.detection_stamps_ns().tolist() == [bags.START_NS]


@pytest.mark.parametrize("options", [{}, {"old_vision": True}], ids=["vision_msgs 4", "old vision_msgs"])
def test_boxes_and_all_hypotheses_are_read(tmp_path, options):
    listed = [([("3", 0.2), ("7", 0.7)], (10, 20, 30, 44)), ([("5", 0.5)], (0, 0, 4, 4))]
    recording = open_with(
        tmp_path / "a.mcap", lambda bag: bag.detections("/detections", bags.START_NS, FRAME, listed), **options
    )
    (found,) = recording.detections()
    assert found.labels == ("7", "5")
    assert [(hypothesis.label, round(hypothesis.score, 3)) for hypothesis in found.hypotheses[0]] == [
        ("7", 0.7),
        ("3", 0.2),
    ]
    assert np.allclose(found.boxes_xyxy, [[10, 20, 30, 44], [0, 0, 4, 4]])
    assert np.allclose(found.scores, [0.7, 0.5])


def test_masks_are_numbered_from_one_and_may_be_late(tmp_path):
    numbers = np.zeros((bags.HEIGHT, bags.WIDTH), np.uint16)
    numbers[20:24, 10:14], numbers[0:2, 0:3] = 1, 2

    def write(bag):
        listed = [([("a", 0.9)], (10, 20, 14, 24)), ([("b", 0.8)], (0, 0, 3, 2)), ([("c", 0.7)], (40, 40, 44, 44))]
        bag.detections("/detections", bags.START_NS, FRAME, listed, log_ns=bags.START_NS + SECOND)
        bag.image("/masks", bags.START_NS, FRAME, numbers, "16UC1", log_ns=bags.START_NS + 4 * SECOND)

    recording = open_with(tmp_path / "a.mcap", write)
    assert recording.streams >= {"detections", "masks"}
    (found,) = recording.detections()
    assert (found.masks[0].u0, found.masks[0].v0, found.masks[0].pixels.shape) == (10, 20, (4, 4))
    assert found.masks[1].pixels.shape == (2, 3)
    assert found.masks[2] is None


def test_a_broken_detection_goes_but_keeps_its_number(tmp_path):
    numbers = np.zeros((bags.HEIGHT, bags.WIDTH), np.uint16)
    numbers[20:24, 10:14] = 2

    def write(bag):
        listed = [([], (0, 0, 4, 4)), ([("b", 0.8)], (10, 20, 14, 24)), ([("c", 0.7)], (np.nan, 0, 4, 4))]
        bag.detections("/detections", bags.START_NS, FRAME, listed)
        bag.image("/masks", bags.START_NS, FRAME, numbers, "16UC1")

    (found,) = open_with(tmp_path / "a.mcap", write).detections()
    assert found.labels == ("b",)
    assert found.masks[0].pixels.all()


def test_a_mask_that_bleeds_out_of_its_box_is_found_whole():
    numbers = np.zeros((60, 80), np.uint16)
    numbers[2:50, 2:70] = 1
    joined = with_mask_image(one(0, (20, 20, 24, 24)), numbers)
    assert joined.masks[0].pixels.shape == (48, 68)


@pytest.mark.parametrize("mask_first", [False, True])
def test_either_may_arrive_first_and_order_is_by_stamp(mask_first):
    numbers = np.ones((8, 8), np.uint16)
    array = DetectionArrival(SECOND, 3 * SECOND, detections=one(SECOND))
    mask = DetectionArrival(SECOND, 3 * SECOND, numbers=numbers)
    later = DetectionArrival(2 * SECOND, 2 * SECOND + 1, detections=no_detections(2 * SECOND))
    arrivals = [later, mask, array] if mask_first else [later, array, mask]
    found = list(join_masks(iter(arrivals), 5 * SECOND))
    assert [detections.stamp_ns for detections in found] == [SECOND, 2 * SECOND]
    assert found[0].masks[0] is not None


def test_what_waits_is_bounded_and_what_is_too_late_is_dropped():
    def arrivals():
        for index in range(20):
            yield DetectionArrival(index * SECOND, index * SECOND, detections=no_detections(index * SECOND))
        yield DetectionArrival(SECOND, 20 * SECOND, detections=one(SECOND))

    found = join_masks(arrivals(), 3 * SECOND)
    assert [detections.stamp_ns // SECOND for detections in found] == list(range(20))
