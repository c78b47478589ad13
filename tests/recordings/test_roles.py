"""How the user names topics."""

import pytest

from supermap_cli.errors import ConfigError
from supermap_cli.recordings.roles import NamedTopics, parse_named_topics, role_name


def test_nothing_named_is_nothing_restricted():
    assert parse_named_topics({}) == NamedTopics()
    assert not NamedTopics().lone_camera


def test_a_role_alone_is_a_lone_cameras_or_the_robots():
    named = parse_named_topics({"color": "/x", "imu": "/imu"})
    assert named.lone_camera
    assert named.of_camera("camera") == {"color": "/x"}
    assert not parse_named_topics({"imu": "/imu"}).lone_camera


def test_a_role_with_a_camera_is_that_cameras():
    named = parse_named_topics({"color.front": "/f", "depth.front": "/d", "color.left": "/l", "lidar": "/points"})
    assert named.color_cameras == ("front", "left")
    assert named.of_camera("front") == {"color": "/f", "depth": "/d"}
    assert named.plain == {"lidar": "/points"}
    assert not named.lone_camera


@pytest.mark.parametrize(
    ("named", "what"),
    [
        ({"colour": "/x"}, r"unknown role 'colour'.*color, depth"),
        ({"colour.front": "/x"}, r"unknown role 'colour'.*color, depth"),
        ({"lidar.front": "/x"}, r"lidar is of no single camera: write --topic lidar=/x"),
        ({"color.": "/x"}, r"--topic color\.: a camera cannot be called ''"),
        ({"color.a b": "/x"}, r"cannot be called 'a b'"),
        ({"color": "/x", "color.left": "/y"}, r"color= names no camera.*'left'.*color\.left="),
        ({"depth": "/x", "color.left": "/y"}, r"depth= names no camera"),
        ({"color.front": "/x", "depth.frnt": "/y"}, r"no color topic is named for the camera 'frnt'.*front"),
        ({"color.front": "/x", "color.left": "/x"}, r"color\.left: /x is named for color\.front already"),
        ({"color.front": "/x", "depth.front": "/x"}, r"depth\.front: /x is named for color\.front already"),
    ],
)
def test_names_that_make_no_sense_are_one_clear_error(named, what):
    with pytest.raises(ConfigError, match=what) as caught:
        parse_named_topics(named)
    assert "\n" not in str(caught.value)


def test_several_cameras_may_share_a_topic_of_detections():
    named = parse_named_topics({"color.a": "/a", "color.b": "/b", "detections.a": "/found", "detections.b": "/found"})
    assert named.of_camera("b")["detections"] == "/found"


def test_roles_are_written_as_they_are_named():
    assert role_name("color", "camera") == "color"
    assert role_name("color", "front") == "color.front"
