"""Recorded detections as people record them: other types and layouts, other stamps, numbers for names."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from supermap_cli.errors import DetectorError, RecordingError
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_recorded.detector import RecordedDetector
from support import bags
from support.detection_types import BOX, HEADER, TYPES

FRAME = "camera_optical_frame"
BOX_XYXY = (24, 16, 40, 32)


def write(path: Path, put, *, types=None, frames=3, **options) -> Path:
    """A small recording whose detections `put(bag, index)` writes."""
    K = (bags.FOCAL, bags.FOCAL, 31.5, 23.5)
    with bags.BagWriter(path, **options) as bag:
        for package, texts in (types or {}).items():
            found = {}
            for name, text in texts.items():
                found |= get_types_from_msg(text, f"{package}/msg/{name}")
            bag._store.register(found)
        for index in range(frames):
            at = bags.stamp(index)
            bag.camera_info("/camera/camera_info", at, FRAME, (bags.WIDTH, bags.HEIGHT), K)
            bag.image("/camera/image", at, FRAME, bags.color_image(index), "rgb8")
            bag.image("/camera/depth", at, FRAME, bags.depth_image(), "16UC1")
            bag.odometry("/odom", at, np.eye(4), child_frame_id=FRAME)
            put(bag, index)
    return path


def put_yolo(bag, index):
    def point(x, y):
        return bag.type("yolo_msgs/msg/Point2D", x=float(x), y=float(y))

    outline = [point(25, 17), point(39, 17), point(39, 31), point(25, 31)]
    one = bag.type(
        "yolo_msgs/msg/Detection",
        class_id=1,
        class_name="Potted_Plant",
        score=0.9,
        bbox=bag.type(
            "yolo_msgs/msg/BoundingBox2D",
            center=bag.type("yolo_msgs/msg/Pose2D", position=point(32, 24), theta=0.0),
            size=bag.type("yolo_msgs/msg/Vector2", x=16.0, y=16.0),
        ),
        mask=bag.type("yolo_msgs/msg/Mask", height=48, width=64, data=outline),
    )
    message = bag.type("yolo_msgs/msg/DetectionArray", header=bag.header(bags.stamp(index), FRAME), detections=[one])
    bag.write("/yolo/detections", "yolo_msgs/msg/DetectionArray", message, bags.stamp(index))


def put_darknet(bag, index):
    done = bags.stamp(index) + 60_000_000
    u0, v0, u1, v1 = BOX_XYXY
    box = bag.type(
        "darknet_ros_msgs/msg/BoundingBox",
        probability=0.9,
        xmin=u0,
        ymin=v0,
        xmax=u1,
        ymax=v1,
        id=3,
        class_id="potted_plant",
    )
    message = bag.type(
        "darknet_ros_msgs/msg/BoundingBoxes",
        header=bag.header(done, FRAME),
        image_header=bag.header(bags.stamp(index), FRAME),
        bounding_boxes=[box],
    )
    bag.write("/darknet_ros/bounding_boxes", "darknet_ros_msgs/msg/BoundingBoxes", message, done)


def put_depthai(bag, index):
    one = bag.type(
        "depthai_ros_msgs/msg/SpatialDetection",
        results=[bag.type("depthai_ros_msgs/msg/ObjectHypothesis", class_id="potted plant", score=0.9)],
        bbox=bag.type(
            "depthai_ros_msgs/msg/BoundingBox2D",
            center=bag.type("geometry_msgs/msg/Pose2D", x=32.0, y=24.0, theta=0.0),
            size_x=16.0,
            size_y=16.0,
        ),
        position=bag._vector("Point", (0, 0, 2)),
        is_tracking=False,
        tracking_id="",
    )
    name = "depthai_ros_msgs/msg/SpatialDetectionArray"
    message = bag.type(name, header=bag.header(bags.stamp(index), FRAME), detections=[one])
    bag.write("/oak/nn/detections", name, message, bags.stamp(index))


def put_zed(bag, index):
    u0, v0, u1, v1 = BOX_XYXY
    corners = [
        bag.type("zed_msgs/msg/Keypoint2Di", kp=np.array(corner, np.uint32))
        for corner in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))
    ]
    one = bag.type(
        "zed_msgs/msg/Object",
        label="Potted_plant",
        label_id=1,
        confidence=90.0,
        bounding_box_2d=bag.type("zed_msgs/msg/BoundingBox2Di", corners=corners),
    )
    message = bag.type("zed_msgs/msg/ObjectsStamped", header=bag.header(bags.stamp(index), FRAME), objects=[one])
    bag.write("/zed/obj_det/objects", "zed_msgs/msg/ObjectsStamped", message, bags.stamp(index))


@pytest.mark.parametrize("put", [put_yolo, put_darknet, put_depthai, put_zed])
def test_detections_of_other_types_are_read(tmp_path, put):
    recording = open_bag_recording(write(tmp_path / "run.mcap", put, types=TYPES), RecordingRequest())
    assert recording.detection_stamps_ns().tolist() == [bags.stamp(index) for index in range(3)]
    found = list(recording.detections())
    assert [each.labels for each in found] == [("potted plant",)] * 3
    assert np.allclose(found[0].boxes_xyxy, [BOX_XYXY])
    assert np.allclose(found[0].scores, 0.9)
    assert (found[0].masks[0] is not None) == (put is put_yolo)
    if put is put_yolo:
        region = found[0].masks[0]
        assert (region.u0, region.v0, region.pixels.shape) == (25, 17, (15, 15))


OLD = {
    "tracked": ("string", "sensor_msgs/Image source_img\nbool is_tracking\nstring tracking_id\n"),
    "image": ("string", "sensor_msgs/Image source_img\n"),
    "numbers": ("int64", "sensor_msgs/Image source_img\n"),
    "id": ("string", "string id\n"),
}


def old_vision(id_type: str, tail: str) -> dict[str, str]:
    return {
        "BoundingBox2D": BOX,
        "ObjectHypothesisWithPose": f"{id_type} id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n",
        "Detection2D": f"{HEADER}ObjectHypothesisWithPose[] results\nBoundingBox2D bbox\n{tail}",
        "Detection2DArray": f"{HEADER}Detection2D[] detections\n",
    }


@pytest.mark.parametrize("name", OLD)
def test_older_layouts_without_definitions_are_told_by_their_bytes(tmp_path, name, monkeypatch):
    id_type, tail = OLD[name]
    monkeypatch.setattr("support.bag_writer.OLD_VISION", old_vision(id_type, tail))

    def put(bag, index):
        at = bags.stamp(index)
        extra = {}
        if "source_img" in tail:
            pixels = {"height": 0, "width": 0, "encoding": "", "is_bigendian": 0, "step": 0}
            image = bag.type("sensor_msgs/msg/Image", header=bag.header(0, ""), data=np.zeros(0, np.uint8), **pixels)
            extra = {"source_img": image}
        if "tracking" in tail:
            extra |= {"is_tracking": False, "tracking_id": ""}
        if "string id" in tail:
            extra = {"id": "7"}
        label = 3 if id_type == "int64" else "cup"
        result = bag.type(
            "vision_msgs/msg/ObjectHypothesisWithPose", id=label, score=0.9, pose=bag._pose_with_covariance(np.eye(4))
        )
        box = bag.type(
            "vision_msgs/msg/BoundingBox2D",
            center=bag.type("geometry_msgs/msg/Pose2D", x=32.0, y=24.0, theta=0.0),
            size_x=16.0,
            size_y=16.0,
        )
        header = bag.header(at, FRAME)
        one = bag.type("vision_msgs/msg/Detection2D", header=header, results=[result], bbox=box, **extra)
        listed = [] if index == 0 else [one] * index
        message = bag.type("vision_msgs/msg/Detection2DArray", header=header, detections=listed)
        bag.write("/detections", "vision_msgs/msg/Detection2DArray", message, at)

    path = write(tmp_path / "run.db3", put, old_vision=True)
    with sqlite3.connect(path) as connection:
        connection.execute("DELETE FROM message_definitions")
    found = list(open_bag_recording(path, RecordingRequest()).detections())
    assert [each.labels for each in found] == [(), *((("3",) if name == "numbers" else ("cup",)) * n for n in (1, 2))]
    assert np.allclose(found[1].boxes_xyxy, [BOX_XYXY])


def put_stamped(header_ns: int | None, own_ns: int | None = None):
    """Detections whose array header is so much off the image's stamp (`None`: unset), and their own headers."""

    def put(bag, index):
        at = bags.stamp(index)
        array = 0 if header_ns is None else at + header_ns
        own = array if own_ns is None else at + own_ns
        one = bag._detection(own, FRAME, [("cup", 0.9)], BOX_XYXY)
        header = bag.header(array, FRAME)
        message = bag.type("vision_msgs/msg/Detection2DArray", header=header, detections=[one])
        bag.write("/detections", "vision_msgs/msg/Detection2DArray", message, at + 30_000_000)

    return put


