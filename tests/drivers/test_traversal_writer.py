"""A traversal that is pushed: stored, followed by observers, and taken out where it is not finished."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.drivers.source import push_source
from supermap_cli.drivers.traversal_writer import TraversalWriter
from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.values import TraversalStart
from supermap_cli.observing import Observers
from supermap_cli.plugin_manager import Plugins
from supermap_cli.stages.session_state import SessionBackends
from support import fakes as f
from support import scenes as s
from support.fake_builds import KITCHEN

BACKENDS = SessionBackends(f.FakeTracker)


def a_robot() -> f.FakeRecording:
    """Poses, frames and their detections of a kitchen, with something to warn of."""
    film = f.film(KITCHEN)
    found = [s.detect(scene, (scene.keyframe.stamp_ns - s.EPOCH_NS) / 1e9) for scene in film]
    streams = frozenset({"color", "depth", "poses", "detections"})
    return f.FakeRecording(film, recorded=found, streams=streams, warnings=("a clock jumped",))


def test_observers_of_what_is_pushed_are_told_from_its_beginning_to_its_end(store: MapStore) -> None:
    log, robot = f.ObserverLog(), a_robot()
    with TraversalWriter(store, "rounds", f.config(keyframes={"batch": 5})) as writer:
        session = writer.open_session(BACKENDS, plugins=f.FakePlugins(observer=log).load(), source=robot)
        writer.write(push_source(session, robot))
        writer.finish()
        assert [summary.complete for summary in log.summaries] == [True]
    assert all("missed them" in warning for warning in writer.warnings), "a slow machine may lose frames, no changes"
    assert [(context.traversal, context.database, context.cameras) for context in log.contexts] == [
        ("rounds", store.where, robot.cameras)
    ]
    keyframes = session.statistics.keyframes
    assert keyframes > 3
    assert [len(delta.keyframes) for _, delta in log.mapped_keyframes] == [1] * keyframes + [0]
    assert [stamp_ns for stamp_ns, _ in log.mapped_keyframes] == [
        *(record.stamp_ns for record in store.keyframe_depths()),
        None,
    ]
    assert sum(len(batch.keyframes) for batch in log.batches) == keyframes
    (summary,) = log.summaries
    assert (summary.keyframes, summary.objects, "a clock jumped" in summary.warnings) == (keyframes, 2, True)
    (traversal,) = store.traversals()
    assert traversal.warnings == ("a clock jumped", *session.warnings)


def test_observers_are_told_of_an_end_before_the_end(store: MapStore) -> None:
    log, robot = f.ObserverLog(), a_robot()

    def fail_half_way() -> None:
        with TraversalWriter(store, "rounds", f.config(keyframes={"batch": 1})) as writer:
            session = writer.open_session(BACKENDS, observers=Observers([("log", log)]), source=robot)
            for number, delta in enumerate(push_source(session, robot)):
                writer.write([delta])
                if number == 2:
                    raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert len(log.contexts) == 1
    assert len(log.mapped_keyframes) >= len(log.batches) == 3
    assert [summary.complete for summary in log.summaries] == [False]
    assert store.traversals() == ()


def test_observers_that_fail_are_told_of_and_cost_nothing(store: MapStore) -> None:
    robot = a_robot()
    with TraversalWriter(store, "rounds") as writer:
        failing = f.FakePlugins(observer=f.ObserverLog(failing=True)).load()
        session = writer.open_session(BACKENDS, plugins=failing, source=robot)
        writer.write(push_source(session, robot))
        writer.finish()
    assert "was left out: ZeroDivisionError" in writer.warnings[0]
    assert [traversal.status for traversal in store.traversals()] == ["complete"]


def test_the_installed_plugins_are_asked_for_observers(store: MapStore, monkeypatch: pytest.MonkeyPatch) -> None:
    log = f.ObserverLog()

    def installed() -> Plugins:
        return plugins

    plugins = f.FakePlugins(observer=log).load()
    monkeypatch.setattr("supermap_cli.drivers.traversal_writer.load_plugins", installed)
    with TraversalWriter(store, "rounds") as writer:
        writer.open_session(BACKENDS)
    assert [context.traversal for context in log.contexts] == ["rounds"]
    assert [summary.complete for summary in log.summaries] == [False]


def test_a_stopped_build_is_in_the_way_before_anything_is_pushed(tmp_path: Path) -> None:
    path, log = str(tmp_path / "map.db"), f.ObserverLog()
    with open_store(path, create=True) as store:
        store.begin_traversal(TraversalStart("monday.mcap", "1", s.ns(0), s.ns(1), np.eye(4)))
    with (
        open_store(path) as store,
        TraversalWriter(store, "rounds") as writer,
        pytest.raises(MemoryStoreError, match="'monday' has not come"),
    ):
        writer.open_session(BACKENDS, observers=Observers([("log", log)]))
    assert log.contexts == log.summaries == []
    with open_store(path) as store:
        assert [traversal.status for traversal in store.traversals()] == ["building"]
