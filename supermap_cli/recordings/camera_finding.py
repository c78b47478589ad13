"""Several cameras on one robot: those that the user named, else RGB-D cameras told apart by topic names and frames.

Found are only cameras that certainly are several: each with depth of its own (or none has, and a LiDAR stands in), each
in a frame of its own that TF places on the base, recorded over the same time, and none that looks where another does,
as the second camera of a stereo pair.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from supermap_cli.errors import ConfigError, RecordingError
from supermap_cli.recordings.calibration import is_calibrated
from supermap_cli.recordings.decoding import Decoder
from supermap_cli.recordings.image_topics import MASK_WORDS, has_word, shows_a_camera
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.roles import NamedTopics
from supermap_cli.recordings.storage import Storage
from supermap_cli.recordings.survey import Topic, usual_offset_ns
from supermap_cli.recordings.topic_names import Device, camera_ids, device_of, words_of
from supermap_cli.recordings.topic_plan import CameraPlan, TopicPlan
from supermap_cli.recordings.topics import CameraPlanner, faults, plan_shared
from supermap_cli.recordings.transforms import TransformTree
from supermap_cli.types.sensing import MAIN_CAMERA

MOST_CAMERAS = 6
"""Cameras that are found by themselves; a robot with more of them is asked to name those it wants."""

_PARALLEL_RAD = np.deg2rad(10.0)
"""Optical axes closer than this are those of a stereo pair; the cameras of a rig are turned to cover more."""

_STEREO_BASELINE_M = 0.6
"""Parallel cameras without depth of their own are a stereo pair up to this distance (KITTI's stand 0.54 m apart)."""

_DEVICE_BASELINE_M = 0.13
"""Parallel cameras with depth are one device up to this distance (a ZED 2's lenses stand 0.12 m apart)."""

_SAME_CLOCK_NS = 1_000_000_000
"""Cameras whose stamps are further apart than this at the same time of recording cannot be put in one order."""

_MOMENTS, _MOMENT_NS, _SHARED_MOMENTS = 8, 2_000_000_000, 0.5
"""Moments of the recording, spread evenly, and ns at each, in which cameras are looked for; those that record over the
same time share at least half of the moments in which either is seen.
"""

Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True)
class RecordedRobot:
    """What the recording says of the robot besides its topics."""

    tree: TransformTree
    base_frame: str
    storage: Storage
    decoder: Decoder


@dataclass(frozen=True)
class _Owner:
    """What tells that a topic is a camera's: the device in its name, or the frame of the colour images."""

    device: Device
    frame_ids: frozenset[str]


def plan_named_cameras(topics: Sequence[Topic], named: NamedTopics, where: str) -> TopicPlan:
    """The cameras whose colour topics the user named, in that order; their further topics are named, or found by name
    and frame.

    Raises `RecordingError` if the user named what is not there.
    """
    shared = plan_shared(topics, named.plain, where)
    images = {topic.name: topic for topic in topics if topic.kind == "image"}
    colors = {
        camera_id: images[name]
        for camera_id in named.color_cameras
        if (name := named.cameras[camera_id]["color"]) in images
    }
    owners = {
        camera_id: _Owner(device_of(color.name), frozenset({color.frame_id})) for camera_id, color in colors.items()
    }
    own = _topics_of_cameras(topics, owners)

    def plan(lidar_stands_in: bool) -> tuple[CameraPlan, ...]:
        return tuple(
            CameraPlanner(
                own.get(camera_id, []),
                topics,
                named.of_camera(camera_id),
                where,
                lidar_stands_in=lidar_stands_in,
                camera_id=camera_id,
            ).plan()
            for camera_id in named.color_cameras
        )

    cameras = plan(lidar_stands_in="lidar" in shared)
    if any("depth" in camera.choices for camera in cameras):
        cameras = plan(lidar_stands_in=False)
    mispaired = tuple(_mispaired(cameras, where))
    return TopicPlan(cameras, shared, (*mispaired, *faults(shared.values(), where)))


