"""Observers never slow the mapping, and lose no change of the map."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, cast

import numpy as np
import pytest

from supermap_cli import observing
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.observing import MAX_IMAGES, MAX_IN_MEMORY, Observers
from supermap_cli.protocols import Observer
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, Tracks
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, MapDelta, StateRecord, TemporalEdge, VoxelCloud
from supermap_cli.types.sensing import CameraFrame, Sweep
from supermap_cli.types.session import SessionContext, SessionSummary
from support import fakes as f
from support import scenes as s


def numbered(number: int) -> MapDelta:
    return MapDelta(temporal_edges=(TemporalEdge("appeared", number, None, number, 0, None, number, 1.0),))


class SlowLog(f.ObserverLog):
    """Waits at the first thing it is told, until it may go on."""

    def __init__(self) -> None:
        super().__init__()
        self.may_go_on = threading.Event()

    def frame(self, *arguments: object) -> None:
        self.may_go_on.wait(30)
        self.frames += 1


def test_a_slow_observer_misses_frames_but_no_change_and_keeps_their_order() -> None:
    log = SlowLog()
    observers = Observers([("slow", log)])
    changes = 3 * MAX_IN_MEMORY
    began = time.monotonic()
    for number in range(changes):
        observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
        observers.mapped(None, numbered(number))
    observers.ended(SessionSummary(complete=True, keyframes=1, observations=2, objects=3))
    assert time.monotonic() - began < 20
    log.may_go_on.set()
    (warning,) = observers.close()
    assert [delta for _, delta in log.mapped_keyframes] == [numbered(number) for number in range(changes)]
    assert [summary.objects for summary in log.summaries] == [3]
    assert log.frames <= MAX_IMAGES + 1
    assert "missed" in warning
    assert str(changes - log.frames) in warning


def test_one_that_fails_is_told_no_more_and_the_others_go_on() -> None:
    failing, sound = f.ObserverLog(failing=True), f.ObserverLog()
    observers = Observers([("failing", failing), ("sound", sound)])
    for number in range(5):
        observers.mapped(None, numbered(number))
    warnings = observers.close()
    assert warnings == [
        "plugin failing was left out: ZeroDivisionError: ",
        "plugin failing was not told the last 4 events",
    ]
    assert len(sound.mapped_keyframes) == 5


def test_one_that_hangs_is_left_behind_at_the_end() -> None:
    log = SlowLog()
    observers = Observers([("hanging", log)])
    observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
    observers.mapped(None, numbered(0))
    (warning,) = observers.close(timeout_s=0.1)
    assert "had not got to the last 1 events" in warning
    log.may_go_on.set()


def test_nobody_is_told_while_muted() -> None:
    log = f.ObserverLog()
    observers = Observers([("log", log)])
    observers.muted = True
    observers.mapped(None, numbered(0))
    observers.muted = False
    observers.mapped(None, numbered(1))
    observers.close()
    assert [delta for _, delta in log.mapped_keyframes] == [numbered(1)]


def a_delta() -> MapDelta:
    box = Box3D(np.zeros(3), np.ones(3), 0.0)
    column = np.zeros(2, np.float32)
    voxels = VoxelCloud(
        0.05, np.zeros((2, 3), np.int32), column, column.copy(), column.copy(), np.zeros((2, 3), np.uint8)
    )
    state = StateRecord(1, 0, 0, 1, None, None, np.zeros(3), box, "cup", 1.0)
    instance = InstanceRecord(1, "cup", {"cup": 1.0}, 1.0, "present", 0, 1, np.zeros(3), box, voxels, 1)
    return MapDelta(instances=(instance,), states=(state,))


def arrays_of(value: object) -> list[np.ndarray]:
    """All arrays within a value."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, list | tuple):
        return [array for item in value for array in arrays_of(item)]
    if is_dataclass(value):
        return [array for own in fields(value) for array in arrays_of(getattr(value, own.name))]
    return []


class Keeper:
    """Keeps all that it is told, as it is told it."""

    def __init__(self) -> None:
        self.told: dict[str, tuple[object, ...]] = {}

    def __getattr__(self, event: str) -> Callable[..., None]:
        return lambda *arguments: self.told.update({event: arguments})


