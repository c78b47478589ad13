"""Records a scenario: the measurements of each traversal go into an `.mcap`, the truth into a JSON file."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import count
from operator import attrgetter, itemgetter
from pathlib import Path

import numpy as np

from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray, IntArray
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.lookahead import LookAhead
from supermap_cli.output_files import check_output
from supermap_cli.recordings.fingerprint import recording_fingerprint
from supermap_cli.simulation.detection.detector import SimulatedDetector
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.messages import Outgoing, RecordingFile, RigMessages
from supermap_cli.simulation.recording.place_visibility import SurfaceCoverage, VisibilityModel
from supermap_cli.simulation.recording.truth import (
    FIXTURE_SPACING_M,
    SURFACE_SPACING_M,
    DetectedImage,
    RecordedTraversal,
    make_truth,
)
from supermap_cli.simulation.rigs import SimulatedCamera
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.depth_sensor import measure_depth
from supermap_cli.simulation.sensors.imu import imu_samples, sample_stamps_ns
from supermap_cli.simulation.sensors.lidar_sensor import LidarScan, LidarSensor
from supermap_cli.simulation.sensors.odometry import drifting_odometry
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import RenderedView
from supermap_cli.temporary_folders import temporary_folder
from supermap_cli.timing import StageClock, StageTiming
from supermap_cli.truth_file import TRUTH_FILE, write_truth
from supermap_cli.types.sensing import MAIN_CAMERA
from supermap_cli.types.truth import GroundTruth

LIDAR_VIEW_M = 10.0
"""Visibility range of a rig with a LiDAR, m: beyond, its scan lines lie farther apart than most things are wide."""

COVERAGE_EVERY = 2
"""Of a camera's images with detections, every second one is used to find the surfaces that were seen."""

Progress = Callable[[str, int, int], None]
"""Called with a traversal's name, and how many of how many of its images are done."""

_Exposure = tuple[int, Callable[[int], "_Image | LidarScan"]]


class _Noise(IntEnum):
    """Sources of randomness that do not disturb one another; each traversal has its own."""

    ODOMETRY = 0
    IMU = 1
    DEPTH = 2
    LIDAR = 3
    DETECTOR = 4


@dataclass(frozen=True)
class RecordedScenario:
    """The files, what they hold, and where the time went."""

    recordings: tuple[Path, ...]
    truth: Path
    ground_truth: GroundTruth
    timings: tuple[StageTiming, ...]