def _mispaired(cameras: Sequence[CameraPlan], where: str) -> Iterator[RecordingError]:
    """Topics that serve one camera and are, by their frame, another one's; of detections that several cameras share
    each takes its own.
    """
    frames = {camera.color.frame_id: camera.camera_id for camera in cameras if camera.color.frame_id}
    for camera in cameras:
        for role, choice in camera.choices.items():
            frame_id, topic = choice.topic.frame_id, choice.topic
            owner = frames.get(frame_id, camera.camera_id)
            shared = role in {"detections", "masks"} and any(
                other.topic(role) is topic for other in cameras if other.camera_id == owner
            )
            if frame_id != camera.frame_id and owner != camera.camera_id and not shared:
                yield RecordingError(
                    f"its frame {frame_id!r} is that of the camera {owner!r}, not of {camera.camera_id!r}",
                    where=f"{where}, {topic.name}",
                    cure=f"name the topic that belongs to it with --topic {role}.{camera.camera_id}=/...",
                )


class CameraFinder:
    """Looks for several cameras where the user named none, beside the one that is chosen for a lone camera."""

    def __init__(self, topics: Sequence[Topic], lone: TopicPlan, named: NamedTopics, where: str) -> None:
        self._topics = topics
        self._lone = lone
        self._named = named
        self._where = where
        self._owners = _color_devices(topics)
        self._own = _topics_of_cameras(topics, {str(device): owner for device, owner in self._owners.items()})

    def lone(self) -> TopicPlan:
        """The plan for a lone camera. Raises `ConfigError` if the user named a topic for another."""
        self._check_named([MAIN_CAMERA])
        return self._lone

    def find(self, robot: RecordedRobot, notes: Notes) -> TopicPlan:
        """The cameras found, the main one first; the plan for a lone camera where there are not several.

        Raises `ConfigError` if the user named a topic for a camera that is not among them.
        """
        candidates = self._candidates()
        found = self._usable(candidates, robot, notes) if len(candidates) > 1 else {}
        if len(found) < 2:
            lone_color = self._lone.topic("color")
            if not found or any(plan.color is lone_color for plan in found.values()):
                return self.lone()
            self._check_named([MAIN_CAMERA])
            (only,) = found.values()
            return replace(self._lone, cameras=(replace(only, camera_id=MAIN_CAMERA),))
        devices = dict(zip(camera_ids(list(found)), found, strict=True))
        self._check_named(devices)
        main, *others = devices
        ids = [main, *sorted(others)]
        if len(ids) > MOST_CAMERAS:
            left_out = ", ".join(ids[MOST_CAMERAS:])
            notes.note(
                "more cameras",
                f"{self._where}: {len(ids)} cameras, of which {left_out} are left out; name those that are wanted with "
                f"--topic color.NAME=/...",
            )
        cameras = self._plans({camera_id: devices[camera_id] for camera_id in ids[:MOST_CAMERAS]})
        listed = ", ".join(f"{camera.camera_id} ({camera.color.name})" for camera in cameras)
        notes.note(
            "cameras",
            f"{self._where}: {len(cameras)} cameras found: {listed}; --topic color=/... keeps to one of them",
        )
        return replace(self._lone, cameras=cameras)

    def _check_named(self, found: Collection[str]) -> None:
        unknown = [camera_id for camera_id in self._named.cameras if camera_id not in found]
        if unknown:
            role = next(iter(self._named.cameras[unknown[0]]))
            raise ConfigError(
                f"--topic {role}.{unknown[0]}: there is no camera {unknown[0]!r}, only {', '.join(found)}",
                cure=f"write one of these, or name its colour images too: --topic color.{unknown[0]}=/...",
            )

    def _candidates(self) -> dict[Device, CameraPlan]:
        """Devices with all that a camera needs, the main one first: what a lone camera would be, if it is one."""
        has_lidar = "lidar" in self._lone.shared
        plans = {
            device: CameraPlanner(self._own[str(device)], self._topics, {}, self._where, lidar_stands_in=has_lidar)
            for device in self._owners
        }
        complete = {device: plan for device, planner in plans.items() if not (plan := planner.plan()).problems}
        with_depth = {device: plan for device, plan in complete.items() if "depth" in plan.choices}
        if not with_depth and self._lone.topic("depth") is None:
            with_depth = {device: plan for device, plan in complete.items() if _is_calibrated_color(plan)}
        lone_color = self._lone.topic("color")
        ordered = sorted(
            with_depth.items(),
            key=lambda item: (item[1].color is not lone_color, -item[1].color.channel.count, item[1].color.name),
        )
        return dict(ordered)

    def _usable(
        self, candidates: Mapping[Device, CameraPlan], robot: RecordedRobot, notes: Notes
    ) -> dict[Device, CameraPlan]:
        """Those that TF places, that look where no other does, and that record over the same time by the same clock."""
        moments = _moments(robot.storage, [plan.color.name for plan in candidates.values()])
        kept: dict[Device, CameraPlan] = {}
        for device, plan in candidates.items():
            why = self._left_out(plan, list(kept.values()), robot, moments)
            if why is None:
                kept[device] = plan
            elif why:
                notes.note(
                    f"camera {plan.color.name}", f"{self._where}, {plan.color.name}: {why}; this camera is left out"
                )
        return kept

    def _left_out(
        self,
        plan: CameraPlan,
        kept: Sequence[CameraPlan],
        robot: RecordedRobot,
        moments: Mapping[str, frozenset[int]],
    ) -> str | None:
        """Why a candidate is no further camera, "" if there is nothing to say of it; `None` if it is one."""
        if not plan.frame_id or any(plan.frame_id == other.frame_id for other in kept):
            return ""
        if not robot.tree.connects(robot.base_frame, plan.frame_id):
            return f"TF does not place its frame {plan.frame_id!r} on {robot.base_frame!r}"
        if any(_same_view(robot.tree, plan, other) for other in kept):
            return ""
        return _not_together(plan, kept[0], robot, moments) if kept else None

    def _plans(self, devices: Mapping[str, Device]) -> tuple[CameraPlan, ...]:
        """The plans of the cameras found, with what the user named for them."""
        own = _topics_of_cameras(self._topics, {name: self._owners[device] for name, device in devices.items()})
        lidar_stands_in = self._lone.topic("depth") is None
        cameras = tuple(
            CameraPlanner(
                own[camera_id],
                self._topics,
                self._named.of_camera(camera_id),
                self._where,
                lidar_stands_in=lidar_stands_in,
                camera_id=camera_id,
            ).plan()
            for camera_id in devices
        )
        if any("detections" in camera.choices for camera in cameras):
            return cameras
        of_lone = {role: self._lone.main.choices[role] for role in ("detections", "masks") if self._lone.topic(role)}
        return (replace(cameras[0], choices={**cameras[0].choices, **of_lone}), *cameras[1:])