@pytest.mark.parametrize("put", [put_stamped(0), put_stamped(None, 0), put_stamped(30_000_000, 0), put_stamped(999)])
def test_detections_join_by_header_by_their_own_headers_or_nearly(tmp_path, put):
    recording = open_bag_recording(write(tmp_path / "run.mcap", put), RecordingRequest())
    assert recording.detection_stamps_ns().tolist() == [bags.stamp(index) for index in range(3)]
    assert [each.stamp_ns for each in recording.detections()] == [bags.stamp(index) for index in range(3)]


def test_detections_of_no_image_are_an_error_whose_cure_works(tmp_path):
    path = write(tmp_path / "run.mcap", put_stamped(30_000_000))
    with pytest.raises(RecordingError, match=r"3 detection arrays, none .* 0.030 s off.*--detection-tolerance 0.04 "):
        open_bag_recording(path, RecordingRequest()).detection_stamps_ns()
    recording = open_bag_recording(path, RecordingRequest(detection_tolerance_s=0.04))
    assert recording.detection_stamps_ns().tolist() == [bags.stamp(index) for index in range(3)]


def test_detections_of_a_type_that_is_not_read_are_named(tmp_path):
    types = {"other_msgs": {"Detection": "float64 x\n", "DetectionArray": f"{HEADER}other_msgs/Detection[] things\n"}}

    def put(bag, index):
        header = bag.header(bags.stamp(index), FRAME)
        message = bag.type("other_msgs/msg/DetectionArray", header=header, things=[])
        bag.write("/other/found", "other_msgs/msg/DetectionArray", message, bags.stamp(index))

    recording = open_bag_recording(write(tmp_path / "run.mcap", put, types=types), RecordingRequest())
    assert "detections" not in recording.streams
    assert any("/other/found: detections of the type other_msgs/msg/DetectionArray" in w for w in recording.warnings)


