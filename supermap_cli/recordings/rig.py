"""A camera's rig: its colour camera, its depth camera, and where they sit on the robot."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.errors import CalibrationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import Camera
from supermap_cli.recordings.calibration import camera_from_calibration, panorama_camera
from supermap_cli.recordings.motion import PoseSource
from supermap_cli.recordings.pose_topics import BASE_NAMES, last_part
from supermap_cli.recordings.roles import role_name
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_names import is_on_colors_pixels, is_rectified
from supermap_cli.recordings.topic_plan import CameraPlan, TopicPlan
from supermap_cli.recordings.transforms import TransformTree
from supermap_cli.types.sensing import MAIN_CAMERA


@dataclass(frozen=True)
class DepthRig:
    """How depth images relate to colour: `aligned` ones lie on the colour camera's own pixels.

    Where `T_color_depth` (4, 4) is given, it and not TF places the depth camera; TF's frame is then the depth camera's.
    """

    camera: Camera
    frame_id: str
    aligned: bool
    T_color_depth: FloatArray | None = None


@dataclass(frozen=True)
class CameraRig:
    """One colour camera and its depth camera. `depth` is `None` where a LiDAR stands in."""

    base_frame: str
    color_frame: str
    camera: Camera
    depth: DepthRig | None


class RigBuilder:
    """Puts a camera's rig together from what was found. Every `CalibrationError` names file, topic and cure."""

    def __init__(self, plan: TopicPlan, tree: TransformTree, forced_model: str | None, *, where: str) -> None:
        self._plan = plan
        self._tree = tree
        self._forced_model = forced_model
        self._where = where

    def build(self, camera: CameraPlan, base_frame: str, source: PoseSource | None) -> CameraRig:
        """The rig of a camera that has colour images. Raises `CalibrationError`."""
        color, color_frame = camera.color, camera.frame_id
        model = self._model(color, camera.topic("camera_info"), role_name("camera_info", camera.camera_id))
        place, name = f"{self._where}, {color.name}", role_name("camera", camera.camera_id)
        check_mounting(self._tree, base_frame, color_frame, source, where=place, role=name)
        depth, lidar = camera.topic("depth"), self._plan.topic("lidar")
        if depth is None and lidar is not None:
            place = f"{self._where}, {lidar.name}"
            check_mounting(self._tree, base_frame, lidar.frame_id, source, where=place, role="lidar")
        depth_rig = None if depth is None else self._depth_rig(depth, camera, model)
        return CameraRig(base_frame, color_frame, model, depth_rig)

    def _model(self, image: Topic, info: Topic | None, role: str) -> Camera:
        if image.size is None or min(image.size) <= 0:
            raise CalibrationError(
                "the images have no size", where=f"{self._where}, {image.name}", cure="name another topic with --topic"
            )
        if self._forced_model == "equirectangular":
            try:
                return panorama_camera(image.size)
            except CalibrationError as error:
                raise CalibrationError(error.what, where=f"{self._where}, {image.name}", cure=error.cure) from error
        place = f"{self._where}, {info.name if info else image.name}"
        if info is None or info.calibration is None:
            raise CalibrationError(
                "no calibration for the camera",
                where=place,
                cure=f"record its camera_info, or name it with --topic {role}=/...; full panoramas need none: --camera "
                "equirectangular",
            )
        try:
            return camera_from_calibration(info.calibration, image.size, is_rectified(image.name))
        except CalibrationError as error:
            raise CalibrationError(error.what, where=place, cure=error.cure) from error

    def _depth_rig(self, depth: Topic, camera: CameraPlan, model: Camera) -> DepthRig:
        """Depth is aligned when named so, or in the colour's frame with its intrinsics; both at the same size."""
        color_frame, info = camera.frame_id, camera.topic("depth_camera_info")
        frame_id = depth.frame_id or (info.frame_id if info else "")
        named_aligned = is_on_colors_pixels(depth.name)
        same_frame = named_aligned or not frame_id or frame_id == color_frame
        if same_frame and depth.size == camera.color.size and (named_aligned or info is None or self._forced_model):
            return DepthRig(model, color_frame, aligned=True)
        role = role_name("depth_camera_info", camera.camera_id)
        depth_model = self._model(depth, info or (camera.topic("camera_info") if same_frame else None), role)
        if same_frame:
            return DepthRig(depth_model, color_frame, aligned=depth_model == model)
        place = f"{self._where}, {depth.name}"
        check_mounting(self._tree, color_frame, frame_id, None, where=place, role=role_name("depth", camera.camera_id))
        if camera.camera_id != MAIN_CAMERA and self._looks_away(color_frame, frame_id):
            raise CalibrationError(
                f"the depth camera {frame_id!r} looks away from what the camera {camera.camera_id!r} sees",
                where=place,
                cure=f"name the depth that belongs to it with --topic {role_name('depth', camera.camera_id)}=/...",
            )
        return DepthRig(depth_model, frame_id, aligned=False)

    def _looks_away(self, color_frame: str, depth_frame: str) -> bool:
        """Whether two optical axes are more than a right angle apart, so that the images show different things."""
        T_color_depth = self._tree.lookup(color_frame, depth_frame, 0)
        return T_color_depth is not None and bool(T_color_depth[2, 2] < 0)


def check_mounting(
    tree: TransformTree, base: str, sensor: str, source: PoseSource | None, *, where: str, role: str
) -> None:
    """Raise `CalibrationError` unless TF says where the sensor sits on the base (or it is the base itself)."""
    if base == sensor:
        return
    try:
        tree.path(base, sensor)
    except CalibrationError as error:
        of_what = f"; {source.description} moves {base!r}" if source else ""
        cure = _mounting_cure(tree, base, sensor, role) if "loop" not in error.what else error.cure
        what = error.what if sensor else "the messages name no frame, so that TF cannot place them"
        raise CalibrationError(f"{what}{of_what}", where=where, cure=cure) from error


def _mounting_cure(tree: TransformTree, base: str, sensor: str, role: str) -> str:
    """What mends a sensor that TF does not place: another base, another frame of the sensor, or its mounting."""
    cures = []
    if sensor in tree.frames:
        top = next(
            (frame for frame in tree.to_root(sensor) if last_part(frame) in BASE_NAMES), tree.to_root(sensor)[-1]
        )
        if top != sensor:
            cures.append(f"say that {base!r} is {top!r} with --frame base={top}")
            cures.append(f'or give the link: --mount {base}="{top} X Y Z ROLL PITCH YAW"')
    else:
        optical = [frame for frame in sorted(tree.frames) if "optical" in frame and tree.connects(base, frame)]
        if optical and role != "lidar":
            cures.append(f"name the frame that is meant: --frame {role}={optical[0]} (TF has {', '.join(optical)})")
        cures.append(f'say where it sits on the base, in metres and radians: --mount {role}="X Y Z ROLL PITCH YAW"')
    cures.append("or name the robot's URDF: --rig robot.urdf")
    return ", ".join([*cures, f"or record /tf_static with {base!r} -> {sensor or 'the sensor'!r}"])
