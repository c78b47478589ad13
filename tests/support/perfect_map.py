"""A map without any error, made straight from a ground truth: what the images show well enough, as it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.memory import open_store
from supermap_cli.query.answers import answer
from supermap_cli.simulation.recording.true_walls import true_walls
from supermap_cli.types.memory import InstanceRecord, MapDelta, SpatialEdge, StateRecord, Visit
from supermap_cli.types.relations import GraphNode
from supermap_cli.types.truth import GroundTruth, TrueState, TrueTraversal
from support import memories as m

SUPPORT_PIXELS, SUPPORT_FRAMES = 100, 3


def write_perfect_map(path: Path, truth: GroundTruth) -> dict[str, str]:
    """Write the map; returns which true object each of its instances is (instance id -> object id)."""
    numbers: dict[int, int] = {}
    graph = SceneGraph(walls=TrueWalls(truth))
    with open_store(str(path), create=True) as store:
        for index, traversal in enumerate(truth.traversals):
            delta = _delta(truth, index, numbers, graph)
            start = replace(m.start(traversal.name, (0, 1)), start_ns=traversal.start_ns, end_ns=traversal.end_ns)
            number = store.begin_traversal(start)
            store.commit(number, delta)
            store.finish_traversal(number, {})
        names = store.instance_ids()
    return {names[number]: truth.objects[k].id for k, number in numbers.items()}


def wrong_answers(truth: GroundTruth, path: Path) -> list[str]:
    """The truth's questions that its perfect map does not answer with exactly the right ids."""
    names = write_perfect_map(path, truth)
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        found = {question.text: answer(question.text, reader).instances for question in truth.questions}
    answers = {text: tuple(sorted(names[instance.id] for instance in instances)) for text, instances in found.items()}
    return [question.text for question in truth.questions if answers[question.text] != question.answer]


class TrueWalls:
    """The walls of the building, known from the start."""

    def __init__(self, truth: GroundTruth) -> None:
        self.views = 1
        self.clear_between = true_walls(truth)


@dataclass(frozen=True)
class _Support:
    """When the images up to now showed a state, and since when they show its place empty."""

    index: int
    first_ns: int
    last_ns: int
    gone_ns: int | None
    empty_before_ns: int | None
    in_last: tuple[int, int] | None


def _delta(truth: GroundTruth, traversal: int, numbers: dict[int, int], graph: SceneGraph) -> MapDelta:
    instances: list[InstanceRecord] = []
    states: list[StateRecord] = []
    visits: list[Visit] = []
    nodes: dict[int, GraphNode] = {}
    observations = []
    for k, thing in enumerate(truth.objects):
        supported = [] if thing.kind == "person" else list(_supported(truth, k, traversal))
        if not supported:
            continue
        number = numbers.setdefault(k, len(numbers) + 1)
        records = [
            _record(number, at, support, supported, thing.states, thing.label) for at, support in enumerate(supported)
        ]
        newest, is_gone = thing.states[supported[-1].index], records[-1].gone_ns is not None
        states += records
        center = tuple(map(float, newest.centroid))
        instance = m.instance(number, thing.label, center, presence="absent" if is_gone else "present")
        instances.append(
            replace(
                instance, box=newest.box, first_seen_ns=records[0].first_seen_ns, last_seen_ns=records[-1].last_seen_ns
            )
        )
        seen = [support.in_last for support in supported if support.in_last is not None]
        visits.append(
            Visit(number, len(seen), len(seen) + is_gone, int(is_gone), *(seen[-1] if seen else (None, None)))
        )
        observations += [replace(m.observation(number, 0, thing.label), stamp_ns=at) for span in seen for at in {*span}]
        if not is_gone:
            nodes[number] = GraphNode(number, thing.label, newest.box, thing.surface_world(newest))
    stamps_ns = truth.traversals[traversal].stamps_ns
    edges: tuple[SpatialEdge, ...] = graph.update(nodes, set(nodes), int(stamps_ns[-1]))
    return MapDelta(
        keyframes=tuple(
            replace(m.keyframe(0), stamp_ns=int(at), T_map_base=pose, T_map_camera=pose)
            for at, pose in zip(stamps_ns, truth.traversals[traversal].T_world_base, strict=True)
        ),
        instances=tuple(instances),
        observations=tuple(observations),
        states=tuple(states),
        visits=tuple(visits),
        spatial_edges=edges,
    )


def _supported(truth: GroundTruth, k: int, last: int) -> Iterator[_Support]:
    """The states of an object that the traversals up to the last one showed."""
    for index, state in enumerate(truth.objects[k].states):
        seen = [_support_ns(traversal, k, index) for traversal in truth.traversals[: last + 1]]
        seen_ns = np.concatenate(seen)
        if len(seen_ns) >= SUPPORT_FRAMES:
            empty = [_empty_ns(traversal, k, index, state) for traversal in truth.traversals[: last + 1]]
            gone_ns = int(np.concatenate(empty)[0]) if len(np.concatenate(empty)) else None
            in_last = (int(seen[-1][0]), int(seen[-1][-1])) if len(seen[-1]) else None
            before = [_empty_before_ns(traversal, k, index) for traversal in truth.traversals[: last + 1]]
            before_ns = np.concatenate(before)[np.concatenate(before) < seen_ns[0]]
            empty_before_ns = int(before_ns[-1]) if len(before_ns) else None
            yield _Support(index, int(seen_ns[0]), int(seen_ns[-1]), gone_ns, empty_before_ns, in_last)


def _support_ns(traversal: TrueTraversal, k: int, state: int) -> np.ndarray:
    rows = traversal.sightings
    good = (rows.object == k) & (rows.state == state) & rows.present & (rows.pixels >= SUPPORT_PIXELS)
    return traversal.stamps_ns[rows.frame[good & (rows.visible >= 0.2)]]


def _empty_ns(traversal: TrueTraversal, k: int, index: int, state: TrueState) -> np.ndarray:
    rows = traversal.sightings
    left = (rows.object == k) & (rows.state == index) & ~rows.present & (rows.visible >= 0.4)
    stamps_ns = traversal.stamps_ns[rows.frame[left]]
    return stamps_ns[stamps_ns >= (np.inf if state.until_ns is None else state.until_ns)]


def _empty_before_ns(traversal: TrueTraversal, k: int, index: int) -> np.ndarray:
    rows = traversal.sightings
    empty = (rows.object == k) & (rows.state == index) & ~rows.present & (rows.visible >= 0.4)
    return traversal.stamps_ns[rows.frame[empty]]


def _record(
    number: int, at: int, support: _Support, supported: list[_Support], states: tuple[TrueState, ...], label: str
) -> StateRecord:
    """A state ends when its place is seen empty, or when the thing is seen elsewhere."""
    state = states[support.index]
    ends = [support.gone_ns, *(later.first_ns for later in supported[at + 1 :])]
    gone_ns = min((end for end in ends if end is not None), default=None)
    record = m.state(number, at, (0, 1), label=label)
    return replace(
        record,
        first_seen_ns=support.first_ns,
        last_seen_ns=support.last_ns,
        gone_ns=gone_ns,
        empty_before_ns=support.empty_before_ns,
        centroid_map=state.centroid,
        box=state.box,
    )