def test_detections_that_cannot_be_decoded_stand_in_nobodys_way(tmp_path):
    def put(bag, index):
        bag.detections("/detections", bags.stamp(index), FRAME, [])
        bag._backend.write(bag._connections["/detections"], bags.stamp(index), b"\0\1\0\0" + b"\xff" * 40)

    path = write(tmp_path / "run.mcap", lambda bag, index: put(bag, index) if index else None)
    recording = open_bag_recording(path, RecordingRequest())
    assert len(list(recording.frames())) == 3


def test_class_numbers_get_the_names_of_a_file_or_a_warning(tmp_path):
    def put(bag, index):
        bag.detections("/detections", bags.stamp(index), FRAME, [([("1", 0.9)], BOX_XYXY), ([("7", 0.5)], BOX_XYXY)])

    recording = open_bag_recording(write(tmp_path / "run.mcap", put), RecordingRequest())
    frame = next(recording.frames())
    unnamed = RecordedDetector(recording)
    assert unnamed.detect(frame).labels == ("1", "7")
    assert "numbers (1, 7)" in unnamed.warnings[0]
    assert "--option recorded.labels=FILE" in unnamed.warnings[0]
    labels = tmp_path / "names.txt"
    labels.write_text("person\nbicycle\n")
    named = RecordedDetector(recording, labels=labels)
    assert named.detect(frame).labels == ("bicycle", "7")
    assert "names.txt names 2 classes" in named.warnings[0]
    with pytest.raises(DetectorError, match="cannot be read"):
        RecordedDetector(recording, labels=tmp_path / "none.txt")
