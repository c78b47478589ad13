"""A route for nav2: the goal of its action FollowWaypoints as YAML, and an MCAP to look at.

Messages: nav2_msgs/action/FollowWaypoints (`poses`, geometry_msgs/PoseStamped[]), nav_msgs/Path,
visualization_msgs/MarkerArray. Stamps are 0, which to TF is the newest transform.
"""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from supermap_cli.errors import ExportError
from supermap_cli.navigation.route import PlannedRoute, PoseView, Waypoint

LIBRARY = "supermap navigate"
PATH_TOPIC, MARKER_TOPIC = "/plan", "/goals"
_PATH, _MARKERS = "nav_msgs/msg/Path", "visualization_msgs/msg/MarkerArray"
_ARROW, _CUBE, _TEXT = 0, 1, 9
"""Marker.ARROW, CUBE and TEXT_VIEW_FACING."""
_GREEN, _BLUE, _WHITE = (0.1, 0.6, 0.2, 1.0), (0.15, 0.4, 0.75, 0.35), (1.0, 1.0, 1.0, 1.0)
"""Red, green, blue and opacity, 0 to 1: of poses, of things, of names."""
_ARROW_SIZE_M = (0.4, 0.08, 0.08)
"""Length, width and height of a pose's arrow in m: about as long as a small robot. Chosen."""
_TEXT_M = 0.2
"""Height of a name's capital letters in m: legible from across a room. Chosen."""


def check_complete(route: PlannedRoute) -> None:
    """Raises `ExportError` for a route of which a goal has no pose: a robot would leave it out without a word."""
    missing = [waypoint for waypoint in route.waypoints if waypoint.pose is None]
    if missing:
        raise ExportError(
            f"{len(missing)} of {len(route.waypoints)} goals have no pose, so no goals were written",
            where=f"'{missing[0].goal}': {missing[0].status}",
            cure="change that goal, or leave it out",
        )


def follow_waypoints_yaml(route: PlannedRoute) -> str:
    """The goal of FollowWaypoints, for `ros2 action send_goal`; `poses` is what nav2's commander takes, too."""
    lines = [f"# {_one_line(route.instruction)}", "poses:"]
    for waypoint in route.waypoints:
        assert waypoint.pose is not None  # noqa: S101 - `check_complete` was asked
        (x, y, z), (qx, qy, qz, qw) = waypoint.pose.position, waypoint.pose.orientation_xyzw
        lines += [
            f"  - header: {{stamp: {{sec: 0, nanosec: 0}}, frame_id: {route.frame_id}}}  # {_one_line(waypoint.goal)}",
            "    pose:",
            f"      position: {{x: {x}, y: {y}, z: {z}}}",
            f"      orientation: {{x: {qx}, y: {qy}, z: {qz}, w: {qw}}}",
        ]
    return "\n".join(lines) + "\n"


def _one_line(text: str) -> str:
    """A text for a comment: nothing in it can end the line."""
    return " ".join("".join(character if character.isprintable() else " " for character in text).split())


def route_mcap(route: PlannedRoute) -> bytes:
    """The way as nav_msgs/Path and the goals as visualization_msgs/MarkerArray, at the end of the map's time."""
    messages = _Messages(route)
    content = BytesIO()
    writer: Any = Writer(content, compression=CompressionType.ZSTD)
    writer.start(profile="ros2", library=LIBRARY)
    for topic, kind, message in ((PATH_TOPIC, _PATH, messages.path()), (MARKER_TOPIC, _MARKERS, messages.markers())):
        text, _ = messages.store.generate_msgdef(kind, ros_version=2)
        schema = writer.register_schema(name=kind, encoding="ros2msg", data=str(text).encode())
        channel = writer.register_channel(topic, "cdr", schema)
        data = bytes(messages.store.serialize_cdr(message, kind))
        writer.add_message(channel, route.seen_until_ns, data, route.seen_until_ns)
    writer.finish()
    return content.getvalue()


