"""The things that the goals of an instruction mean, by the same answers as `supermap query`; never a silent guess."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.geometry.voxels import voxel_centers
from supermap_cli.language.instructions import Goal
from supermap_cli.language.questions import Find, Identified, Named, Question, Things, Union
from supermap_cli.language.times import Last
from supermap_cli.memory.keyframe_views import camera_poses, observing_keyframes
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.navigation.approach import Target
from supermap_cli.navigation.parameters import DEFAULT, NavigationParameters
from supermap_cli.query.answers import answer_question
from supermap_cli.query.views import InstanceView, IntervalView

MOST_CANDIDATES = 10
"""Candidates of an ambiguous goal that are listed."""
VIEWS_OF_A_THING = 60
"""Keyframes by which the sides are told that a thing was seen from."""

Fate = Literal["stands", "ambiguous", "gone", "unknown"]
"""What became of a goal: it stands, alone or among those that will do; several fit and one was meant; all that fitted
have gone; nothing fits.
"""


@dataclass(frozen=True)
class Meant:
    """What a goal means. `instances`: what stands of it, all that fit; `gone`: what fitted once, where and until when,
    newest first; `message` and `notes` are of the answer.
    """

    fate: Fate
    goal: Goal
    instances: tuple[InstanceView, ...]
    more: int | None
    gone: tuple[InstanceView, ...]
    alternatives: tuple[InstanceView, ...]
    message: str
    notes: tuple[str, ...]


def find_meant(reader: MapReader, goal: Goal, limit: int = MOST_CANDIDATES) -> Meant:
    """The things of a goal that stand now, else those that did."""
    found = answer_question(goal.question, reader, limit=limit)
    standing = tuple(each for each in found.instances if each.presence == "present")
    if standing:
        several = len(standing) > 1 and not (goal.each or goal.any_of)
        fate: Fate = "ambiguous" if several else "stands"
        return Meant(fate, goal, standing, found.more, (), (), found.message, found.notes)
    before = answer_question(replace(goal.question, time=Last()), reader, limit=limit)
    gone = tuple(each for each in before.instances if each.presence == "absent")
    newest = sorted(gone, key=lambda each: -each.intervals[-1].last_seen_ns)
    others = _others(reader, goal.question, limit) if gone or found.nearest else ()
    return Meant("gone" if gone else "unknown", goal, (), 0, tuple(newest), others, found.message, found.notes)


def _others(reader: MapReader, question: Question, limit: int) -> tuple[InstanceView, ...]:
    """What stands of the same name, whatever else was said of it."""
    assert isinstance(question.body, Find)  # noqa: S101 - goals are
    noun = question.body.things.noun
    if isinstance(noun, Identified):
        instance = reader.instance(noun.id)
        if instance is None:
            return ()
        noun = Named(instance.label, instance.label)
    if not isinstance(noun, Named | Union):
        return ()
    plain = replace(question, body=Find(Things(noun)))
    return tuple(each for each in answer_question(plain, reader, limit=limit).instances if each.presence == "present")


def telling_text(reader: MapReader, instance: InstanceView) -> str:
    """Where an instance stands, as a sentence: what tells it from others of its name."""
    asked = Question(instance.id, Find(Things(Identified(instance.id)), place=True))
    return answer_question(asked, reader, limit=1).message


def target_of(reader: MapReader, text_id: str, parameters: NavigationParameters = DEFAULT) -> Target:
    """What an approach needs of an instance that stands."""
    instance = reader.instance(text_id)
    assert instance is not None  # noqa: S101 - an answer has named it
    return Target(instance.box, _surface(reader, instance, parameters.target_points), _seen_from(reader, instance))


def _surface(reader: MapReader, instance: StoredInstance, most: int) -> FloatArray:
    """Points (n, 3) of an instance, spread over its voxels; the middles of its box's faces where it has none."""
    cloud = reader.voxels(instance)
    points = voxel_centers(cloud.keys[cloud.log_odds > 0], cloud.voxel_m)
    if not len(points):
        return _faces(instance.box)
    order = np.lexsort(points.T)
    return points[order[:: -(-len(order) // most)]]


def _faces(box: Box3D) -> FloatArray:
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    axes = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * box.size[:, None] / 2
    faces: FloatArray = box.center + np.concatenate([axes, -axes])
    return faces


def _seen_from(reader: MapReader, instance: StoredInstance) -> FloatArray:
    """Camera positions (k, 3) from which it was seen where it stands now."""
    observed = reader.observations(instance)
    stays_ns = instance.states[-1].first_seen_ns if instance.states else 0
    numbers = sorted({each.keyframe_id for each in observed if each.stamp_ns >= stays_ns})
    spread = numbers[:: -(-len(numbers) // VIEWS_OF_A_THING) or 1]
    ids = spread or observing_keyframes(reader.connection, instance.numbers, VIEWS_OF_A_THING)
    poses = camera_poses(reader.connection, ids)
    return np.array([T[:3, 3] for T in poses.values()]).reshape(-1, 3)


def last_interval(instance: InstanceView) -> IntervalView:
    """Where it stood last."""
    return instance.intervals[-1]