def _color_devices(topics: Sequence[Topic]) -> dict[Device, _Owner]:
    """The devices in the names of all readable colour images, with the frames of these."""
    frames: dict[Device, set[str]] = {}
    for topic in topics:
        if topic.fault is None and shows_a_camera(topic):
            frames.setdefault(device_of(topic.name), set()).add(topic.frame_id)
    return {device: _Owner(device, frozenset(frames[device])) for device in sorted(frames)}


def _topics_of_cameras(topics: Sequence[Topic], owners: Mapping[str, _Owner]) -> dict[str, list[Topic]]:
    """Every camera's images, calibrations and detections: by the device in their name, else by their frame, else (for
    detections and masks) by the camera's own name in theirs. What could be of two is of none.
    """
    by_device = _unique((owner.device, camera_id) for camera_id, owner in owners.items())
    by_frame = _unique((frame, camera_id) for camera_id, owner in owners.items() for frame in owner.frame_ids if frame)
    own: dict[str, list[Topic]] = {camera_id: [] for camera_id in owners}
    for topic in topics:
        if topic.kind not in {"image", "camera_info", "detections"}:
            continue
        device = device_of(topic.name)
        camera_id = by_device.get(device) if device else None
        camera_id = camera_id or by_frame.get(topic.frame_id) or by_device.get(device)
        if camera_id is None and (topic.kind == "detections" or has_word(topic, MASK_WORDS)):
            camera_id = _named_in(topic.name, owners)
        if camera_id is not None:
            own[camera_id].append(topic)
    return own


def _unique(pairs: Iterable[tuple[Key, str]]) -> dict[Key, str]:
    """What belongs to one camera alone."""
    owners: dict[Key, set[str]] = {}
    for key, camera_id in pairs:
        owners.setdefault(key, set()).add(camera_id)
    return {key: next(iter(camera_ids)) for key, camera_ids in owners.items() if len(camera_ids) == 1}


