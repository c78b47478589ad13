"""`supermap export map.mcap`, read back by the mcap reader with ROS 2 decoding, entity by entity."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import foxglove.messages as foxglove_messages
import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from supermap_cli.exporting.ros import recording
from supermap_cli.exporting.ros.definitions import typestore
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.se3 import make_transform, rotation_from_quaternion_xyzw
from supermap_cli.types.memory import MapDelta, StateRecord
from support import kitchen
from support import memories as m
from support.cli import supermap

Messages = dict[str, list[tuple[int, Any]]]


def read(path: Path) -> Messages:
    """By topic, the log time and the decoded message."""
    found: Messages = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((message.log_time, decoded))
    return found


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("ros")
    db = kitchen.make_kitchen(folder / "map.db")
    result = supermap("export", "--db", db, "--out", folder / "map.mcap")
    assert result.exit_code == 0, result.output or repr(result.exception)
    return SimpleNamespace(db=db, path=folder / "map.mcap", messages=read(folder / "map.mcap"))


def at(messages: list[tuple[int, Any]], seconds: float) -> Any:
    """What holds at a time: the last message by then, as a player shows it that jumps there."""
    return [message for stamp, message in messages if stamp <= m.ns(seconds)][-1]


def ids(scene: Any) -> set[str]:
    return {entity.id for entity in scene.entities}


def test_each_scene_says_what_stands_then(exported: SimpleNamespace) -> None:
    scenes = exported.messages[recording.SCENE]
    monday = {"dining-table-1", "cup-1", "chair-1", "chair-2", "tv-1", "potted-plant-1", "book-1"}
    assert ids(at(scenes, 0.5)) == set(), "nothing had been seen yet"
    assert ids(at(scenes, 50)) == monday
    assert ids(at(scenes, 1100)) == (monday | {"vase-1", "lamp-1"}) - {"cup-1"}
    assert all([d.type for d in scene.deletions] == [1] for _, scene in scenes), "a scene replaces what was before"


def test_an_entity_is_the_thing_with_its_metadata(exported: SimpleNamespace) -> None:
    scene = at(exported.messages[recording.SCENE], 1100)
    (chair,) = (entity for entity in scene.entities if entity.id == "chair-1")
    (cube,), (text,) = chair.cubes, chair.texts
    position, size = cube.pose.position, cube.size
    assert (position.x, position.y, position.z) == (-3.0, 3.0, 0.5)
    assert (size.x, size.y, size.z) == m.SIZE
    assert text.text == "chair-1"
    said = {pair.key: pair.value for pair in chair.metadata}
    assert (said["label"], said["presence"]) == ("chair", "present")
    assert chair.frame_id == "map"
    assert (chair.lifetime.sec, chair.lifetime.nanosec) == (0, 0)


def test_what_nobody_can_say_is_pale_and_has_a_question_mark(exported: SimpleNamespace) -> None:
    """Tuesday at 1000 s: whether the cup still stands there is known from 1005 s on only."""
    scene = at(exported.messages[recording.SCENE], 1003)
    (cup,) = (entity for entity in scene.entities if entity.id == "cup-1")
    assert cup.texts[0].text == "cup-1?"
    assert cup.cubes[0].color.a < 0.5
    assert {pair.key: pair.value for pair in cup.metadata}["presence"] == "unknown"


def test_markers_and_detections_say_the_same_as_the_scene(exported: SimpleNamespace) -> None:
    topics = [exported.messages[name] for name in (recording.SCENE, recording.MARKERS, recording.OBJECTS)]
    assert len({len(messages) for messages in topics}) == 1
    for (_, scene), (_, markers), (_, found) in zip(*topics, strict=True):
        assert markers.markers[0].action == 3
        boxes = [marker for marker in markers.markers if marker.ns == "boxes"]
        assert len({(marker.ns, marker.id) for marker in markers.markers[1:]}) == 2 * len(scene.entities)
        for entity, marker, detection in zip(scene.entities, boxes, found.detections, strict=True):
            assert detection.id == entity.id
            assert detection.results[0].hypothesis.class_id == {p.key: p.value for p in entity.metadata}["label"]
            for other in (marker.pose, detection.bbox.center):
                assert str(other.position) == str(entity.cubes[0].pose.position)
                assert str(other.orientation) == str(entity.cubes[0].pose.orientation)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5, 3.1])
def test_quaternions_turn_the_box_as_it_stands(tmp_path: Path, yaw: float) -> None:
    box = Box3D(np.array([1.0, 2.0, 0.5]), np.array([2.0, 0.5, 1.0]), yaw)
    state = StateRecord(1, 0, m.ns(1), m.ns(2), None, None, box.center, box, "bed", 0.9)
    delta = MapDelta(keyframes=m.keyframes([1, 2]), instances=(m.instance(1, "bed"),), states=(state,))
    db = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    assert supermap("export", "--db", db, "--out", tmp_path / "map.mcap").exit_code == 0
    marker = read(tmp_path / "map.mcap")[recording.MARKERS][-1][1].markers[1]
    q, p, s = marker.pose.orientation, marker.pose.position, marker.scale
    T = make_transform(rotation_from_quaternion_xyzw([q.x, q.y, q.z, q.w]), [p.x, p.y, p.z])
    corners = np.array([[i, j, k, 2] for k in (-1, 1) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]) / 2
    placed = (corners * [s.x, s.y, s.z, 1]) @ T.T
    np.testing.assert_allclose(placed[:, :3], box.corners(), atol=1e-9)


def test_stamps_are_those_of_the_recording(exported: SimpleNamespace) -> None:
    path = exported.messages[recording.PATH][-1][1]
    assert [pose.header.stamp.sec - m.EPOCH_S for pose in path.poses] == [1001, 1040, 1090]
    log_times = [(stamp - m.ns(0)) / 1e9 for stamp, _ in exported.messages[recording.TRANSFORMS]]
    assert log_times == [1, 40, 90, 1001, 1040, 1090]
    for messages in exported.messages.values():
        assert [stamp for stamp, _ in messages] == sorted(stamp for stamp, _ in messages)
    (_, transforms), (_, tf) = exported.messages[recording.TRANSFORMS][0], exported.messages[recording.TF][0]
    assert [t.child_frame_id for t in transforms.transforms] == [t.child_frame_id for t in tf.transforms]
    assert {t.parent_frame_id for t in transforms.transforms} == {"map"}


def test_changes_are_a_log(exported: SimpleNamespace) -> None:
    said = [message.message for _, message in exported.messages[recording.CHANGES]]
    assert any(line.startswith("chair-1 moved 3.6") for line in said)
    assert any(line.startswith("cup-1 disappeared") for line in said)


def test_our_definitions_have_the_fields_of_foxgloves_own_in_their_order() -> None:
    store = typestore()
    compared = 0
    for name in ("SceneUpdate", "FrameTransforms", "Log"):
        files = descriptor_pb2.FileDescriptorSet.FromString(getattr(foxglove_messages, name).get_schema().data).file
        for message in (message for file in files for message in file.message_type):
            ours = store.fielddefs.get(f"foxglove_msgs/msg/{message.name}")
            if ours is not None:
                assert [field for field, _ in ours[1]] == [field.name for field in message.field], message.name
                compared += 1
    assert compared >= 12


def test_a_layout_lies_beside_it(exported: SimpleNamespace) -> None:
    layout = json.loads(exported.path.with_suffix(".layout.json").read_text())
    panels = set(layout["configById"])
    placed = {layout["layout"]["first"], *(layout["layout"]["second"][part] for part in ("first", "second"))}
    assert panels == placed
    topics = layout["configById"]["3D!map"]["topics"]
    assert set(topics) <= set(exported.messages)


def test_a_part_of_the_map(exported: SimpleNamespace, tmp_path: Path) -> None:
    options = ("--traversal", "tuesday", "--label", "chair")
    assert supermap("export", "--db", exported.db, "--out", tmp_path / "map.mcap", *options).exit_code == 0
    found = read(tmp_path / "map.mcap")
    assert {entity.id for _, scene in found[recording.SCENE] for entity in scene.entities} == {"chair-1", "chair-2"}
    assert min(stamp for messages in found.values() for stamp, _ in messages) >= m.ns(1000)


def test_a_time_between_two_visits_has_one_statement(exported: SimpleNamespace, tmp_path: Path) -> None:
    result = supermap("export", "--db", exported.db, "--out", tmp_path / "map.mcap", "--at", "2026-01-05T09:05:00Z")
    assert result.exit_code == 0, repr(result.exception)
    ((stamp, scene),) = read(tmp_path / "map.mcap")[recording.SCENE]
    assert stamp == m.ns(300)
    assert {"cup-1", "chair-1"} <= ids(scene)
    assert "lamp-1" not in ids(scene)


def test_a_recording_of_a_robot_is_not_written_over(exported: SimpleNamespace, tmp_path: Path) -> None:
    foreign = tmp_path / "run.mcap"
    foreign.write_bytes(b"\x89MCAP0\r\n a robot's recording")
    result = supermap("export", "--db", exported.db, "--out", foreign, "--force")
    assert "it is not written over" in str(result.exception)
    assert foreign.read_bytes() == b"\x89MCAP0\r\n a robot's recording"
    assert not list(tmp_path.glob(".*"))
