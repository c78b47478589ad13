"""The small world of `support.simulated` as a map: what a robot's depth camera shows on a drive through it, rendered,
and its things as instances. Map and world are one frame.

The cup is gone in the second traversal; there are two chairs, one of them made up for the tests beside a wall; a piano
stands outside, where nobody has been.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from supermap_cli.geometry.cameras import PinholeCamera, camera_to_json
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.geometry.voxels import voxel_keys
from supermap_cli.simulation.sensors.scene import Scene
from supermap_cli.simulation.world import SimulatedThing, Stay, World, box_of, sample_surface
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, MapDelta, VoxelCloud
from support import memories as m
from support import simulated

CAMERA = PinholeCamera(640, 480, 400.0, 400.0, 319.5, 239.5)
STEP_PX = 8
CAMERA_M = 1.0
TILT_RAD = 0.3
VOXEL_M = 0.04
PLACES = 18
"""Places of the drive, at each of which the robot looks three ways."""
LAST_S = 3 * PLACES - 1
"""s after the first keyframe of a drive: the last."""
CUP_ID, PIANO = "cup-1", "piano"


@cache
def world() -> World:
    """The small world with a second chair, without the carried box's motion."""
    plain = simulated.small_world()
    chair = SimulatedThing("chair-2", "chair", plain.thing("chair-1").shape)
    stays = [stay for stay in plain.stays if stay.thing_id != "box-1"]
    box = Stay("box-1", simulated.standing(*simulated.BOX_TO))
    return World(
        plain.fixtures,
        (*plain.things, chair),
        (*stays, box, Stay("chair-2", simulated.standing(-1.5, 2.0, 0, np.pi))),
    )


def poses() -> list[np.ndarray]:
    """T_world_base (4, 4) around the room: once around the table, looking at it and at the walls."""
    found = []
    for k in range(PLACES):
        angle = 2 * np.pi * k / PLACES
        x, y = 1.9 * np.cos(angle), 1.75 * np.sin(angle)
        for heading in (angle + np.pi / 2, angle + np.pi, angle):
            c, s = np.cos(heading), np.sin(heading)
            found.append(make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, 0]))
    return found


def _T_base_camera() -> np.ndarray:
    """(4, 4) forward, tilted down."""
    c, s = np.cos(TILT_RAD), np.sin(TILT_RAD)
    return make_transform(np.array([[0, -s, c], [-1, 0, 0], [0, -c, -s]]), [0.1, 0, CAMERA_M])


@cache
def _scene() -> Scene:
    return Scene(world())


def keyframe(stamp_ns: int, T_world_base: np.ndarray, world_ns: int) -> KeyframeRecord:
    """What the camera at a pose sees of the world at a time."""
    T = T_world_base @ _T_base_camera()
    u, v = np.meshgrid(np.arange(0, 640, STEP_PX), np.arange(0, 480, STEP_PX))
    pixels = np.column_stack([u.ravel(), v.ravel()]).astype(float)
    rays = CAMERA.back_project(pixels, np.ones(len(pixels))) @ T[:3, :3].T
    depth = _scene().cast(world_ns, T[:3, 3], rays, colour=False).distance
    small = np.where(np.isfinite(depth), depth, 0).reshape(u.shape)
    png = cv2.imencode(".png", np.rint(small * 1000).clip(0, 65535).astype(np.uint16))[1].tobytes()
    return KeyframeRecord(stamp_ns, T_world_base, T, camera_to_json(CAMERA), png, STEP_PX, None, detected=True)


def _cloud(thing: SimulatedThing, T_world_thing: np.ndarray) -> VoxelCloud:
    points = transform_points(T_world_thing, sample_surface(thing.shape, 0.02)[0])
    keys = np.unique(voxel_keys(points, VOXEL_M), axis=0)
    ones = np.ones(len(keys), np.float32)
    return VoxelCloud(VOXEL_M, keys, 2 * ones, ones, 0 * ones, np.full((len(keys), 3), 128, np.uint8))


def _record(number: int, thing: SimulatedThing, stay: Stay, *, present: bool) -> InstanceRecord:
    box = box_of(thing.shape, stay.T_world_thing)
    seen = (0, 100 + LAST_S) if present else (0, LAST_S)
    plain = m.instance(number, thing.label, seen=seen, presence="present" if present else "absent", observations=2)
    return replace(plain, centroid_map=box.center, box=box, voxels=_cloud(thing, stay.T_world_thing))


def _delta(begin: int, *, second: bool) -> MapDelta:
    """One drive around, with everything that stands there then."""
    world_ns = simulated.CUP_LEAVES_NS + (1 if second else -1)
    frames = tuple(keyframe(m.ns(begin + k), T, world_ns) for k, T in enumerate(poses()))
    stays = [stay for stay in world().stays if stay.covers(simulated.CUP_LEAVES_NS - 1)]
    things = [(number, world().thing(stay.thing_id), stay) for number, stay in enumerate(stays, start=1)]
    records, states = [], []
    for number, thing, stay in things:
        present = thing.id != CUP_ID or not second
        record = _record(number, thing, stay, present=present)
        states.append(
            replace(
                m.state(number, 0, (0, begin + LAST_S if present else LAST_S), label=thing.label),
                centroid_map=record.box.center,
                box=record.box,
                gone_ns=None if present else m.ns(begin),
            )
        )
        records.append(replace(record, last_seen_ns=states[-1].last_seen_ns))
    piano = m.instance(90, PIANO, (8.0, 0.0, 0.5), (1.4, 0.6, 1.0), seen=(0, begin + LAST_S))
    states.append(m.state(90, 0, (0, begin + LAST_S), (8.0, 0.0, 0.5), (1.4, 0.6, 1.0), label=PIANO))
    numbers = [number for number, thing, _ in things if not (second and thing.id == CUP_ID)]
    observed = tuple(m.observation(number, begin + at, states[0].label) for number in numbers for at in (0, LAST_S))
    return MapDelta(keyframes=frames, observations=observed, instances=(*records, piano), states=tuple(states))


def write_map(path: Path) -> Path:
    """Two drives, an hour apart; the cup stands there in the first only."""
    first, second = _delta(0, second=False), _delta(100, second=True)
    return m.make_memory(path, ("morning", (0, LAST_S), first), ("noon", (100, 100 + LAST_S), second))
