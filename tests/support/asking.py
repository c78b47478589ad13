"""Questions to a map in a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from supermap_cli.memory import open_store
from supermap_cli.query.answers import Answer, answer
from supermap_cli.types.memory import InstanceRecord, VoxelCloud

Ask = Callable[..., Answer]


def asker(path: Path) -> Ask:
    """Answers questions to a map, each with a reader of its own."""

    def ask(text: str, **options: object) -> Answer:
        with open_store(str(path), read_only=True) as store, store.reader() as reader:
            return answer(text, reader, **options)  # type: ignore[arg-type]

    return ask


def ids(found: Answer) -> list[str]:
    return [instance.id for instance in found.instances]


def painted(record: InstanceRecord, *colours: tuple[tuple[int, int, int], int]) -> InstanceRecord:
    """An instance whose voxels have these colours (sRGB), each so many of them."""
    rgb = np.array([colour for colour, count in colours for _ in range(count)], np.uint8)
    n = len(rgb)
    keys = np.arange(3 * n, dtype=np.int32).reshape(n, 3)
    ones = np.ones(n, np.float32)
    return replace(record, voxels=VoxelCloud(0.02, keys, ones * 2, ones, ones * 0, rgb))