class _Messages:
    """Makes the messages of a route."""

    def __init__(self, route: PlannedRoute) -> None:
        self.route = route
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def path(self) -> Any:
        """Poses along the whole way, each heading to the next; at a goal, its own."""
        poses = [self._stamped(self.route.start)]
        for waypoint in self.route.waypoints:
            assert waypoint.pose is not None  # noqa: S101 - `check_complete` was asked
            points = np.array(waypoint.way)
            for at, (x, y) in enumerate(points[:-1]):
                dx, dy = points[at + 1] - points[at]
                half = np.arctan2(dy, dx) / 2
                turned = (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
                poses.append(self._stamped(PoseView((float(x), float(y), 0.0), 2 * float(half), turned)))
            poses.append(self._stamped(waypoint.pose))
        return self._type(_PATH, header=self._header(), poses=poses)

    def markers(self) -> Any:
        """An arrow and a name at each goal, and the box of its thing."""
        markers = [marker for n, waypoint in enumerate(self.route.waypoints) for marker in self._of_goal(n, waypoint)]
        return self._type(_MARKERS, markers=markers)

    def _of_goal(self, number: int, waypoint: Waypoint) -> list[Any]:
        assert waypoint.pose is not None  # noqa: S101 - `check_complete` was asked
        assert waypoint.thing is not None  # noqa: S101 - what has a pose has a thing
        box = waypoint.thing.box
        half = box.yaw / 2
        turned = PoseView(box.center, box.yaw, (0.0, 0.0, float(np.sin(half)), float(np.cos(half))))
        x, y, z = box.center
        above = PoseView((x, y, z + box.size[2] / 2 + _TEXT_M), 0.0, (0.0, 0.0, 0.0, 1.0))
        text = f"{number + 1}: {waypoint.thing.id}"
        return [
            self._marker("goal", number, kind=_ARROW, pose=waypoint.pose, scale=_ARROW_SIZE_M, colour=_GREEN),
            self._marker("thing", number, kind=_CUBE, pose=turned, scale=box.size, colour=_BLUE),
            self._marker("name", number, kind=_TEXT, pose=above, scale=(0.0, 0.0, _TEXT_M), colour=_WHITE, text=text),
        ]

    def _marker(
        self,
        namespace: str,
        number: int,
        *,
        kind: int,
        pose: PoseView,
        scale: tuple[float, float, float],
        colour: tuple[float, float, float, float],
        text: str = "",
    ) -> Any:
        point = self._type("geometry_msgs/msg/Vector3", x=scale[0], y=scale[1], z=scale[2])
        red, green, blue, alpha = colour
        stamp = self._type("builtin_interfaces/msg/Duration", sec=0, nanosec=0)
        none = self._type("sensor_msgs/msg/CompressedImage", header=self._header(), format="", data=np.zeros(0, "u1"))
        return self._type(
            "visualization_msgs/msg/Marker",
            header=self._header(),
            ns=namespace,
            id=number,
            type=kind,
            action=0,
            pose=self._pose(pose),
            scale=point,
            color=self._type("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=alpha),
            lifetime=stamp,
            frame_locked=False,
            points=[],
            colors=[],
            texture_resource="",
            texture=none,
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=self._type("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, "u1")),
            mesh_use_embedded_materials=False,
        )

    def _stamped(self, pose: PoseView) -> Any:
        return self._type("geometry_msgs/msg/PoseStamped", header=self._header(), pose=self._pose(pose))

    def _pose(self, pose: PoseView) -> Any:
        (x, y, z), (qx, qy, qz, qw) = pose.position, pose.orientation_xyzw
        position = self._type("geometry_msgs/msg/Point", x=x, y=y, z=z)
        orientation = self._type("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw)
        return self._type("geometry_msgs/msg/Pose", position=position, orientation=orientation)

    def _header(self) -> Any:
        now = self.route.seen_until_ns
        stamp = self._type("builtin_interfaces/msg/Time", sec=now // 10**9, nanosec=now % 10**9)
        return self._type("std_msgs/msg/Header", stamp=stamp, frame_id=self.route.frame_id)

    def _type(self, msgtype: str, **fields: Any) -> Any:
        return self.store.types[msgtype](**fields)
