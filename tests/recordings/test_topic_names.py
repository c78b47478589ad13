"""What the names of topics say."""

import pytest

from supermap_cli.recordings.topic_names import (
    camera_ids,
    common_parts,
    device_of,
    is_infrared,
    is_on_colors_pixels,
    is_rectified,
    names_depth,
    namespace_of,
)


@pytest.mark.parametrize(
    ("topic", "namespace", "rectified"),
    [
        ("/camera/color/image_raw", "/camera/color", False),
        ("/camera/color/image_raw/compressed", "/camera/color", False),
        ("/camera/depth/image_rect/compressedDepth", "/camera/depth", True),
        ("/direct/image", "/direct", False),
        ("/zed/zed_node/rgb/color/rect/image", "/zed/zed_node/rgb/color/rect", True),
        ("/zed/zed_node/rgb/color/raw/image", "/zed/zed_node/rgb/color/raw", False),
        ("/image", "", False),
    ],
)
def test_names_are_taken_apart(topic, namespace, rectified):
    assert namespace_of(topic) == namespace
    assert is_rectified(topic) == rectified


@pytest.mark.parametrize(
    ("topics", "device"),
    [
        (["/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw", "/rgb/image_raw", "/detections"], ()),
        (
            [
                "/camera_front/color/image_raw/compressed",
                "/camera_front/aligned_depth_to_color/image_raw/compressedDepth",
                "/camera_front/detections",
                "/camera_front/masks",
            ],
            ("camera_front",),
        ),
        (["/spot/camera/frontleft/image", "/spot/depth_registered/frontleft/camera_info"], ("spot", "frontleft")),
        (["/kinect2/hd/image_color", "/kinect2/qhd/image_color_rect", "/kinect2/sd/image_depth"], ("kinect2",)),
        (["/zed/zed_node/rgb/image_rect_color", "/zed/zed_node/depth/depth_registered"], ("zed", "zed_node")),
        (["/zed/zed_node/left/image_rect_color"], ("zed", "zed_node", "left")),
        (["/rgbd_camera/depth_image", "/rgbd_camera/image"], ()),
    ],
)
def test_all_streams_of_a_device_say_the_same_device(topics, device):
    assert {device_of(topic) for topic in topics} == {device}


@pytest.mark.parametrize(
    ("prefixes", "ids"),
    [
        (["/camera_front", "/camera_left", "/camera_right"], ("front", "left", "right")),
        (["/cam_left", "/cam_right"], ("left", "right")),
        (["/front/realsense", "/rear/realsense"], ("front", "rear")),
        (["/spot/camera/frontleft", "/spot/camera/frontright"], ("frontleft", "frontright")),
        (["/cam0", "/cam1"], ("cam0", "cam1")),
        (["/kinect_1", "/kinect_2"], ("kinect_1", "kinect_2")),
        (["/CAM_FRONT", "/CAM_FRONT_LEFT"], ("front", "front_left")),
        (["/camera", "/camera_rear"], ("camera", "rear")),
        (["/realsense/1", "/realsense/2"], ("realsense_1", "realsense_2")),
        (["/1", "/2"], ("camera_1", "camera_2")),
        (["/a_b", "/a/b"], ("camera_1", "camera_2")),
    ],
)
def test_cameras_are_called_by_what_distinguishes_them(prefixes, ids):
    assert camera_ids([device_of(f"{prefix}/color/image_raw") for prefix in prefixes]) == ids


def test_common_parts_are_counted_from_the_front():
    assert common_parts("/a/b/c", "/a/b/d") == 3
    assert common_parts("/a", "/b") == 1


@pytest.mark.parametrize(
    ("topic", "is_depth"),
    [
        ("/camera/depth/image_raw", True),
        ("/camera/aligned_depth_to_color/image_raw", True),
        ("/oakd/rgb/preview/depth", True),
        ("/kinect2/qhd/image_depth_rect", True),
        ("/depth_camera_front/color/image_raw", False),
        ("/depth_camera_front/rgb/image_rect", False),
        ("/camera/color/image_raw", False),
        ("/image", False),
    ],
)
def test_of_the_parts_that_say_depth_or_colour_the_last_counts(topic, is_depth):
    assert names_depth(topic) == is_depth


def test_words_are_whole_words():
    assert is_on_colors_pixels("/camera/aligned_depth_to_color/image_raw")
    assert is_on_colors_pixels("/camera/depth_registered/image")
    assert not is_on_colors_pixels("/camera/depth/image_unaligned")
    assert all(
        is_infrared(topic) for topic in ("/camera/ir/image", "/camera/left_ir/image", "/image_ir_rect", "/ir2/image")
    )
    assert not any(is_infrared(topic) for topic in ("/irobot/image", "/first/image", "/camera/image"))
