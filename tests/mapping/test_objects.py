"""The objects of a map, and how often they were looked at."""

from __future__ import annotations

import numpy as np
import pytest

from supermap_cli.mapping.belief import BeliefParameters, Existence, LabelBelief, Viewpoint
from supermap_cli.mapping.object_shape import ObjectShapeParameters
from supermap_cli.mapping.objects import MapObject, ObjectMap, ObjectParameterSets, OpenState, VisitCount
from supermap_cli.mapping.voxel_map import VoxelMap
from support import scenes as s


def an_object(number: int, center: s.Point) -> MapObject:
    """A cube with sides of 20 cm, in voxels of 1 cm."""
    ticks = np.arange(-0.095, 0.1, 0.01)
    points = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3) + center
    voxels = VoxelMap(0.01)
    voxels.add_points(points, np.zeros((len(points), 3), np.uint8), 0.85)
    return MapObject(number, voxels, LabelBelief(), Existence(0.0), OpenState(0, 0), 0, 0)


def test_a_shape_is_measured_anew_only_when_the_voxels_changed() -> None:
    one = an_object(1, (0, 0, 0))
    shape = one.shape
    assert one.shape is shape
    one.voxels_changed()
    assert one.shape is not shape


def test_numbers_are_never_used_twice() -> None:
    objects = ObjectMap()
    first = objects.new_number()
    objects.add(an_object(first, (0, 0, 0)))
    objects.remove(first)
    assert objects.new_number() == first + 1
    assert len(objects) == 0


def test_objects_within_reach_are_those_whose_bounds_are() -> None:
    objects = ObjectMap()
    assert objects.within(np.zeros(3), 10.0) == []
    for number, x in ((1, 1.0), (2, 2.0), (3, 4.0)):
        objects.add(an_object(number, (x, 0, 0)))
    assert [obj.number for obj in objects.within(np.zeros(3), 1.95)] == [1, 2]


def test_a_keyframe_supports_an_object_once_and_two_cameras_at_one_moment_give_two_keyframes() -> None:
    visit = VisitCount()
    for stamp_ns, camera in ((1, "left"), (1, "left"), (1, "right"), (2, "left")):
        visit.add_support(stamp_ns, camera)
    assert (visit.supported, visit.in_view) == (3, 3)
    assert (visit.first_support_ns, visit.last_support_ns) == (1, 2)


def test_an_object_follows_the_parameters_of_the_map_it_is_in() -> None:
    sets = ObjectParameterSets(
        object_shape=ObjectShapeParameters(max_coarse_m=0.03), belief=BeliefParameters(max_existence=1.0)
    )
    objects, one = ObjectMap(parameters=sets), an_object(1, (0, 0, 0))
    assert one.shape.coarse_m == pytest.approx(0.04)
    objects.add(one)
    assert one.shape.coarse_m == pytest.approx(0.03)
    one.existence.add_detection(Viewpoint(0, np.zeros(3), np.ones(3)), 5.0)
    assert one.existence.log_odds == 1.0
