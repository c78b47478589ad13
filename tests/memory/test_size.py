"""The database gives back what only a build needed."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.memory import open_store
from supermap_cli.types.memory import MapDelta, VoxelCloud
from support import memories as m


def large_cloud(seed: int) -> VoxelCloud:
    rng = np.random.default_rng(seed)
    n = 3000
    reals = [rng.random(n).astype(np.float32) for _ in range(3)]
    keys = rng.integers(-999, 999, (n, 3)).astype(np.int32)
    return VoxelCloud(0.02, keys, *reals, rng.integers(0, 255, (n, 3)).astype(np.uint8))


def things(seed: int, label: str) -> MapDelta:
    instances = (replace(m.instance(number, label), voxels=large_cloud(seed + number)) for number in range(1, 20))
    return MapDelta(instances=tuple(instances))


def pages(path: Path) -> tuple[int, int]:
    with closing(sqlite3.connect(path)) as connection:
        return (
            connection.execute("PRAGMA freelist_count").fetchone()[0],
            connection.execute("PRAGMA page_count").fetchone()[0],
        )


@pytest.mark.sqlite_only("about the pages of an SQLite file")
def test_before_images_leave_no_holes_behind(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), things(0, "chair")))
    _, before = pages(path)
    with open_store(str(path)) as store:
        traversal_id = store.begin_traversal(m.start("tuesday", (20, 30)))
        store.commit(traversal_id, things(100, "armchair"))
        store.finish_traversal(traversal_id)
    free, after = pages(path)
    assert free == 0
    assert after < 1.1 * before
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert {instance.label for instance in reader.instances} == {"armchair"}


@pytest.mark.sqlite_only("about the pages of an SQLite file")
def test_a_traversal_that_is_discarded_leaves_no_holes_behind(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), things(0, "chair")))
    _, before = pages(path)
    with open_store(str(path)) as store:
        traversal_id = store.begin_traversal(m.start("tuesday", (20, 30)))
        store.commit(traversal_id, things(100, "armchair"))
        store.discard_traversal(traversal_id)
    free, after = pages(path)
    assert free == 0
    assert after < 1.1 * before
