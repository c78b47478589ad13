"""True surfaces that images showed as labelled points, and the nearest instance of the map to each point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedObject
from supermap_cli.evaluation.known_truth import KnownTruth, Place
from supermap_cli.geometry.arrays import BoolArray, FloatArray, IntArray
from supermap_cli.types.truth import GroundTruth

MAX_SURFACE_DISTANCE_M = 0.05
"""Metres within which the instance with the nearest point gets a sample. Chosen: `semantics.VOXEL_M`."""

UNASSIGNED = -1
"""Index of samples without a place or instance; as -1 it selects the last entry, which tables reserve for it."""


@dataclass(frozen=True)
class SeenSurface:
    """Samples of what the images showed of the world as it is at the end: `points` (n, 3) in the world.

    `place` (n,) indexes `places`, the standing objects; it is `UNASSIGNED` on the building, whose parts `fixture` (n,)
    names as an index into `fixture_labels` (`UNASSIGNED` on objects).
    """

    points: FloatArray
    place: IntArray
    fixture: IntArray
    places: tuple[Place, ...]
    fixture_labels: tuple[str, ...]


def seen_surface(truth: GroundTruth, known: KnownTruth) -> SeenSurface:
    """All seen samples of standing objects and of the building.

    Samples of the building within `MAX_SURFACE_DISTANCE_M` of an object's surface are left out: there the nearest point
    of the map does not separate the two.
    """
    places = tuple(known.places[k] for k in known.standing)
    of_objects = [place.object.surface_world(place.state) for place in places]
    whole_surfaces = np.concatenate(
        [np.zeros((0, 3)), *(place.object.surface_world(place.state, only_seen=False) for place in places)]
    )
    labels = tuple(dict.fromkeys(surface.label for surface in truth.surfaces))
    of_fixtures = [_away_from(surface.points_world.astype(np.float64), whole_surfaces) for surface in truth.surfaces]
    on_objects = sum(map(len, of_objects))
    on_fixtures = sum(map(len, of_fixtures))
    numbers = [labels.index(surface.label) for surface in truth.surfaces]
    return SeenSurface(
        points=np.concatenate([np.zeros((0, 3)), *of_objects, *of_fixtures]),
        place=np.concatenate([_repeat_per_part(range(len(places)), of_objects), np.full(on_fixtures, UNASSIGNED)]),
        fixture=np.concatenate([np.full(on_objects, UNASSIGNED), _repeat_per_part(numbers, of_fixtures)]),
        places=places,
        fixture_labels=labels,
    )


def nearest_instances(points: FloatArray, instances: Sequence[EstimatedObject]) -> IntArray:
    """(n,): index of the instance that has the nearest point; `UNASSIGNED` beyond `MAX_SURFACE_DISTANCE_M`."""
    cloud = np.concatenate([np.zeros((0, 3)), *(instance.points for instance in instances)])
    nearest = _nearest(points, cloud)
    owner = np.append(_repeat_per_part(range(len(instances)), [instance.points for instance in instances]), UNASSIGNED)
    return owner[nearest]


def _away_from(points: FloatArray, surface: FloatArray) -> FloatArray:
    """The points with no point of a surface within `MAX_SURFACE_DISTANCE_M`."""
    apart: BoolArray = _nearest(points, surface) == len(surface)
    return points[apart]


def _nearest(points: FloatArray, cloud: FloatArray) -> IntArray:
    """(n,): index of the nearest point of a cloud (m, 3); m where none is within `MAX_SURFACE_DISTANCE_M`."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 - heavy

    if not len(cloud) or not len(points):
        return np.full(len(points), len(cloud))
    _, nearest = cKDTree(cloud).query(points, distance_upper_bound=MAX_SURFACE_DISTANCE_M)
    return np.asarray(nearest, np.int64)


def _repeat_per_part(numbers: Sequence[int], parts: Sequence[FloatArray]) -> IntArray:
    """For every point of all parts, the number of its part."""
    return np.repeat(np.array(numbers, np.int64), [len(part) for part in parts])
