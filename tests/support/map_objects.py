"""Objects of a map, and stored depth images of scenes, for tests of merging maps."""

from __future__ import annotations

import numpy as np

from supermap_cli.geometry.cameras import camera_to_json
from supermap_cli.geometry.voxels import pack_keys, voxel_keys
from supermap_cli.map_merge.depth_consistency import DepthConsistency
from supermap_cli.map_merge.displacement import DisplacementHypothesis
from supermap_cli.mapping.belief import Existence, LabelBelief
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.mapping.objects import MapObject, ObjectMap, ObjectStatus, OpenState
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.memory import KeyframeRecord
from support import scenes as s

TABLE = s.Thing("table", (2.0, 0, 0.4), (0.8, 1.6, 0.8), (150, 100, 60))
STORED = ObjectStatus(confirmed=True, stored=True)


def map_object(number: int, of: s.Thing, low: float = 0.0, high: float = 1.0) -> MapObject:
    """The surface of a box as an object, or only a part of it along its y axis."""
    box_low, box_high = np.array(of.center) - np.array(of.size) / 2, np.array(of.center) + np.array(of.size) / 2
    ticks = [np.arange(a + 0.01, b, 0.02) for a, b in zip(box_low, box_high, strict=True)]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    on_rim = (np.abs(points - box_low) < 0.025).any(axis=1) | (np.abs(points - box_high) < 0.025).any(axis=1)
    along = (points[:, 1] - box_low[1]) / of.size[1]
    points = points[on_rim & (along >= low) & (along <= high)]
    codes = np.unique(pack_keys(voxel_keys(points, 0.02)))
    ones = np.ones(len(codes), np.float32)
    labels = LabelBelief()
    labels.update((Hypothesis(of.label, 0.9),), 2.0)
    voxels = VoxelMap(0.02, codes, ones * 2, ones * 3, ones * 0, np.tile(np.float32(of.rgb), (len(codes), 1)))
    return MapObject(number, voxels, labels, Existence(4.0), OpenState(0, s.ns(0)), s.ns(0), s.ns(5), status=STORED)


def record(things: tuple[s.Thing, ...], eye: s.Point, at_s: float) -> KeyframeRecord:
    scene = s.render((*s.ROOM, *things), s.looking(eye, (2.0, 0, 0.4)), at_s)
    keyframe = scene.keyframe
    return KeyframeRecord(
        keyframe.stamp_ns,
        keyframe.T_map_base,
        keyframe.T_map_camera,
        camera_to_json(keyframe.camera),
        encode_small_depth(keyframe, 2),
        2,
        None,
        detected=True,
    )


def keyframes_of(things: tuple[s.Thing, ...]) -> list[KeyframeRecord]:
    return [record(things, (0.0, float(y), 1.6), 100 + k) for k, y in enumerate(np.linspace(-1, 1, 8))]


def compare(
    known: MapObject, things: tuple[s.Thing, ...], aside: DisplacementHypothesis | None = None
) -> DepthConsistency:
    objects = ObjectMap(10)
    objects.add(known)
    consistency = DepthConsistency(objects, frozenset(), {} if aside is None else {known.number: aside})
    for keyframe in keyframes_of(things):
        consistency.add_keyframe(1, keyframe)
    return consistency
