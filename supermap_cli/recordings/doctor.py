"""A verdict for every role of a recording, with the option that mends it, and all choices made explicit."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.mounting import is_sensor
from supermap_cli.recordings.opening import OpenedRecording
from supermap_cli.recordings.roles import role_name
from supermap_cli.recordings.tf_survey import is_static

Verdict = Literal["good", "weak", "missing"]


@dataclass(frozen=True)
class RoleVerdict:
    """What a role is worth to a build: `why` it is not good, and the `cure`; "" where there is nothing to mend."""

    role: str
    verdict: Verdict
    topic: str | None
    why: str
    cure: str


_WITHOUT: Mapping[str, tuple[Verdict, str, str]] = {
    "color": ("missing", "no camera images", "--topic color=/..."),
    "depth": ("missing", "no depth images and no LiDAR", "--topic depth=/... or --topic lidar=/..."),
    "camera_info": ("missing", "no calibration", "--topic camera_info=/... or --camera equirectangular"),
    "motion": ("missing", "no odometry, no motion in TF, no LiDAR", "--topic odometry=/..."),
    "imu": ("weak", "no IMU: the map is levelled by the floors that are seen", "--topic imu=/..."),
    "detections": (
        "missing",
        "no detections are recorded",
        "--detector onnx --option onnx.model=PATH, or --topic detections=/...",
    ),
    "masks": ("weak", "no masks: boxes are cut out by depth", "--topic masks=/..."),
}
"""What it means that nothing serves a role, and the option that names what may."""


def verdicts(
    opened: OpenedRecording, problems: Sequence[RecordingError], warnings: Sequence[str], gaps_s: Mapping[str, float]
) -> Iterator[RoleVerdict]:
    """A verdict for every role, of every camera. `gaps_s` are the longest pauses of the topics that pause."""
    judge = _Judge(opened, problems, warnings, gaps_s)
    for camera in opened.rig.plan.cameras:
        for role in ("color", "depth", "camera_info", "detections", "masks"):
            name = role_name(role, camera.camera_id)
            topic = camera.topic(role)
            if topic is None and role == "depth" and (lidar := opened.rig.plan.topic("lidar")) is not None:
                yield judge.of_topic(name, lidar.name, "made from the LiDAR")
            elif topic is None:
                yield judge.of_nothing(name, role)
            else:
                yield judge.of_topic(name, topic.name)
        yield judge.mounting(role_name("mounting", camera.camera_id))
    for role in ("lidar", "imu"):
        topic = opened.rig.plan.topic(role)
        if topic is not None:
            yield judge.of_topic(role, topic.name)
        elif role in _WITHOUT:
            yield judge.of_nothing(role, role)
    yield judge.motion()


class _Judge:
    """Brings together what is known of each topic."""

    def __init__(
        self,
        opened: OpenedRecording,
        problems: Sequence[RecordingError],
        warnings: Sequence[str],
        gaps_s: Mapping[str, float],
    ) -> None:
        self._opened = opened
        self._problems = problems
        self._warnings = warnings
        self._gaps_s = gaps_s
        self._names = {channel.topic for channel in opened.storage.channels}

    def of_nothing(self, name: str, role: str) -> RoleVerdict:
        verdict, why, cure = _WITHOUT[role]
        return RoleVerdict(name, verdict, None, why, cure)

    def of_topic(self, name: str, topic: str, how: str = "") -> RoleVerdict:
        for problem in self._problems:
            if topic in _words(problem.where or "") and not _is_of_mounting(problem):
                return RoleVerdict(name, "missing", topic, problem.what, problem.cure or "")
        doubts = [line for line in self._warnings if self._subject(line) == topic]
        if topic in self._gaps_s:
            doubts.append(f"it pauses for {self._gaps_s[topic]:.1f} s")
        why = "; ".join([*([how] if how else []), *doubts])
        return RoleVerdict(name, "weak" if why else "good", topic, why, _options_in(why))

    def _subject(self, line: str) -> str | None:
        """The topic that a warning is about: the first that it names."""
        return next((word for word in _words(line) if word in self._names), None)

    def mounting(self, name: str) -> RoleVerdict:
        for problem in self._problems:
            if _is_of_mounting(problem):
                return RoleVerdict(name, "missing", None, problem.what, problem.cure or "")
        why = "; ".join(line for line in self._warnings if "TF: " in line or "frame" in line)
        cure = _options_in(why) or '--frame camera=NAME or --mount camera="X Y Z ROLL PITCH YAW"'
        return RoleVerdict(name, "weak" if why else "good", None, why, cure if why else "")

    def motion(self) -> RoleVerdict:
        source = self._opened.rig.pose_source
        if source is not None and source.topic is not None:
            return self.of_topic("motion", source.topic.name)
        if source is not None:
            return RoleVerdict("motion", "good", source.description, "", "")
        lidar = self._opened.rig.plan.topic("lidar")
        if lidar is None:
            return self.of_nothing("motion", "motion")
        return RoleVerdict("motion", "weak", lidar.name, "estimated from the LiDAR", "--topic odometry=/...")


def _is_of_mounting(problem: RecordingError) -> bool:
    return "--mount" in (problem.cure or "") or "TF tree" in problem.what


def _options_in(text: str) -> str:
    """The options that a warning names, each once."""
    found = re.findall(r"--(?:frame|mount|clock|topic|robot|camera) [^\s,;)]+", text)
    return " or ".join(dict.fromkeys(found))


def _words(text: str) -> list[str]:
    return [word.strip(",:;()") for word in text.split()]


def explicit_settings(opened: OpenedRecording) -> dict[str, object]:
    """The entries of `[build.recording]` that make every choice explicit: what a build would do by itself."""
    request, plan = opened.request, opened.rig.plan
    topics = {name: choice.topic.name for name, choice in plan.choices.items() if choice.role != "odometry"}
    source = opened.rig.pose_source
    if source is not None:
        moving = [each.name for each in opened.rig.topics if each.kind == "transforms" and not is_static(each.name)]
        topics["odometry"] = source.topic.name if source.topic is not None else min(moving, default="/tf")
    frames = {"base": opened.rig.base_frame} if opened.rig.base_frame else {}
    mounts = dict(request.mounts)
    for camera in plan.cameras:
        name = role_name("camera", camera.camera_id)
        recorded, used = camera.recorded_frame_id, camera.frame_id
        if name in mounts or name in request.frames or not recorded or recorded == used:
            continue
        if used.endswith("(turned)"):
            mounts[name] = f"{recorded} 0 0 0 0 0 0"
        else:
            frames[name] = used
    frames.update({name: frame for name, frame in request.frames.items() if is_sensor(name) or name == "odom"})
    clocks = {topic: shift_ns / 1e9 for topic, shift_ns in opened.rig.shifts_ns.items()} | dict(request.clocks)
    settings: dict[str, object] = {
        "camera": request.camera,
        "robot": opened.rig.robot,
        "sync_tolerance_s": request.sync_tolerance_s,
        "detection_tolerance_s": request.detection_tolerance_s,
        "start_s": request.start_s,
        "end_s": request.end_s,
        "fit_color": request.fit_color,
        "topics": topics,
        "frames": frames,
        "mounts": mounts,
        "fixed_joints": dict(request.fixed_joints),
        "clocks": clocks,
        "limits": request.limits.model_dump(exclude_defaults=True),
    }
    return {name: value for name, value in settings.items() if value not in ({}, None)}


def _toml(value: object) -> str:
    """A string, number or truth value as TOML, whose strings are JSON's (TOML 1.0, basic strings)."""
    return json.dumps(value, ensure_ascii=False)


def config_text(settings: Mapping[str, object], recording: str) -> str:
    """A `supermap.toml` with the settings."""
    plain = {name: value for name, value in settings.items() if not isinstance(value, Mapping)}
    lines = [f"# How {recording!r} is read; written by `supermap inspect --write-config`.", "[build.recording]"]
    lines += [f"{name} = {_toml(value)}" for name, value in plain.items()]
    for name, table in settings.items():
        if isinstance(table, Mapping):
            lines += ["", f"[build.recording.{name}]"]
            lines += [f"{_toml(str(key))} = {_toml(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"
