"""Random maps of two traversals: for property tests of questions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from supermap_cli.types.memory import InstanceRecord, MapDelta, SpatialEdge, StateRecord, Visit
from support import memories as m

LABELS = ("chair", "table", "cup", "lamp")
TRAVERSALS = (("monday", (0, 50)), ("tuesday", (80, 130)))


def make_history(rng: np.random.Generator, number: int) -> tuple[InstanceRecord, list[StateRecord], list[list[Visit]]]:
    """One instance with up to three states, some called otherwise than today, and its visits by traversal."""
    label = str(rng.choice(LABELS))
    times = np.sort(rng.choice(np.r_[0:50, 80:130], 6, replace=False)).tolist()
    states = []
    for index in range(int(rng.integers(1, 4))):
        center = (*rng.uniform(0, 4, 2).tolist(), float(rng.choice([0.25, 0.5, 0.8])))
        size = tuple(rng.uniform(0.1, 1.5, 3).tolist())
        begins, ends = times[2 * index], times[2 * index + 1]
        gone = ends + 0.5 if rng.random() < 0.5 else None
        empty_before = begins - 0.5 if rng.random() < 0.5 else None
        state_label = label if rng.random() < 0.7 else str(rng.choice(LABELS))
        state = m.state(
            number, index, (begins, ends), center, size, gone=gone, empty_before=empty_before, label=state_label
        )
        states.append(state)
    presence = "absent" if states[-1].gone_ns is not None else str(rng.choice(["present", "present", "doubted"]))
    record = m.instance(number, label, seen=(times[0], times[-1]), presence=presence)  # type: ignore[arg-type]
    belief = {label: 0.8, "stool": float(rng.choice([0.05, 0.12, 0.15]))}
    record = replace(record, box=states[-1].box, centroid_map=states[-1].centroid_map, label_belief=belief)
    seen = [m.visit(number, int(rng.integers(0, 3)), 3) for _ in TRAVERSALS]
    return record, states, [[visit] if visit.supported or rng.random() < 0.5 else [] for visit in seen]


def make_edges(rng: np.random.Generator, count: int) -> list[SpatialEdge]:
    """Relations between random pairs, some ended, some stored twice."""
    edges = []
    for _ in range(int(rng.integers(0, 2 * count))):
        subject, obj = rng.choice(np.arange(1, count + 1), 2, replace=False).tolist()
        since = float(rng.integers(0, 100))
        until = since + float(rng.integers(1, 60)) if rng.random() < 0.5 else None
        relation = str(rng.choice(["near", "on", "beside", "under", "inside", "above"]))
        edges.append(m.spatial(subject, relation, obj, since, until))
    return edges


def make_random_memory(path: Path, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 14))
    histories = [make_history(rng, number) for number in range(1, count + 1)]
    records = [record for record, _, _ in histories]
    for number in range(3, count + 1):
        if rng.random() < 0.15:
            records[number - 1] = replace(records[number - 1], merged_into=int(rng.integers(1, number)))
    first = MapDelta(
        keyframes=m.keyframes(list(range(50))),
        observations=tuple(m.observation(record.number, 10 + record.number) for record in records),
        instances=tuple(records),
        states=tuple(state for _, states, _ in histories for state in states),
        visits=tuple(visit for _, _, visits in histories for visit in visits[0]),
        spatial_edges=tuple(make_edges(rng, count)),
    )
    second = MapDelta(
        keyframes=m.keyframes(list(range(80, 130))),
        visits=tuple(visit for _, _, visits in histories for visit in visits[1]),
    )
    deltas = (first, second)
    return m.make_memory(path, *((name, span, delta) for (name, span), delta in zip(TRAVERSALS, deltas, strict=True)))