def test_no_array_that_an_observer_is_told_can_be_written_to_and_the_map_s_own_can() -> None:
    scene = s.render(s.ROOM, s.looking((0, 0, 1.5), (2, 0, 0.5)), 0)
    keyframe = scene.keyframe
    frame = CameraFrame(0, "camera", keyframe.rgb, keyframe.depth_m, keyframe.camera, np.eye(4))
    sweep = Sweep(0, "lidar", np.zeros((2, 3)), np.zeros(2, np.int64), np.eye(4))
    mask = RegionMask(0, 0, np.ones((2, 2), bool))
    boxes, scores = np.zeros((1, 4), np.float32), np.ones(1, np.float32)
    detections = Detections(0, boxes, scores, ((Hypothesis("cup", 1.0),),), (mask,))
    delta = a_delta()
    own: dict[str, tuple[Any, ...]] = {
        "started": (SessionContext("", "", "", (), {}, np.eye(4)),),
        "frame": (frame, np.eye(4), sweep),
        "perceived": (keyframe, detections, [mask], Tracks(np.zeros(1, np.int64))),
        "mapped": (KeyframeRecord(0, np.eye(4), np.eye(4), "", b"", 1, None, detected=True), delta),
        "committed": (delta,),
    }
    keeper = Keeper()
    observers = Observers([("keeper", cast("Observer", keeper))])
    for event, arguments in own.items():
        getattr(observers, event)(*arguments)
    assert observers.close() == []
    for event, arguments in own.items():
        shown = arrays_of(keeper.told[event])
        assert len(shown) == len(arrays_of(arguments)) > 0
        for array in shown:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        for array in arrays_of(arguments):
            array[...] = array.copy()
    (seen,) = keeper.told["committed"]
    assert isinstance(seen, MapDelta)
    cast("dict[str, float]", seen.instances[0].label_belief).clear()
    assert delta.instances[0].label_belief == {"cup": 1.0}


def test_what_waited_in_the_file_cannot_be_written_to_either() -> None:
    class Last(SlowLog):
        def committed(self, batch: MapDelta) -> None:
            batch.states[0].centroid_map[0] = 1.0

    log = Last()
    observers = Observers([("last", log)])
    observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
    for number in range(MAX_IN_MEMORY + 1):
        observers.mapped(None, numbered(number))
    observers.committed(a_delta())
    log.may_go_on.set()
    (warning,) = observers.close()
    assert "read-only" in warning


def test_a_file_that_cannot_be_read_is_told_with_what_was_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    spool = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed by the observer's thread
    monkeypatch.setattr(observing.tempfile, "TemporaryFile", lambda **_: spool)
    log = SlowLog()
    observers = Observers([("unlucky", log)])
    observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
    while observers._threads[0]._waiting:
        time.sleep(0.01)
    for number in range(MAX_IN_MEMORY + 5):
        observers.mapped(None, numbered(number))
    os.pwrite(spool.fileno(), b"scratched", 0)
    log.may_go_on.set()
    observers._threads[0]._thread.join(30)
    observers.mapped(None, numbered(0))
    left_out, untold = observers.close()
    assert "plugin unlucky was left out: PackingError" in left_out
    assert untold == "plugin unlucky was not told the last 6 events"
    assert len(log.mapped_keyframes) == MAX_IN_MEMORY
    assert spool.closed


def test_one_without_room_for_what_waits_is_told_what_was_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(observing.os, "pwrite", full)
    log = SlowLog()
    observers = Observers([("late", log)])
    observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
    while observers._threads[0]._waiting:
        time.sleep(0.01)
    for number in range(MAX_IN_MEMORY + 2):
        observers.mapped(None, numbered(number))
    log.may_go_on.set()
    left_out, untold = observers.close()
    assert "No space left" in left_out
    assert "last 2 events" in untold
    assert [delta for _, delta in log.mapped_keyframes] == [numbered(number) for number in range(MAX_IN_MEMORY)]


def test_each_change_comes_once_and_in_order_while_the_file_fills_and_empties() -> None:
    class Uneven(f.ObserverLog):
        def mapped(self, *arguments: Any) -> None:
            super().mapped(*arguments)
            if len(self.mapped_keyframes) % 97 == 0:
                time.sleep(0.02)

    log = Uneven()
    observers = Observers([("uneven", log)])
    changes = 20 * MAX_IN_MEMORY
    for number in range(changes):
        observers.mapped(None, numbered(number))
        if number % 150 == 0:
            time.sleep(0.03)
    assert observers.close() == []
    assert [delta.temporal_edges[0].from_number for _, delta in log.mapped_keyframes] == list(range(changes))


def test_telling_does_not_wait_for_an_observer_s_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, may_read = threading.Event(), threading.Event()
    unpack = observing.unpack

    def slow_unpack(*arguments: Any) -> Any:
        reading.set()
        may_read.wait(30)
        return unpack(*arguments)

    monkeypatch.setattr(observing, "unpack", slow_unpack)
    log = SlowLog()
    observers = Observers([("reading", log)])
    observers.frame(None, np.eye(4), None)  # type: ignore[arg-type]  # it does not look at it
    for number in range(MAX_IN_MEMORY + 5):
        observers.mapped(None, numbered(number))
    log.may_go_on.set()
    assert reading.wait(30)
    began = time.monotonic()
    observers.mapped(None, numbered(MAX_IN_MEMORY + 5))
    assert time.monotonic() - began < 5
    assert not may_read.is_set()
    may_read.set()
    assert observers.close() == []
    assert [delta for _, delta in log.mapped_keyframes] == [numbered(number) for number in range(MAX_IN_MEMORY + 6)]


def test_one_that_exits_is_left_out_with_a_warning() -> None:
    class Leaver(f.ObserverLog):
        def mapped(self, *arguments: object) -> None:
            raise SystemExit(3)

    observers = Observers([("leaver", Leaver())])
    observers.mapped(None, numbered(0))
    assert observers.close() == ["plugin leaver was left out: SystemExit: 3"]
