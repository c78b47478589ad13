"""Two short traversals of the room of `simulated`: in the first the box is carried, before the second a cup goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supermap_cli.geometry.cameras import EquirectangularCamera, PinholeCamera
from supermap_cli.geometry.se3 import make_transform
from supermap_cli.simulation.building_plan import BuildingPlan, Room
from supermap_cli.simulation.rigs import (
    DepthSensor,
    Imu,
    OdometryDrift,
    SimulatedRig,
    panorama_rig,
    rgbd_rig,
    three_camera_rig,
)
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from support import simulated

T_WORLD_ODOM = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [-1.0, 0.5, 0.0])
PLAN = BuildingPlan((Room("room", np.array([-3, -2.5]), np.array([3, 2.5])),), (), 2.6)


def small_rig() -> SimulatedRig:
    """An RGB-D robot with a small image and no noise at all, five images a second."""
    camera = PinholeCamera(160, 120, 116.0, 116.0, 79.5, 59.5)
    exact = DepthSensor(noise_per_m=0.0, edge_px=0, lost_share=0.0)
    still = Imu(gyro_noise=0, gyro_bias=0, accelerometer_noise=0, accelerometer_bias=0)
    drift = OdometryDrift(position=0, yaw_deg=0, per_turn_deg=0, scale=0, jitter_m=0)
    rig = with_camera_model(rgbd_rig(), camera)
    return replace(rig, depth=exact, imu=still, drift=drift, image_rate_hz=5.0, detection_every=1)


def with_camera_model(rig: SimulatedRig, model: PinholeCamera | EquirectangularCamera) -> SimulatedRig:
    """The rig with other cameras in the places of its own."""
    return replace(rig, cameras=tuple(replace(camera, model=model) for camera in rig.cameras))


def small_three_camera_rig() -> SimulatedRig:
    """Three of the cameras of `small_rig`, with noise in their depth."""
    small = small_rig()
    rig = with_camera_model(three_camera_rig(), small.cameras[0].model)
    return replace(rig, imu=small.imu, drift=small.drift, image_rate_hz=5.0, detection_every=1)


def only_camera(rig: SimulatedRig, camera_id: str) -> SimulatedRig:
    """The rig without its other cameras."""
    return replace(rig, cameras=(rig.camera(camera_id),))


def small_panorama_rig() -> SimulatedRig:
    """A LiDAR robot with a small panorama."""
    rig = panorama_rig()
    assert rig.lidar is not None
    small = with_camera_model(rig, EquirectangularCamera(200, 100))
    return replace(small, lidar=replace(rig.lidar, points_per_scan=1000))


def route(start_ns: int, seconds: float) -> Route:
    """From a corner along the wall, looking at the middle of the room."""
    share = np.linspace(0, 1, 8)
    xy = np.column_stack([np.full(8, 2.4), -1.9 + 3.2 * share])
    yaw = np.arctan2(-xy[:, 1], -xy[:, 0] - 0.4)
    return Route(start_ns, share * seconds, xy, np.unwrap(yaw))


def two_traversals(rig: SimulatedRig | None = None) -> Scenario:
    """A few seconds each."""
    later_ns = simulated.CUP_LEAVES_NS + 60 * simulated.SECOND_NS
    traversals = (
        SimulatedTraversal("monday", route(simulated.START_NS, 5.0), T_WORLD_ODOM),
        SimulatedTraversal("tuesday", route(later_ns, 2.0), np.eye(4)),
    )
    world = simulated.small_world()
    stays = [
        replace(stay, until_ns=simulated.CUP_LEAVES_NS) if stay.thing_id == "chair-1" else stay for stay in world.stays
    ]
    return Scenario("test", 3, PLAN, replace(world, stays=tuple(stays)), rig or small_rig(), traversals)
