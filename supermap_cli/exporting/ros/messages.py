"""What stands at a time as ROS 2 messages. All are complete statements: a player that jumps shows what holds there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from supermap_cli.drawing.colours import colour_of
from supermap_cli.exporting.ros import definitions as kinds
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import quaternion_xyzw_from_rotation
from supermap_cli.types.memory import StateRecord

FRAME = "map"
_OPAQUE, _FAINT = 0.6, 0.2
"""How opaque the box is of what stands there, and of what nobody can say."""
_LETTERS_M, _ABOVE_M = 0.12, 0.1
"""m; height of a name's letters, and how far above its box it stands."""
_CUBE, _TEXT, _ADD, _DELETE_ALL = 1, 9, 0, 3
"""visualization_msgs/Marker: CUBE and TEXT_VIEW_FACING; ADD and DELETEALL."""
_ALL, _INFO = 1, 2
"""foxglove_msgs: SceneEntityDeletion.ALL, Log.INFO."""


@dataclass(frozen=True)
class StandingThing:
    """A thing at a time: its number, id and label, its state, whether it is `certain` to stand there, and what else is
    said of it.
    """

    number: int
    id: str
    label: str
    state: StateRecord
    certain: bool
    metadata: Mapping[str, str]


class MapMessages:
    """Makes messages and serialises them."""

    def __init__(self) -> None:
        self.store = kinds.typestore()
        self._texture = self._type(
            "sensor_msgs/msg/CompressedImage", header=self._header(0), format="", data=np.zeros(0, np.uint8)
        )
        self._no_mesh = self._type("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8))

    def definition(self, kind: str) -> bytes:
        """The text of a message's definition with all that it needs."""
        return str(self.store.generate_msgdef(kind, ros_version=2)[0]).encode()

    def scene(self, stamp_ns: int, things: Sequence[StandingThing]) -> bytes:
        """foxglove_msgs/SceneUpdate: everything before is deleted; an entity a thing, its id that of the thing."""
        delete = self._foxglove("SceneEntityDeletion", timestamp=self._time(stamp_ns), type=_ALL, id="")
        entities = [self._entity(stamp_ns, thing) for thing in things]
        return self._bytes(kinds.SCENE, deletions=[delete], entities=entities)

    def markers(self, stamp_ns: int, things: Sequence[StandingThing]) -> bytes:
        """visualization_msgs/MarkerArray: a box and a name each; everything before is deleted."""
        markers = [self._marker(stamp_ns, action=_DELETE_ALL)]
        for thing in things:
            box, alpha = thing.state.box, _OPAQUE if thing.certain else _FAINT
            markers += [
                self._marker(
                    stamp_ns,
                    name=("boxes", thing.number),
                    place=(box.center.tolist(), box.yaw),
                    size=np.maximum(box.size, 1e-3).tolist(),  # RViz warns of a scale of 0
                    colour=(*_colour(thing.label), alpha),
                ),
                self._marker(
                    stamp_ns,
                    kind=_TEXT,
                    name=("names", thing.number),
                    place=(_above(thing.state), 0.0),
                    size=(0.0, 0.0, _LETTERS_M),
                    text=_name(thing),
                ),
            ]
        return self._bytes(kinds.MARKERS, markers=markers)

    def detections(self, stamp_ns: int, things: Sequence[StandingThing]) -> bytes:
        """vision_msgs/Detection3DArray: a detection a thing, its id that of the thing."""
        found = []
        for thing in things:
            box = thing.state.box
            pose = self._pose(box.center.tolist(), box.yaw)
            with_covariance = self._type("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
            score = float(thing.state.confidence)
            hypothesis = self._type("vision_msgs/msg/ObjectHypothesis", class_id=thing.label, score=score)
            result = self._type("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=with_covariance)
            bounds = self._type("vision_msgs/msg/BoundingBox3D", center=pose, size=self._vector(box.size.tolist()))
            values = {"header": self._header(stamp_ns), "results": [result], "bbox": bounds, "id": thing.id}
            found.append(self._type("vision_msgs/msg/Detection3D", **values))
        return self._bytes(kinds.DETECTIONS, header=self._header(stamp_ns), detections=found)

    def path(self, stamp_ns: int, stamps_ns: Sequence[int], T_map_base: FloatArray) -> bytes:
        """nav_msgs/Path: the robot's poses (n, 4, 4) with their stamps."""
        poses = [
            self._type("geometry_msgs/msg/PoseStamped", header=self._header(stamp), pose=self._pose_of(T))
            for stamp, T in zip(stamps_ns, T_map_base, strict=True)
        ]
        return self._bytes(kinds.PATH, header=self._header(stamp_ns), poses=poses)

    def transforms(self, stamp_ns: int, frames: Mapping[str, FloatArray]) -> bytes:
        """foxglove_msgs/FrameTransforms: the frames, by name, in the map."""
        found = [
            self._foxglove(
                "FrameTransform",
                timestamp=self._time(stamp_ns),
                parent_frame_id=FRAME,
                child_frame_id=name,
                translation=self._vector(T[:3, 3].tolist()),
                rotation=self._quaternion(T),
            )
            for name, T in frames.items()
        ]
        return self._bytes(kinds.TRANSFORMS, transforms=found)

    def tf(self, stamp_ns: int, frames: Mapping[str, FloatArray]) -> bytes:
        """tf2_msgs/TFMessage: the same for ROS."""
        found = [
            self._type(
                "geometry_msgs/msg/TransformStamped",
                header=self._header(stamp_ns),
                child_frame_id=name,
                transform=self._type(
                    "geometry_msgs/msg/Transform",
                    translation=self._vector(T[:3, 3].tolist()),
                    rotation=self._quaternion(T),
                ),
            )
            for name, T in frames.items()
        ]
        return self._bytes(kinds.TF, transforms=found)

    def log(self, stamp_ns: int, message: str) -> bytes:
        """foxglove_msgs/Log: a change in words."""
        values = {"level": _INFO, "message": message, "name": "supermap", "file": "", "line": 0}
        return self._bytes(kinds.LOG, timestamp=self._time(stamp_ns), **values)

    def _entity(self, stamp_ns: int, thing: StandingThing) -> Any:
        box, (red, green, blue) = thing.state.box, _colour(thing.label)
        alpha = _OPAQUE if thing.certain else _FAINT
        colour = self._foxglove("Color", r=red, g=green, b=blue, a=alpha)
        size, pose = self._vector(box.size.tolist()), self._pose(box.center.tolist(), box.yaw)
        cube = self._foxglove("CubePrimitive", pose=pose, size=size, color=colour)
        text = self._foxglove(
            "TextPrimitive",
            pose=self._pose(_above(thing.state), 0.0),
            billboard=True,
            font_size=_LETTERS_M,
            scale_invariant=False,
            color=self._foxglove("Color", r=1.0, g=1.0, b=1.0, a=1.0),
            text=_name(thing),
        )
        pairs = [self._foxglove("KeyValuePair", key=key, value=value) for key, value in thing.metadata.items()]
        return self._foxglove(
            "SceneEntity",
            timestamp=self._time(stamp_ns),
            frame_id=FRAME,
            id=thing.id,
            lifetime=self._type("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=True,
            metadata=pairs,
            cubes=[cube],
            texts=[text],
            **{name: [] for name in ("arrows", "spheres", "cylinders", "lines", "triangles", "models")},
        )

    def _marker(
        self,
        stamp_ns: int,
        *,
        kind: int = _CUBE,
        action: int = _ADD,
        name: tuple[str, int] = ("", 0),
        place: tuple[Sequence[float], float] = ((0.0, 0.0, 0.0), 0.0),
        size: Sequence[float] = (1.0, 1.0, 1.0),
        colour: Sequence[float] = (1.0, 1.0, 1.0, 1.0),
        text: str = "",
    ) -> Any:
        """A marker; `name` is its namespace and id, `place` its centre and yaw."""
        red, green, blue, alpha = map(float, colour)
        return self._type(
            "visualization_msgs/msg/Marker",
            header=self._header(stamp_ns),
            ns=name[0],
            id=name[1],
            type=kind,
            action=action,
            pose=self._pose(*place),
            scale=self._vector(size),
            color=self._type("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=alpha),
            lifetime=self._type("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=False,
            points=[],
            colors=[],
            texture_resource="",
            texture=self._texture,
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=self._no_mesh,
            mesh_use_embedded_materials=False,
        )

    def _pose(self, center: Sequence[float], yaw: float) -> Any:
        half = float(yaw) / 2
        turned = self._type("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
        return self._type("geometry_msgs/msg/Pose", position=self._point(center), orientation=turned)

    def _pose_of(self, T: FloatArray) -> Any:
        position = self._point(T[:3, 3].tolist())
        return self._type("geometry_msgs/msg/Pose", position=position, orientation=self._quaternion(T))

    def _quaternion(self, T: FloatArray) -> Any:
        x, y, z, w = quaternion_xyzw_from_rotation(T[:3, :3]).tolist()
        return self._type("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _point(self, xyz: Sequence[float]) -> Any:
        x, y, z = map(float, xyz)
        return self._type("geometry_msgs/msg/Point", x=x, y=y, z=z)

    def _vector(self, xyz: Sequence[float]) -> Any:
        x, y, z = map(float, xyz)
        return self._type("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def _header(self, stamp_ns: int) -> Any:
        return self._type("std_msgs/msg/Header", stamp=self._time(stamp_ns), frame_id=FRAME)

    def _time(self, stamp_ns: int) -> Any:
        seconds, nanoseconds = divmod(int(stamp_ns), 10**9)
        return self._type("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def _foxglove(self, name: str, **fields: Any) -> Any:
        return self._type(f"foxglove_msgs/msg/{name}", **fields)

    def _bytes(self, kind: str, **fields: Any) -> bytes:
        return bytes(self.store.serialize_cdr(self._type(kind, **fields), kind))

    def _type(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)


def _colour(label: str) -> tuple[float, float, float]:
    red, green, blue = colour_of(label)
    return red / 255, green / 255, blue / 255


def _above(state: StateRecord) -> list[float]:
    x, y, _ = state.box.center.tolist()
    return [x, y, state.box.z_max + _ABOVE_M]


def _name(thing: StandingThing) -> str:
    return thing.id if thing.certain else f"{thing.id}?"
