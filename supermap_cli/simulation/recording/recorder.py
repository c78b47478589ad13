"""Records a scenario: what the robot's sensors measure on each visit goes into an `.mcap`, what is true into a JSON."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from operator import attrgetter, itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from supermap_cli.building.lookahead import LookAhead
from supermap_cli.errors import SimulationError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import EquirectangularCamera
from supermap_cli.recordings.fingerprint import recording_fingerprint
from supermap_cli.simulation.detection.detector import SimulatedDetector
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.messages import Outgoing, RecordingFile, RigMessages
from supermap_cli.simulation.recording.sightings import SightLines, SurfaceCoverage
from supermap_cli.simulation.recording.truth import FIXTURE_SPACING_M, SURFACE_SPACING_M, WatchedVisit, make_truth
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.sensors.camera_view import render
from supermap_cli.simulation.sensors.depth_sensor import measure_depth
from supermap_cli.simulation.sensors.imu import imu_samples, sample_stamps_ns
from supermap_cli.simulation.sensors.lidar_sensor import LidarScan, LidarSensor
from supermap_cli.simulation.sensors.odometry import drifting_odometry
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.views import Sights, View
from supermap_cli.timing import StageClock, StageTiming
from supermap_cli.truth_file import TRUTH_FILE, write_truth
from supermap_cli.types.truth import GroundTruth

LIDAR_VIEW_M = 10.0
"""How far a LiDAR rig sees things: farther off, its lines lie wider apart than most of them are."""

COVERAGE_EVERY = 2
"""Of the images that the detector looks at, so many to one that counts for which surfaces were seen."""

Progress = Callable[[str, int, int], None]
"""Called with a visit's name, and how many of how many of its images are done."""

_Exposing = tuple[int, Callable[[int], View | LidarScan]]


class _Noise(IntEnum):
    """Sources of randomness that do not disturb one another; each visit has its own."""

    ODOMETRY = 0
    IMU = 1
    DEPTH = 2
    LIDAR = 3
    DETECTOR = 4