def _named_in(topic: str, cameras: Collection[str]) -> str | None:
    """The one camera whose words are all in a topic's name; of "front" and "front_left" the longer one."""
    words = words_of(topic)
    fitting = sorted((len(words_of(camera_id)), camera_id) for camera_id in cameras if words_of(camera_id) <= words)
    if not fitting or (len(fitting) > 1 and fitting[-1][0] == fitting[-2][0]):
        return None
    return fitting[-1][1]


def _is_calibrated_color(plan: CameraPlan) -> bool:
    """Whether a camera without depth is one to map with: in colour, and with a camera_info that is filled in."""
    info, image = plan.topic("camera_info"), plan.color.image
    calibrated = info is not None and info.calibration is not None and is_calibrated(info.calibration)
    return calibrated and image is not None and "mono" not in image.encoding and "8UC1" not in image.encoding


def _same_view(tree: TransformTree, a: CameraPlan, b: CameraPlan) -> bool:
    """Whether two cameras stand side by side and look the same way, as the halves of a stereo pair do."""
    if not tree.connects(a.frame_id, b.frame_id) or not tree.is_static(a.frame_id, b.frame_id):
        return False
    T_a_b = tree.lookup(a.frame_id, b.frame_id, 0)
    if T_a_b is None:
        return False
    nearest_m = _DEVICE_BASELINE_M if "depth" in a.choices and "depth" in b.choices else _STEREO_BASELINE_M
    return bool(np.linalg.norm(T_a_b[:3, 3]) < nearest_m and T_a_b[2, 2] > np.cos(_PARALLEL_RAD))


def clock_problems(cameras: Sequence[CameraPlan], robot: RecordedRobot, where: str) -> Iterator[RecordingError]:
    """Cameras that the user named whose stamps are of different clocks."""
    for camera in cameras[1:]:
        if (why := _other_clock(camera, cameras[0], robot)) is not None:
            yield RecordingError(
                why, where=f"{where}, {camera.color.name}", cure="record with one clock, or name only one of the two"
            )


def _other_clock(plan: CameraPlan, main: CameraPlan, robot: RecordedRobot) -> str | None:
    apart_ns = abs(_clock_offset_ns(plan.color, robot) - _clock_offset_ns(main.color, robot))
    return f"its clock is {apart_ns / 1e9:.1f} s off that of {main.color.name}" if apart_ns > _SAME_CLOCK_NS else None


def _not_together(
    plan: CameraPlan, main: CameraPlan, robot: RecordedRobot, moments: Mapping[str, frozenset[int]]
) -> str | None:
    """Why a camera's images cannot be put in one order with the main camera's; `None` if they can."""
    if (why := _other_clock(plan, main, robot)) is not None:
        return why
    own, of_main = moments[plan.color.name], moments[main.color.name]
    if len(own & of_main) < _SHARED_MOMENTS * len(own | of_main):
        return f"it does not record over the same time as {main.color.name}"
    return None


def _clock_offset_ns(topic: Topic, robot: RecordedRobot) -> int:
    """Sensor time minus log time; looked up in several messages where the first one says that they differ."""
    if abs(topic.clock_offset_ns) <= _SAME_CLOCK_NS // 2:
        return topic.clock_offset_ns
    return usual_offset_ns(robot.storage, topic, robot.decoder)


def _moments(storage: Storage, topics: Sequence[str]) -> dict[str, frozenset[int]]:
    """In which of some moments, spread over the recording, each topic has messages."""
    last_ns = max(storage.start_ns, storage.end_ns - _MOMENT_NS)
    starts = np.unique(np.linspace(storage.start_ns, last_ns, _MOMENTS).astype(np.int64))
    seen: dict[str, set[int]] = {topic: set() for topic in topics}
    for moment, start_ns in enumerate(starts.tolist()):
        missing = set(topics)
        for raw in storage.messages(topics, start_ns, start_ns + _MOMENT_NS):
            seen[raw.channel.topic].add(moment)
            missing.discard(raw.channel.topic)
            if not missing:
                break
    return {topic: frozenset(moments) for topic, moments in seen.items()}
