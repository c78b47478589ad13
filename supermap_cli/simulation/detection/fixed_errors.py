"""What a network gets wrong for good in one world: which classes it finds badly, and what it takes each thing for."""

from __future__ import annotations

from zlib import crc32

import numpy as np

from supermap_cli.simulation.world import World


def world_seed(world: World) -> int:
    """A number that follows from the world alone: what is drawn with it is the same for all cameras and visits."""
    names = " ".join(f"{thing.id} {thing.label}" for thing in world.things)
    seed = crc32(names.encode())
    for fixture in world.fixtures:
        vertices_mm = np.rint(fixture.shape.vertices * 1000).astype("<i8")
        seed = crc32(vertices_mm.tobytes(), seed)
    return seed


def named_generator(seed: int, name: str) -> np.random.Generator:
    """A generator of its own for each name."""
    return np.random.default_rng((seed, crc32(name.encode())))


def class_recall(seed: int, label: str, best: float, spread: float) -> float:
    """The recall of a class, evenly at random between `best - spread` and `best`."""
    return float(max(best - spread * named_generator(seed, f"recall of {label}").random(), 0.0))