def record(
    scenario: Scenario,
    folder: Path,
    *,
    errors: DetectorErrors | None = None,
    seed: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RecordedScenario:
    """Write a recording of each traversal (NAME.mcap) and their truth (truth.json); if interrupted, none of them.

    `errors` are those of the detector (default: the scenario's); `seed` is that of all noise (default: the scenario's).
    Raises `SimulationError` where files are in the way or cannot be written.
    """
    recordings = tuple(folder / f"{traversal.name}.mcap" for traversal in scenario.traversals)
    with _writing(folder):
        _check_targets((*recordings, folder / TRUTH_FILE), overwrite=overwrite)
        with temporary_folder(".supermap-simulate-", folder) as unfinished:
            robot = _Robot(scenario, errors or scenario.errors, scenario.seed if seed is None else seed)
            recorded = [
                robot.record_traversal(number, unfinished / path.name, progress or _silent)
                for number, path in enumerate(recordings)
            ]
            with robot.clock.stage("truth"):
                truth = make_truth(scenario, recorded, robot.coverage.things, robot.coverage.fixtures)
                write_truth(truth, unfinished / TRUTH_FILE)
            for path in (*recordings, folder / TRUTH_FILE):
                (unfinished / path.name).replace(path)
    return RecordedScenario(recordings, folder / TRUTH_FILE, truth, robot.clock.timings())


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """The folder to write to; where that fails or is interrupted, the folders that were made for it are gone again.

    Raises `SimulationError` for what the disk refuses.
    """
    made: list[Path] = []
    try:
        made += [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        for path in made:
            with suppress(OSError):  # not empty, or never made
                path.rmdir()
        if isinstance(error, OSError):
            cure = "see that there is space and that it may be written to, or name another folder with --out"
            raise SimulationError(f"cannot write: {error.strerror or error}", where=str(folder), cure=cure) from error
        raise


def _check_targets(paths: tuple[Path, ...], *, overwrite: bool) -> None:
    folder = paths[0].parent
    if folders := [path.name for path in paths if path.is_dir()]:
        cure = "name another folder with --out"
        raise SimulationError(f"{', '.join(folders)} is a folder, not a file", where=str(folder), cure=cure)
    there = [path.name for path in paths if path.exists()]
    if there and not overwrite:
        cure = "name another folder with --out, or replace them with --overwrite"
        raise SimulationError(f"{', '.join(there)} would be overwritten", where=str(folder), cure=cure)
    for path in paths:
        check_output(path, "truth" if path.name == TRUTH_FILE else "simulated recording", option="--out")


def _silent(name: str, done: int, total: int) -> None:
    """No progress is shown."""


class _Robot:
    """What all traversals of one world share: its surfaces, what was seen of them, the rig's messages."""

    def __init__(self, scenario: Scenario, errors: DetectorErrors, seed: int) -> None:
        rig, world = scenario.rig, scenario.world
        farthest_m = rig.depth.farthest_m if rig.depth is not None else LIDAR_VIEW_M
        self.scenario = scenario
        self.errors = errors
        self.seed = seed
        self.messages = RigMessages(rig)
        self.clock = StageClock()
        with self.clock.stage("world"):
            self.scene = Scene(world)
            self.visibility_model = VisibilityModel(world, farthest_m=farthest_m)
            self.coverage = SurfaceCoverage(
                world, spacing_m=SURFACE_SPACING_M, fixture_spacing_m=FIXTURE_SPACING_M, farthest_m=farthest_m
            )

    def record_traversal(self, number: int, path: Path, progress: Progress) -> RecordedTraversal:
        """Drive and record one traversal."""
        recorder = _TraversalRecorder(self, number)
        with RecordingFile(path, self.messages) as file, closing(recorder.messages(progress)) as messages:
            for message in messages:
                with self.clock.stage("store"):
                    file.write(message)
        return RecordedTraversal(recorder.traversal, path.name, tuple(recorder.detected), recording_fingerprint(path))


@dataclass(frozen=True)
class _Image:
    """An exact image, where its camera was, and what it is for: colour, depth or both."""

    camera: SimulatedCamera
    T_world_camera: FloatArray
    view: RenderedView
    color: bool
    depth: bool


class _CameraNoise:
    """What one camera's driver and detector draw at random on one traversal.

    All detectors are one network: the spots of the building that it mistakes for things (`Phantoms`) are the same for
    all cameras.
    """

    def __init__(self, robot: _Robot, number: int, camera: SimulatedCamera) -> None:
        self.depth_rng = _generator(robot.seed, number, _Noise.DEPTH, camera.camera_id)
        self.detector = SimulatedDetector(
            robot.scenario.world,
            robot.errors,
            _seed(robot.seed, number, _Noise.DETECTOR, camera.camera_id),
            phantom_seed=_seed(robot.seed, number, _Noise.DETECTOR),
            camera_id=camera.camera_id,
        )
        self.published_ns = 0
        """When the detector last gave an answer."""


def _generator(seed: int, number: int, noise: _Noise, camera_id: str = MAIN_CAMERA) -> np.random.Generator:
    """One source of noise of a traversal. A camera of several has sources of its own, the same with and without the
    others; the only camera of a rig, called `MAIN_CAMERA`, adds nothing to the seed.
    """
    of_camera = () if camera_id == MAIN_CAMERA else tuple(camera_id.encode())
    return np.random.default_rng((seed, number, noise, *of_camera))


def _seed(seed: int, number: int, noise: _Noise, camera_id: str = MAIN_CAMERA) -> int:
    return int(_generator(seed, number, noise, camera_id).integers(2**31))


class _TraversalRecorder:
    """One traversal: every sensor is a stream of messages in the order of log time, and so is all of them.

    Rays are cast one exposure ahead, in a thread of their own. `detected` collects the images that the detectors looked
    at, in the order of their stamps.
    """

    def __init__(self, robot: _Robot, number: int) -> None:
        self._robot = robot
        self._number = number
        self._rig = robot.scenario.rig
        self._clock = robot.clock
        self._messages = robot.messages
        self.traversal = robot.scenario.traversals[number]
        self.detected: list[DetectedImage] = []
        self._odometry = drifting_odometry(
            self.traversal.route, self._rig.drift, self.traversal.T_world_odom, self._rng(_Noise.ODOMETRY)
        )
        stamps_ns = sample_stamps_ns(self.traversal.route, self._rig.image_rate_hz)
        self._delay_ns = round(self._rig.depth_delay_s * 1e9) if self._rig.depth is not None else 0
        self._images_ns = stamps_ns[stamps_ns + self._delay_ns <= self._odometry.stamps_ns[-1]]

    def _rng(self, noise: _Noise) -> np.random.Generator:
        return _generator(self._robot.seed, self._number, noise)

    def messages(self, progress: Progress) -> Generator[Outgoing, None, None]:
        """All that is recorded."""
        yield self._messages.mounting(self.traversal.route.start_ns)
        with LookAhead(self._exposures()) as exposures:
            streams = (self._poses(), self._imu(), self._camera_and_lidar(iter(exposures), progress))
            yield from heapq.merge(*streams, key=attrgetter("log_ns"))

    def _poses(self) -> Iterator[Outgoing]:
        stamps_ns = self._odometry.stamps_ns
        truth = self.traversal.route.T_world_base(stamps_ns)
        for stamp_ns, T_odom_base, T_world_base in zip(
            stamps_ns.tolist(), self._odometry.T_odom_base, truth, strict=True
        ):
            yield from self._messages.odometry(stamp_ns, T_odom_base)
            yield self._messages.true_pose(stamp_ns, T_world_base)

    def _imu(self) -> Iterator[Outgoing]:
        if self._rig.imu is None:
            return
        samples = imu_samples(self.traversal.route, self._rig.imu, self._rig.T_base_imu, self._rng(_Noise.IMU))
        for sample in zip(samples.stamps_ns.tolist(), samples.angular_rate, samples.specific_force, strict=True):
            yield self._messages.imu(*sample)

    def _exposures(self) -> Iterator[tuple[int, _Image | LidarScan]]:
        """Exact images of all cameras, and LiDAR scans, in the order of time."""
        depth, apart = self._rig.depth is not None, self._delay_ns > 0
        images = self._images(self._images_ns, color=True, depth=depth and not apart)
        later = self._images(self._images_ns + self._delay_ns, color=False, depth=True) if apart else iter(())
        for stamp_ns, expose in heapq.merge(images, later, self._scans(), key=itemgetter(0)):
            yield stamp_ns, expose(stamp_ns)

    def _images(self, stamps_ns: IntArray, *, color: bool, depth: bool) -> Iterator[_Exposure]:
        """When all cameras take images, and how."""
        for stamp_ns in stamps_ns.tolist():
            for camera in self._rig.cameras:
                yield stamp_ns, partial(self._image, camera, color=color, depth=depth)

    def _image(self, camera: SimulatedCamera, stamp_ns: int, *, color: bool, depth: bool) -> _Image:
        T_world_base = self.traversal.route.T_world_base(np.array([stamp_ns]))[0]
        T_world_camera: FloatArray = T_world_base @ camera.T_base_camera
        with self._clock.stage("render"):
            view = render(self._robot.scene, camera.model, T_world_camera, stamp_ns)
        return _Image(camera, T_world_camera, view, color, depth)

    def _scans(self) -> Iterator[_Exposure]:
        """When the LiDAR begins its scans, and how."""
        lidar, T_base_lidar, route = self._rig.lidar, self._rig.T_base_lidar, self.traversal.route
        if lidar is None or T_base_lidar is None:
            return
        sensor = LidarSensor(lidar, _seed(self._robot.seed, self._number, _Noise.LIDAR))

        def scan(stamp_ns: int) -> LidarScan:
            with self._clock.stage("lidar"):
                return sensor.scan(self._robot.scene, lambda at_ns: route.T_world_base(at_ns) @ T_base_lidar, stamp_ns)

        for stamp_ns in sample_stamps_ns(route, lidar.rate_hz)[:-1].tolist():
            yield stamp_ns, scan

    def _camera_and_lidar(
        self, exposures: Iterator[tuple[int, _Image | LidarScan]], progress: Progress
    ) -> Iterator[Outgoing]:
        """Cameras, LiDAR and detectors; a detection is held back until its detector publishes it."""
        noises = {camera.camera_id: _CameraNoise(self._robot, self._number, camera) for camera in self._rig.cameras}
        pending: list[tuple[int, int, Outgoing]] = []
        cameras, images, order = len(noises), 0, count()
        for stamp_ns, exposure in exposures:
            while pending and pending[0][0] <= stamp_ns:
                yield heapq.heappop(pending)[-1]
            if isinstance(exposure, LidarScan):
                with self._clock.stage("encode"):
                    scan = self._messages.points(stamp_ns, exposure)
                yield scan
                continue
            noise = noises[exposure.camera.camera_id]
            yield from self._image_messages(exposure, noise.depth_rng)
            if not exposure.color:
                continue
            if images // cameras % self._rig.detection_every == 0:
                for message in self._detection_messages(exposure, noise):
                    heapq.heappush(pending, (message.log_ns, next(order), message))
            images += 1
            progress(self.traversal.name, images, cameras * len(self._images_ns))
        while pending:
            yield heapq.heappop(pending)[-1]

    def _image_messages(self, image: _Image, depth_rng: np.random.Generator) -> list[Outgoing]:
        """What a camera measures of a view."""
        stamp_ns, depth_m = image.view.stamp_ns, None
        if self._rig.depth is not None and image.depth:
            with self._clock.stage("depth"):
                depth_m = measure_depth(image.view, self._rig.depth, depth_rng)
        with self._clock.stage("encode"):
            messages = list(self._messages.color(image.camera, stamp_ns, image.view.rgb)) if image.color else []
            if depth_m is not None:
                messages += self._messages.depth(image.camera, stamp_ns, depth_m)
        return messages

    def _detection_messages(self, image: _Image, noise: _CameraNoise) -> list[Outgoing]:
        """What a detector finds in a view, published after its latency, and not before its last answer."""
        view, camera, T_world_camera = image.view, image.camera.model, image.T_world_camera
        with self._clock.stage("sights"):
            visibility = self._robot.visibility_model.measure(view, camera, T_world_camera)
        if len(self.detected) // len(self._rig.cameras) % COVERAGE_EVERY == 0:
            with self._clock.stage("coverage"):
                self._robot.coverage.add(view, camera, T_world_camera)
        with self._clock.stage("detect"):
            full_turn = isinstance(camera, EquirectangularCamera)
            found = noise.detector.detect(
                view, visibility, full_turn=full_turn, camera=camera, T_world_camera=T_world_camera
            )
        self.detected.append(DetectedImage(view.stamp_ns, image.camera.camera_id, visibility))
        noise.published_ns = max(view.stamp_ns + round(noise.detector.latency_s() * 1e9), noise.published_ns)
        with self._clock.stage("encode"):
            return list(self._messages.detections(found, noise.published_ns))
