"""A mapping session that frames are pushed into: the same pushes give the same map, however late detections come."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.config import BuildConfig
from supermap_cli.drivers import source
from supermap_cli.errors import AlignmentError, SessionError
from supermap_cli.geometry.se3 import inverse, make_transform
from supermap_cli.session import MappingSession
from supermap_cli.stages.session_state import PriorMap, SessionBackends, begin
from supermap_cli.types.detections import Detections
from supermap_cli.types.memory import MapDelta, coalesce
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose
from support import fakes as f
from support import scenes as s

KITCHEN = (*s.ROOM, s.TABLE, s.CUP)
BACKENDS = SessionBackends(f.FakeTracker)
SECOND_NS = 1_000_000_000


def frame_of(scene: s.Scene, camera_id: str = "camera") -> CameraFrame:
    keyframe = scene.keyframe
    frame = CameraFrame(keyframe.stamp_ns, "camera", keyframe.rgb, keyframe.depth_m, keyframe.camera, f.T_BASE_CAMERA)
    return replace(frame, camera_id=camera_id)


def pose_of(scene: s.Scene) -> StampedPose:
    return StampedPose(scene.keyframe.stamp_ns, scene.keyframe.T_map_camera @ inverse(f.T_BASE_CAMERA))


def detections_of(scene: s.Scene) -> Detections:
    return s.detect(scene, (scene.keyframe.stamp_ns - s.EPOCH_NS) / 1e9)


def session(config: BuildConfig | None = None, **options: object) -> MappingSession:
    return MappingSession(config or f.config(keyframes={"placing_s": 0.5}), BACKENDS, **options)  # type: ignore[arg-type]


def push(into: MappingSession, scenes: Iterable[s.Scene], delay: int = 0) -> list[MapDelta]:
    """Push poses, frames and detections, these `delay` frames late; step after each frame; close."""
    deltas, waiting = [], []
    for scene in scenes:
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene))
        waiting.append(detections_of(scene))
        if len(waiting) > delay:
            into.add_detections(waiting.pop(0))
        deltas += into.step()
    for detections in waiting:
        into.add_detections(detections)
    return [*deltas, *into.close()]


def told(deltas: Iterable[MapDelta]) -> list[tuple[object, ...]]:
    """What a map says, as values that can be compared."""
    whole = coalesce(deltas)
    return [
        *((record.stamp_ns, record.camera_id, record.depth_png) for record in whole.keyframes),
        *((instance.number, instance.label, instance.existence_log_odds) for instance in whole.instances),
        *((instance.number, tuple(instance.voxels.log_odds)) for instance in whole.instances),
        *((seen.stamp_ns, seen.object_number, tuple(seen.centroid_map)) for seen in whole.observations),
        *((edge.subject, edge.relation, edge.object, edge.since_ns, edge.until_ns) for edge in whole.spatial_edges),
    ]


def test_what_is_pushed_becomes_a_map() -> None:
    into = session()
    whole = coalesce(push(into, f.film(KITCHEN)))
    assert {instance.label for instance in whole.instances} == {"cup", "dining table"}
    cup = next(instance for instance in whole.instances if instance.label == "cup")
    np.testing.assert_allclose(cup.centroid_map, s.CUP.center, atol=0.1)
    assert len(whole.keyframes) == into.statistics.keyframes == 12


def test_each_keyframe_gives_a_delta_of_its_own_and_the_end_a_last_one() -> None:
    deltas = push(session(), f.film(KITCHEN))
    assert [len(delta.keyframes) for delta in deltas] == [1] * 12 + [0]
    assert sum(len(delta.observations) for delta in deltas) == len(coalesce(deltas).observations) == 24


@settings(max_examples=5)
@given(st.integers(0, 5))
def test_the_map_does_not_depend_on_how_late_detections_come(delay: int) -> None:
    assert told(push(session(), f.film(KITCHEN), delay)) == told(push(session(), f.film(KITCHEN)))


def test_detections_may_come_before_their_frame_has_a_place() -> None:
    into, deltas = session(), []
    for scene in f.film(KITCHEN):
        into.add_detections(detections_of(scene))
        into.add_frame(frame_of(scene))
        deltas += into.step()
        into.add_pose(pose_of(scene))
        deltas += into.step()
    assert told([*deltas, *into.close()]) == told(push(session(), f.film(KITCHEN)))


def test_detections_that_come_after_the_wait_are_counted() -> None:
    into = session(f.config(perception={"wait_s": 0.2}, keyframes={"placing_s": 0.1}))
    push(into, f.film(KITCHEN), delay=4)
    too_late = into.statistics.keyframes - into.statistics.perceived
    assert too_late > 0
    assert f"{too_late} images had detections that came over 0.2 s late (build.perception.wait_s)" in into.warnings


def test_detections_of_images_that_were_never_pushed_are_counted_apart() -> None:
    into = session(f.config(perception={"wait_s": 0.5}, keyframes={"placing_s": 0.1}))
    for index, scene in enumerate(f.film(KITCHEN)):
        found = detections_of(scene)
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene))
        into.add_detections(found)
        wrong_clock, other_camera = replace(found, stamp_ns=index), replace(found, camera_id="rear")
        for unmatched in (wrong_clock, other_camera, replace(found, stamp_ns=found.stamp_ns - 5_000_000), found):
            into.add_detections(unmatched)
        into.step()
    into.close()
    assert into.statistics.perceived == 12
    assert into.warnings[-1].startswith("48 detections belong to no image that waited for them")
    assert not any("late" in warning for warning in into.warnings)


def test_detections_of_an_image_without_a_pose_are_not_counted_again() -> None:
    into = session(f.config(keyframes={"placing_s": 0.1}))
    for index, scene in enumerate(f.film(KITCHEN, 24)):
        if not 6 <= index < 16:
            into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene))
        into.add_detections(detections_of(scene))
        into.step()
    into.close()
    assert into.statistics.without_pose > 5
    assert not any("detections" in warning for warning in into.warnings)


@settings(max_examples=10)
@given(st.lists(st.booleans(), min_size=12, max_size=12), st.integers(0, 4))
def test_the_map_does_not_depend_on_when_it_is_stepped(steps: list[bool], delay: int) -> None:
    def pushed(when: list[bool]) -> tuple[list[tuple[object, ...]], tuple[str, ...]]:
        into, waiting, deltas = session(f.config(perception={"wait_s": 0.3}, keyframes={"placing_s": 0.2})), [], []
        for scene, step in zip(f.film(KITCHEN), when, strict=True):
            into.add_pose(pose_of(scene))
            into.add_frame(frame_of(scene))
            waiting.append(detections_of(scene))
            if len(waiting) > delay:
                into.add_detections(waiting.pop(0))
            if step:
                deltas += into.step()
        return told([*deltas, *into.close()]), into.warnings

    assert pushed(steps) == pushed([True] * 12)


def rotation_about_y(degrees: float) -> np.ndarray:
    c, s_ = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s_], [0, 1, 0], [-s_, 0, c]])


@pytest.mark.parametrize("every", [10, 10**6])
def test_the_placement_does_not_depend_on_when_it_is_stepped(every: int) -> None:
    """Tilted odometry and noisy depth: each further image gives another placement."""
    noise = np.random.default_rng(3)
    T_odom_map = make_transform(rotation_about_y(4.0), [0, 0, 0])
    messages: list[StampedPose | CameraFrame | Detections | ImuSample] = []
    for scene in f.film(KITCHEN, 24):
        frame = frame_of(scene)
        assert frame.depth_m is not None
        depth_m = frame.depth_m * (1 + 0.01 * noise.standard_normal(frame.depth_m.shape)).astype(np.float32)
        gravity = rotation_about_y(4.0) @ (0, 0, 9.81) + noise.normal(0, 0.2, 3)
        messages.append(ImuSample(frame.stamp_ns - SECOND_NS // 20, np.zeros(3), gravity, np.eye(4)))
        messages += [shifted(scene, T_odom_map), replace(frame, depth_m=depth_m), detections_of(scene)]

    def pushed(every: int) -> tuple[bytes, list[bytes], list[tuple[object, ...]]]:
        into, deltas = session(f.config(keyframes={"placing_s": 1.0})), []
        for index, message in enumerate(messages):
            source.push(into, message)
            if index % every == every - 1:
                deltas += into.step()
        deltas += into.close()
        assert into.placement is not None
        poses = [record.T_map_camera.tobytes() for record in coalesce(deltas).keyframes]
        return into.placement.T_map_odom.tobytes(), poses, told(deltas)

    assert pushed(every) == pushed(1)


# -- draining


def test_draining_while_the_traversal_is_being_placed_leaves_its_frames_waiting() -> None:
    into, deltas = session(f.config(keyframes={"placing_s": 1.0})), []
    for scene in f.film(KITCHEN):
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene))
        into.add_detections(detections_of(scene))
        deltas += into.drain()
        assert (into.state == "placing") == (not deltas)
    assert told([*deltas, *into.close()]) == told(
        push(session(f.config(keyframes={"placing_s": 1.0})), f.film(KITCHEN))
    )


def test_draining_where_the_traversal_fits_nowhere_raises_nothing() -> None:
    into = session_that_fits_nowhere()
    assert into.drain() == []
    assert into.state == "lost"


def test_drained_frames_do_not_wait_for_their_detections_and_frames_without_a_pose_wait_for_it() -> None:
    into, scenes = session(f.config(keyframes={"placing_s": 0.1})), f.film(KITCHEN)
    for scene in scenes[:4]:
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene))
    into.add_frame(frame_of(scenes[4]))
    assert into.step() == []
    assert len(into.drain()) == 4
    into.add_pose(pose_of(scenes[4]))
    assert len(into.drain()) == 1
    into.close()
    assert into.statistics.without_pose == 0


# -- placing, mapping, lost


def test_frames_of_the_placing_time_wait_and_are_mapped() -> None:
    into, states = session(f.config(keyframes={"placing_s": 1.0})), []
    mapped = []
    for scene in f.film(KITCHEN):
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene), awaits_detections=False)
        mapped.append(len(into.step()))
        states.append(into.state)
    assert states == ["placing"] * 6 + ["mapping"] * 6
    assert mapped == [0] * 6 + [7] + [1] * 5
    assert into.placement is not None
    assert "floor at z = 0" in into.placement.method


def test_without_poses_it_is_lost_until_they_come_again() -> None:
    into = session(f.config(keyframes={"placing_s": 0.3}))
    scenes = f.film(KITCHEN, 24)
    states = []
    for index, scene in enumerate(scenes):
        if not 6 <= index < 16:
            into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene), awaits_detections=False)
        into.step()
        states.append(into.state)
    into.close()
    assert "lost" in states
    assert states[-1] == "mapping"
    assert into.statistics.keyframes + into.statistics.without_pose == 24
    assert into.statistics.without_pose > 5


def shifted(scene: s.Scene, T_odom_map: np.ndarray) -> StampedPose:
    pose = pose_of(scene)
    return StampedPose(pose.stamp_ns, T_odom_map @ pose.T_odom_base)


def prior_of(deltas: list[MapDelta]) -> PriorMap:
    whole = coalesce(deltas)
    return PriorMap(keyframes=lambda: ((1, record) for record in whole.keyframes), T_map_odom=[np.eye(4)])


def test_a_further_traversal_is_registered_in_the_map_by_its_first_seconds() -> None:
    prior = prior_of(push(session(), f.film(KITCHEN)))
    T_odom_map = make_transform(np.eye(3), [0.02, -0.01, 0.0])
    config = f.config(keyframes={"placing_s": 1.0})
    into = MappingSession(config, BACKENDS, begin(config, prior))
    for scene in f.film(KITCHEN, start_s=100.0):
        into.add_pose(shifted(scene, T_odom_map))
        into.add_frame(frame_of(scene), awaits_detections=False)
        into.step()
    assert into.state == "mapping"
    assert into.placement is not None
    np.testing.assert_allclose((into.placement.T_map_odom @ T_odom_map)[:3, 3], 0, atol=0.05)


def session_that_fits_nowhere() -> MappingSession:
    prior = prior_of(push(session(), f.film(KITCHEN)))
    config = f.config(keyframes={"placing_s": 0.5})
    into = MappingSession(config, BACKENDS, begin(config, prior))
    for scene in f.film((*s.ROOM, s.BOX.at(-1.6, 0)), start_s=100.0, target=(-1.6, 0, 0.4)):
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene), awaits_detections=False)
        assert into.step() == []
    return into


def test_a_traversal_that_fits_nowhere_is_lost_and_says_so_at_the_end() -> None:
    into = session_that_fits_nowhere()
    assert into.state == "lost"
    with pytest.raises(AlignmentError):
        into.close()


# -- what does not fit


def test_an_older_frame_is_refused_and_the_map_stays() -> None:
    into, scenes = session(), f.film(KITCHEN)
    deltas = []
    for scene in scenes[:6]:
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene), awaits_detections=False)
        deltas += into.step()
    with pytest.raises(SessionError, match=r"0\.500 s older than the one before it"):
        into.add_frame(frame_of(scenes[2]))
    assert len(coalesce([*deltas, *into.close()]).keyframes) == 6


def test_a_closed_session_takes_nothing_more() -> None:
    into, scenes = session(), f.film(KITCHEN)
    push(into, scenes[:6])
    assert into.close() == []
    with pytest.raises(SessionError, match="has ended"):
        into.add_frame(frame_of(scenes[6]))
    with pytest.raises(SessionError, match="has ended"):
        into.add_detections(detections_of(scenes[6]))


def test_a_session_into_which_nothing_was_pushed_ends_with_nothing() -> None:
    assert session().close() == []


# -- several cameras


def test_each_camera_has_a_tracker_of_its_own_and_keyframes_say_their_camera() -> None:
    made: list[f.FakeTracker] = []

    def make_tracker() -> f.FakeTracker:
        made.append(f.FakeTracker())
        return made[-1]

    config = f.config(keyframes={"placing_s": 0.5})
    into = MappingSession(config, SessionBackends(make_tracker))
    deltas = []
    for scene in f.film(KITCHEN):
        into.add_pose(pose_of(scene))
        for camera_id in ("front", "left"):
            into.add_frame(frame_of(scene, camera_id))
            into.add_detections(replace(detections_of(scene), camera_id=camera_id))
        deltas += into.step()
    whole = coalesce([*deltas, *into.close()])
    assert len(made) == 2
    assert [record.camera_id for record in whole.keyframes] == ["front", "left"] * 12
    assert {seen.camera_id for seen in whole.observations} == {"front", "left"}


def test_detections_of_one_camera_may_come_before_its_frame_and_after_another_s() -> None:
    into, deltas = session(), []
    for scene in f.film(KITCHEN):
        into.add_pose(pose_of(scene))
        into.add_frame(frame_of(scene, "front"))
        deltas += into.step()
        for camera_id in ("left", "front"):
            into.add_detections(replace(detections_of(scene), camera_id=camera_id))
        into.add_frame(frame_of(scene, "left"))
        deltas += into.step()
    into.close()
    assert into.statistics.perceived == into.statistics.keyframes == 24


def test_while_a_traversal_is_placed_no_camera_is_left_out() -> None:
    config = f.config(keyframes={"placing_s": 3600.0})
    into = MappingSession(config, BACKENDS, begin(config))
    scene = f.film(KITCHEN)[0]
    for i in range(300):
        stamp_ns = scene.keyframe.stamp_ns + i * SECOND_NS
        into.add_pose(StampedPose(stamp_ns, pose_of(scene).T_odom_base))
        for camera_id in ("front", "left"):
            into.add_frame(replace(frame_of(scene, camera_id), stamp_ns=stamp_ns), awaits_detections=False)
        into.step()
    kept = [record.camera_id for record in coalesce(into.close()).keyframes]
    assert kept.count("front") == kept.count("left") > 50


def test_a_frame_pushed_twice_is_refused() -> None:
    into, scene = session(), f.film(KITCHEN)[0]
    into.add_frame(frame_of(scene))
    with pytest.raises(SessionError, match="a second frame of camera 'camera'"):
        into.add_frame(frame_of(scene))


# -- bounded


@pytest.mark.parametrize("count", [100, 200])
def test_what_is_held_does_not_grow_with_the_length(count: int) -> None:
    into = session()
    scene = f.film(KITCHEN)[0]
    hold: Callable[[int], s.Scene] = lambda i: replace(  # noqa: E731
        scene, keyframe=replace(scene.keyframe, stamp_ns=scene.keyframe.stamp_ns + i * SECOND_NS // 3)
    )
    for i in range(count):
        for k in range(34):
            pose = pose_of(hold(i))
            into.add_pose(StampedPose(pose.stamp_ns + k * 9_000_000, pose.T_odom_base))
        into.add_frame(frame_of(hold(i)), awaits_detections=False)
        into.step()
    assert len(into.localizer.trajectory) < 2000


def test_what_is_held_before_a_traversal_is_placed_is_bounded() -> None:
    """It fits nowhere, for ever."""
    prior = prior_of(push(session(), f.film(KITCHEN)))
    config = f.config(keyframes={"placing_s": 3600.0})
    into = MappingSession(config, BACKENDS, begin(config, prior))
    scene = f.film(KITCHEN)[0]
    for i in range(600):
        stamp_ns = scene.keyframe.stamp_ns + i * SECOND_NS
        into.add_pose(StampedPose(stamp_ns, pose_of(scene).T_odom_base))
        for k in range(40):
            into.add_imu(ImuSample(stamp_ns + k, np.zeros(3), np.array([0, 0, 9.81]), np.eye(4)))
        into.add_frame(replace(frame_of(scene), stamp_ns=stamp_ns), awaits_detections=False)
        into.step()
    registration = into.localizer.registration
    assert len(registration.imu) <= 20_001
    assert len(registration.views_odom) <= 61
    assert into.localizer.waiting <= 241
    assert any("too many to keep" in warning for warning in into.warnings)
