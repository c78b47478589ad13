"""What becomes of a variant: what `inspect` chooses, and the map that `build` makes of it or the line it ends with."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from supermap_cli.commands.build_options import override, request
from supermap_cli.config import BuildConfig
from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import SupermapError
from supermap_cli.geometry.se3 import inverse
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.memory import open_store
from supermap_cli.plugin_manager import Plugins
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import Inspection, inspect_recording
from zoo.robot import Image, Robot, Variant
from zoo.scene import LABEL, SEEN, T_world_base

_OPTIONS = {"topic": "topics", "frame": "frames", "mount": "mounts", "clock": "clocks", "option": "options"}
"""Options that may be given several times, by the name that `override` has for them."""


@dataclass(frozen=True)
class BuiltObject:
    """One object of the map: its label, and the middle of its box in metres."""

    label: str
    center: np.ndarray


CLASSES = Path(__file__).parents[2] / "plugins" / "supermap_onnx" / "coco80.txt"
"""The 80 classes of COCO, one a line: coco.txt in options."""


def settings(variant: Variant) -> BuildConfig:
    """The configuration of a build with a variant's options."""
    given: dict[str, list[str] | str | float] = {}
    for option in variant.options:
        name, value = shlex.split(option.replace("coco.txt", str(CLASSES)))
        key = name.removeprefix("--").replace("-", "_")
        if key in _OPTIONS:
            given.setdefault(_OPTIONS[key], []).append(value)  # type: ignore[union-attr]
        else:
            given[key] = float(value) if key == "detection_tolerance" else value
    return override(BuildConfig(), **given)  # type: ignore[arg-type]


def wanted(variant: Variant) -> RecordingRequest:
    """How a variant is opened."""
    return request(settings(variant), None, None)


def expected_roles(variant: Variant) -> dict[str, str]:
    """Role to topic, as `inspect` should choose: "" for none."""
    robot, roles = variant.robot, {}
    several = len(robot.cameras) > 1
    for camera in robot.cameras:
        end = f".{camera.id}" if several else ""
        roles[f"color{end}"] = camera.color.topic
        roles[f"depth{end}"] = "" if camera.depth is None else camera.depth.topic
    roles["lidar"] = robot.lidar.topic if robot.lidar else _only_cloud(robot)
    if robot.motion is not None and robot.motion.kind == "odometry":
        roles["odometry"] = robot.motion.topic
    if not several:
        roles["detections"] = robot.found.topic if robot.found else ""
    return {**{role: topic for role, topic in roles.items() if topic != "?"}, **variant.roles}


def _only_cloud(robot: Robot) -> str:
    """A cloud beside depth images may serve as LiDAR: it is not asked for."""
    return "?" if any(not isinstance(each, Image) for each in robot.others) else ""


def chosen_roles(report: Inspection) -> dict[str, str]:
    """Role to topic, as `inspect` chose."""
    return {f"{each.role}.{each.camera}" if each.camera else each.role: each.topic or "" for each in report.roles}


def inspected(variant: Variant, path: Path) -> Inspection | str:
    """The report, or the line that is printed instead of one."""
    try:
        return inspect_recording(path, wanted(variant))
    except SupermapError as error:
        return str(error)


def problem_lines(report: Inspection | str) -> list[str]:
    """What keeps a build from working, one line each."""
    if isinstance(report, str):
        return [report]
    return [str(SupermapError(each.what, where=each.where, cure=each.cure)) for each in report.problems]


def built(variant: Variant, path: Path, plugins: Plugins, folder: Path) -> tuple[list[BuiltObject], tuple[str, ...]]:
    """The objects that a build maps, in the odometry's frame, and its warnings. Raises what `supermap build` prints."""
    config = settings(variant)
    recording = open_bag_recording(path, wanted(variant))
    with open_store(str(folder / "map.db"), create=True) as store:
        build = TraversalBuild(recording, plugins, config, store, look_ahead=False)
        summary = build.run(name="zoo", align="none")
        objects = [
            BuiltObject(record.label, record.box.center) for record in store.load_instances() if record is not None
        ]
    return objects, summary.warnings


def is_right(objects: Iterable[BuiltObject], variant: Variant) -> bool:
    """Whether the map holds the suitcase where it stands, once, and nothing else."""
    listed = list(objects)
    if len(listed) != 1 or listed[0].label != LABEL:
        return False
    return bool(np.abs(listed[0].center - seen_at(variant)).max() < variant.tolerance_m)


def seen_at(variant: Variant) -> np.ndarray:
    """Where the suitcase is expected (3,): LiDAR odometry begins at the robot."""
    if variant.robot.motion is not None:
        return SEEN
    return np.asarray((inverse(T_world_base(0)) @ np.append(SEEN, 1.0))[:3])