@dataclass(frozen=True)
class Recorded:
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
) -> Recorded:
    """Write a recording for each visit (NAME.mcap) and their truth (truth.json); all of them or, if interrupted, none.

    `errors` are those of the detector; `seed` is that of all noise (default: the scenario's). Raises `SimulationError`
    where files are in the way or cannot be written.
    """
    recordings = tuple(folder / f"{visit.name}.mcap" for visit in scenario.visits)
    with _writing(folder):
        _check_targets((*recordings, folder / TRUTH_FILE), overwrite=overwrite)
        with TemporaryDirectory(prefix=".supermap-simulate-", dir=folder) as unfinished:
            robot = _Robot(scenario, errors or DetectorErrors(), scenario.seed if seed is None else seed)
            watched = [
                robot.pay(number, Path(unfinished) / path.name, progress or _silent)
                for number, path in enumerate(recordings)
            ]
            with robot.clock.stage("truth"):
                truth = make_truth(scenario, watched, robot.coverage.things, robot.coverage.fixtures)
                write_truth(truth, Path(unfinished) / TRUTH_FILE)
            for path in (*recordings, folder / TRUTH_FILE):
                (Path(unfinished) / path.name).replace(path)
    return Recorded(recordings, folder / TRUTH_FILE, truth, robot.clock.timings())


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """The folder to write to; where that fails or is interrupted, the folders that were made for it are gone again.

    Raises `SimulationError` for what the disk refuses.
    """
    made: list[Path] = []
    try:
        made += [each for each in (folder, *folder.parents) if not each.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        for each in made:
            with suppress(OSError):  # somebody else has put something there, or it never came to be
                each.rmdir()
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


def _silent(name: str, done: int, total: int) -> None:
    """Nobody looks."""


class _Robot:
    """A robot with all that it needs on each visit to the same world."""

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
            self.sight_lines = SightLines(world, farthest_m=farthest_m)
            self.coverage = SurfaceCoverage(
                world, spacing_m=SURFACE_SPACING_M, fixture_spacing_m=FIXTURE_SPACING_M, farthest_m=farthest_m
            )

    def pay(self, number: int, path: Path, progress: Progress) -> WatchedVisit:
        """Record a visit."""
        visit = _Visit(self, number)
        with RecordingFile(path, self.messages) as file, closing(visit.messages(progress)) as messages:
            for message in messages:
                with self.clock.stage("store"):
                    file.write(message)
        stamps_ns, sights = zip(*visit.watched, strict=True) if visit.watched else ((), ())
        fingerprint = recording_fingerprint(path)
        return WatchedVisit(visit.visit, path.name, np.array(stamps_ns, np.int64), tuple(sights), fingerprint)


class _Visit:
    """One visit: every sensor is a stream of messages in the order of log time, and so is all of them.

    Rays are cast one exposure ahead, in a thread of their own. `watched` collects the images that the detector looked
    at: stamp and sights.
    """

    def __init__(self, robot: _Robot, number: int) -> None:
        self._robot = robot
        self._number = number
        self._rig = robot.scenario.rig
        self._clock = robot.clock
        self._messages = robot.messages
        self.visit = robot.scenario.visits[number]
        self.watched: list[tuple[int, Sights]] = []
        drift, T_world_odom = self._rig.drift, self.visit.T_world_odom
        self._odometry = drifting_odometry(self.visit.route, drift, T_world_odom, self._rng(_Noise.ODOMETRY))
        stamps_ns = sample_stamps_ns(self.visit.route, self._rig.image_rate_hz)
        self._images_ns = stamps_ns[stamps_ns <= self._odometry.stamps_ns[-1]]

    def _rng(self, noise: _Noise) -> np.random.Generator:
        return np.random.default_rng((self._robot.seed, self._number, noise))

    def _seed(self, noise: _Noise) -> int:
        return int(self._rng(noise).integers(2**31))

    def messages(self, progress: Progress) -> Generator[Outgoing, None, None]:
        """All that is recorded."""
        yield self._messages.mounting(self.visit.route.start_ns)
        with LookAhead(self._exposures()) as exposures:
            streams = (self._poses(), self._forces(), self._sensed(iter(exposures), progress))
            yield from heapq.merge(*streams, key=attrgetter("log_ns"))

    def _poses(self) -> Iterator[Outgoing]:
        stamps_ns = self._odometry.stamps_ns
        truth = self.visit.route.T_world_base(stamps_ns)
        for stamp_ns, T_odom_base, T_world_base in zip(
            stamps_ns.tolist(), self._odometry.T_odom_base, truth, strict=True
        ):
            yield from self._messages.odometry(stamp_ns, T_odom_base)
            yield self._messages.true_pose(stamp_ns, T_world_base)

    def _forces(self) -> Iterator[Outgoing]:
        samples = imu_samples(self.visit.route, self._rig.imu, self._rig.T_base_imu, self._rng(_Noise.IMU))
        for sample in zip(samples.stamps_ns.tolist(), samples.angular_rate, samples.specific_force, strict=True):
            yield self._messages.imu(*sample)

    def _exposures(self) -> Iterator[tuple[int, View | LidarScan]]:
        """Exact images, and LiDAR scans, in the order of time."""
        images: Iterator[_Exposing] = ((stamp_ns, self._view) for stamp_ns in self._images_ns.tolist())
        scans: Iterator[_Exposing] = self._scans()
        for stamp_ns, expose in heapq.merge(images, scans, key=itemgetter(0)):
            yield stamp_ns, expose(stamp_ns)

    def _view(self, stamp_ns: int) -> View:
        with self._clock.stage("render"):
            return render(self._robot.scene, self._rig.camera, self._T_world_camera(stamp_ns), stamp_ns)

    def _scans(self) -> Iterator[_Exposing]:
        """When the LiDAR begins its scans, and how."""
        lidar, T_base_lidar, route = self._rig.lidar, self._rig.T_base_lidar, self.visit.route
        if lidar is None or T_base_lidar is None:
            return
        sensor = LidarSensor(lidar, self._seed(_Noise.LIDAR))

        def scan(stamp_ns: int) -> LidarScan:
            with self._clock.stage("lidar"):
                return sensor.scan(self._robot.scene, lambda at_ns: route.T_world_base(at_ns) @ T_base_lidar, stamp_ns)

        for stamp_ns in sample_stamps_ns(route, lidar.rate_hz)[:-1].tolist():
            yield stamp_ns, scan

    def _T_world_camera(self, stamp_ns: int) -> FloatArray:
        T_world_camera: FloatArray = self.visit.route.T_world_base(np.array([stamp_ns]))[0] @ self._rig.T_base_camera
        return T_world_camera

    def _sensed(self, exposures: Iterator[tuple[int, View | LidarScan]], progress: Progress) -> Iterator[Outgoing]:
        """Camera, LiDAR and detector; detections wait until they are there."""
        eyes = SimulatedDetector(self._robot.scenario.world, self._robot.errors, self._seed(_Noise.DETECTOR))
        depth_rng, late, images = self._rng(_Noise.DEPTH), deque[Outgoing](), 0
        for stamp_ns, exposure in exposures:
            while late and late[0].log_ns <= stamp_ns:
                yield late.popleft()
            if isinstance(exposure, LidarScan):
                with self._clock.stage("encode"):
                    scan = self._messages.points(stamp_ns, exposure)
                yield scan
                continue
            yield from self._photographed(exposure, depth_rng)
            if images % self._rig.detection_every == 0:
                late.extend(self._detected(exposure, eyes, not_before_ns=late[-1].log_ns if late else stamp_ns))
            images += 1
            progress(self.visit.name, images, len(self._images_ns))
        yield from late

    def _photographed(self, view: View, rng: np.random.Generator) -> list[Outgoing]:
        """What the camera makes of a view."""
        depth_m = None
        if self._rig.depth is not None:
            with self._clock.stage("depth"):
                depth_m = measure_depth(view, self._rig.depth, rng)
        with self._clock.stage("encode"):
            messages = list(self._messages.colour(view.stamp_ns, view.rgb))
            if depth_m is not None:
                messages += self._messages.depth(view.stamp_ns, depth_m)
        return messages

    def _detected(self, view: View, eyes: SimulatedDetector, *, not_before_ns: int) -> list[Outgoing]:
        """What the detector makes of a view, told after its latency, and after what it told before."""
        camera, T_world_camera = self._rig.camera, self._T_world_camera(view.stamp_ns)
        with self._clock.stage("sights"):
            sights = self._robot.sight_lines.look(view, camera, T_world_camera)
        if len(self.watched) % COVERAGE_EVERY == 0:
            with self._clock.stage("coverage"):
                self._robot.coverage.add(view, camera, T_world_camera)
        with self._clock.stage("detect"):
            full_turn = isinstance(camera, EquirectangularCamera)
            found = eyes.detect(view, sights, full_turn=full_turn, camera=camera, T_world_camera=T_world_camera)
        self.watched.append((view.stamp_ns, sights))
        log_ns = max(view.stamp_ns + round(eyes.latency_s() * 1e9), not_before_ns)
        with self._clock.stage("encode"):
            return list(self._messages.detections(found, log_ns))
