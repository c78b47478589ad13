"""Two days on which things come, go and are moved, seen by a bad detector: whatever happens, the memory is sound."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.errors import RecordingError
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame
from support import fakes as f
from support import scenes as s

DAY_S = 86_400.0
COARSE = PinholeCamera(96, 72, 70.0, 70.0, 47.5, 35.5)
KINDS = (s.CHAIR, s.BOX, s.PERSON, s.Thing("cup", (0, 0, 0.15), (0.3, 0.3, 0.3), (220, 60, 50)))
LABELS = ("chair", "couch", "box", "cup", "vase", "person")


def anywhere(rng: np.random.Generator, thing: s.Thing) -> s.Thing:
    return thing.at(float(rng.uniform(0.9, 2.6)), float(rng.uniform(-1.2, 1.2)))


def something(rng: np.random.Generator) -> s.Thing:
    return anywhere(rng, KINDS[rng.integers(len(KINDS))])


def changed(rng: np.random.Generator, things: list[s.Thing]) -> list[s.Thing]:
    """One thing taken away, brought or moved, or nothing."""
    what = rng.integers(4)
    if what == 0 or not things:
        return [*things, something(rng)]
    i = int(rng.integers(len(things)))
    moved = [anywhere(rng, things[i])] if what == 1 else [things[i]] if what == 2 else []
    return [*things[:i], *moved, *things[i + 1 :]]


def a_day(rng: np.random.Generator, things: list[s.Thing], start_s: float) -> tuple[list[s.Scene], list[s.Thing]]:
    """Images from all over, a change every few of them; and what stands there in the end."""
    scenes: list[s.Scene] = []
    for _ in range(6):
        for _ in range(rng.integers(3, 7)):
            eye, target = rng.uniform((-0.6, -1.0, 1.0), (0.4, 1.0, 1.6)), (1.7, rng.uniform(-0.6, 0.6), 0.4)
            at_s = start_s + len(scenes) / 3
            scenes.append(s.render((*s.ROOM, *things), s.looking(eye, target), at_s, COARSE))
        things = changed(rng, things)
    return scenes, things


class BadDetector(f.FakeDetector):
    """Misses, shifts and halves masks, mixes labels up, and sees things that are not there."""

    def detect(self, frame: CameraFrame) -> Detections | None:
        rng = np.random.default_rng(frame.stamp_ns % 2**32)
        scene = next(scene for scene in self.recording.scenes if scene.keyframe.stamp_ns == frame.stamp_ns)
        if rng.random() < 0.1:
            return None
        found = [
            (self._misjudged(rng, scene.mask(i)), self._named(rng, thing.label))
            for i, thing in enumerate(scene.things)
            if thing.label and (scene.owner == i).sum() >= s.LEAST_PIXELS and rng.random() > 0.25
        ]
        if rng.random() < 0.15:
            blob = np.zeros(scene.owner.shape, bool)
            v, u = rng.integers(0, (50, 70))
            blob[v : v + 20, u : u + 25] = True
            found.append((blob, self._named(rng, str(rng.choice(LABELS)))))
        found = [(mask, said) for mask, said in found if mask.any()]
        at_s = (frame.stamp_ns - s.EPOCH_NS) / 1e9
        return s.detections_of([mask for mask, _ in found], [said for _, said in found], at_s)

    @staticmethod
    def _misjudged(rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
        shifted: np.ndarray = np.roll(mask, int(rng.integers(-6, 7)), axis=1) if rng.random() < 0.2 else mask
        if rng.random() < 0.1:
            shifted = shifted & (np.arange(mask.shape[1]) < mask.shape[1] // 2)
        return shifted

    @staticmethod
    def _named(rng: np.random.Generator, label: str) -> list[tuple[str, float]]:
        score, other = (
            float(rng.uniform(0.1, 0.95)),
            str(rng.choice([candidate for candidate in LABELS if candidate != label])),
        )
        said = [(label, score), (other, 0.6 * score)]
        return [(other, score), (label, 0.6 * score)] if rng.random() < 0.15 else said


@pytest.mark.parametrize("seed", [1, 10, 16])
def test_whatever_happens_the_memory_is_sound(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    things = [something(rng) for _ in range(3)]
    path, plugins = tmp_path / "map.db", f.FakePlugins(detector=BadDetector).load()
    with open_store(str(path), create=True) as store:
        for day in range(2):
            scenes, things = a_day(rng, things, day * DAY_S)
            recording = f.FakeRecording(scenes, Path(f"day-{day}.fake"))
            with suppress(RecordingError):  # a day on which nothing could be made out leaves the memory as it was
                TraversalBuild(recording, plugins, f.config(keyframes={"batch": 3}), store).run(align="none")
            things = changed(rng, things)
        with store.reader() as reader:
            assert check(reader) == []
    with closing(sqlite3.connect(path)) as connection:
        kinds = {kind for (kind,) in connection.execute("SELECT DISTINCT kind FROM temporal_edge")}
    assert "disappeared" in kinds
