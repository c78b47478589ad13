"""The correction of drift makes no odometry worse, good or bad: trajectories through a furnished room, against truth.

Depth is noisy and half a percent too long, so that registration errs. Errors are those of whole trajectories, after
the best level fit to the truth: what comes first is no better known than what comes last.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from supermap_cli.evaluation.truth_alignment import fit_level_transform
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.se3 import make_transform, transform_points
from supermap_cli.mapping.drift import DriftCorrection
from supermap_cli.mapping.structure import CoarseDepth
from support import scenes as s

KEYFRAMES = 60
SEEDS = (1, 2, 3, 4)
LEVER_POINTS_M = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
ROOM = (
    s.Thing("", (0, 0, -0.05), (7, 6, 0.1)),
    *(s.Thing("", (x, 0, 1.3), (0.1, 6, 2.8)) for x in (-3.4, 3.4)),
    *(s.Thing("", (0, y, 1.3), (7, 0.1, 2.8)) for y in (-2.9, 2.9)),
    s.Thing("", (2.3, 1.0, 0.4), (0.8, 1.2, 0.8)),
    s.Thing("", (-2.6, -1.2, 0.9), (0.5, 1.0, 1.8)),
    s.Thing("", (0.6, -2.4, 0.4), (1.4, 0.6, 0.8)),
    s.Thing("", (-1.2, 2.3, 0.3), (0.6, 0.6, 0.6)),
)


@dataclass(frozen=True)
class Level:
    """Standard deviations: of walks by root metre and root turn, of the scale, and of each single pose."""

    m: float = 0.0
    deg: float = 0.0
    turn_deg: float = 0.0
    scale: float = 0.0
    jitter_m: float = 0.0
    jitter_deg: float = 0.0


EXACT = Level()
ONE_PERCENT = Level(0.012, 0.5, 0.6, 0.008, 0.001)
LEVELS = {
    "fine": Level(0.003, 0.04, 0.1, 0.001, 0.0005),
    "half": Level(0.006, 0.25, 0.3, 0.004, 0.001),
    "one": ONE_PERCENT,
    "three": Level(0.036, 1.5, 1.8, 0.024, 0.001),
    "jitter": Level(jitter_m=0.01, jitter_deg=0.3),
}


@lru_cache(maxsize=1)
def truth() -> tuple[FloatArray, tuple[CoarseDepth, ...]]:
    """True poses (n, 4, 4) of a round through the room, where the camera is the base, and what it sees."""
    rng = np.random.default_rng(0)
    poses, views = [], []
    for angle in np.linspace(0, 2.4 * np.pi, KEYFRAMES):
        eye = np.array([1.3 * np.cos(angle), 1.1 * np.sin(angle), 1.2])
        ahead = angle + 0.9 + 0.5 * np.sin(3 * angle)
        T = s.looking(eye, eye + np.array([np.cos(ahead), np.sin(ahead), -0.15]))
        depth_m = s.render(ROOM, T).keyframe.depth_m
        noisy = depth_m * 1.005 + rng.normal(0, 0.002, depth_m.shape) * depth_m**2
        views.append(CoarseDepth(noisy.astype(np.float32), 1, s.CAMERA, T))
        poses.append(T)
    return np.stack(poses), tuple(views)


def odometry(true: FloatArray, level: Level, rng: np.random.Generator) -> FloatArray:
    """The poses of an odometry that misjudges each step."""
    at, steps = true[:1], np.linalg.inv(true[:-1]) @ true[1:]
    way_m = np.linalg.norm(steps[:, :3, 3], axis=1)
    turned = np.arccos(np.clip((np.trace(steps[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1)) / (2 * np.pi)
    turn = rng.normal(0, np.radians(np.hypot(level.deg * np.sqrt(way_m), level.turn_deg * np.sqrt(turned))))
    shift = rng.normal(0, 1, (len(steps), 2)) * level.m * np.sqrt(way_m)[:, None]
    stretch = 1 + level.scale * rng.choice([-1, 1])
    walked = [at[0]]
    for k, step in enumerate(steps):
        go = step.copy()
        go[:3, 3] *= stretch
        here = walked[-1] @ go
        walked.append(aside(here, shift[k], turn[k]))
    return np.stack(
        [
            walked[0],
            *(
                aside(T, rng.normal(0, 1, 2) * level.jitter_m, np.radians(rng.normal() * level.jitter_deg))
                for T in walked[1:]
            ),
        ]
    )


def aside(T: FloatArray, shift_m: FloatArray, turn: float) -> FloatArray:
    """A pose shifted level and turned about the vertical on the spot."""
    cos, sin = np.cos(turn), np.sin(turn)
    R = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return make_transform(R @ T[:3, :3], T[:3, 3] + [*shift_m, 0])


def error_m(found: FloatArray, true: FloatArray) -> float:
    """Root mean square distance of the positions after the best fit, as `supermap eval map` has it."""
    source, target = (
        (np.einsum("nij,kj->nki", T[:, :3, :3], LEVER_POINTS_M[:, [2, 0, 1]]) + T[:, None, :3, 3]).reshape(-1, 3)
        for T in (found, true)
    )
    off_m = transform_points(fit_level_transform(source, target), found[:, :3, 3]) - true[:, :3, 3]
    return float(np.sqrt(np.square(off_m).sum(axis=1).mean()))


def raw_and_corrected_m(level: Level, seed: int, correction: DriftCorrection | None = None) -> tuple[float, float]:
    true, views = truth()
    drifted = odometry(true, level, np.random.default_rng(seed))
    correction = correction or DriftCorrection()
    found = [correction.register(replace(view, T_frame_camera=T), T) for view, T in zip(views, drifted, strict=True)]
    return error_m(drifted, true), error_m(np.stack(found), true)


def test_an_exact_odometry_stays_exact_to_a_few_millimetres() -> None:
    _, corrected_m = raw_and_corrected_m(EXACT, 1)
    assert corrected_m < 0.003


@pytest.mark.parametrize("name", LEVELS)
def test_no_odometry_is_made_worse(name: str) -> None:
    pairs = np.array([raw_and_corrected_m(LEVELS[name], seed) for seed in SEEDS])
    raw_m, corrected_m = pairs.T
    assert corrected_m.mean() <= 1.05 * raw_m.mean()
    assert (corrected_m <= 1.5 * raw_m).all()


@pytest.mark.parametrize(("name", "left"), [("one", 0.8), ("three", 0.65)])
def test_a_bad_odometry_is_made_better(name: str, left: float) -> None:
    pairs = np.array([raw_and_corrected_m(LEVELS[name], seed) for seed in SEEDS])
    assert pairs[:, 1].mean() < left * pairs[:, 0].mean()
