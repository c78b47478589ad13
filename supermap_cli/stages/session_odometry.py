"""What sensors say goes to the odometry, as far as it wants it, and to the localizer, with the poses it makes of it."""

from __future__ import annotations

from supermap_cli.protocols import Odometry
from supermap_cli.stages.checked_answers import checked_pose
from supermap_cli.stages.localization import Localizer
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep


class SessionOdometry:
    """Pushes into both. Without an `odometry`, poses that are pushed are the motion.

    The main camera, whose frames are the odometry's "color", is that of the first frame; "color.left" is "left".
    """

    def __init__(self, odometry: Odometry | None, localizer: Localizer) -> None:
        self._odometry = odometry
        self._localizer = localizer
        self._main_camera: str | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful in the motion."""
        return () if self._odometry is None else tuple(self._odometry.warnings)

    def add_imu(self, sample: ImuSample) -> None:
        """An IMU sample."""
        self._localizer.add_imu(sample)
        if (odometry := self._wanting("imu")) is not None:
            odometry.add_imu(sample)

    def add_pose(self, pose: StampedPose) -> None:
        """A pose of the robot's own odometry."""
        if self._odometry is None:
            self._localizer.add_pose(pose)
        elif (odometry := self._wanting("poses")) is not None:
            self._add_estimate(odometry.register_pose(pose))

    def add_sweep(self, sweep: Sweep) -> None:
        """A LiDAR sweep."""
        if (odometry := self._wanting("lidar")) is not None:
            self._add_estimate(odometry.register_sweep(sweep))
        self._localizer.add_sweep(sweep)

    def add_frame(self, frame: CameraFrame, awaits_detections: bool) -> None:
        """A camera frame."""
        self._main_camera = self._main_camera or frame.camera_id
        wanting = self._wanting("color") if frame.camera_id == self._main_camera else None
        if (odometry := wanting or self._wanting(f"color.{frame.camera_id}")) is not None:
            self._add_estimate(odometry.register_frame(frame))
        self._localizer.add_frame(frame, awaits_detections=awaits_detections)

    def finish(self) -> None:
        """Nothing comes any more. Raises `OdometryError` when there was no usable motion."""
        if self._odometry is not None:
            self._odometry.finish()

    def _wanting(self, stream: str) -> Odometry | None:
        return self._odometry if self._odometry is not None and stream in self._odometry.inputs else None

    def _add_estimate(self, answer: object) -> None:
        pose = checked_pose(answer, self._odometry)
        if pose is not None:
            self._localizer.add_pose(pose)
