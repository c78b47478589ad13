"""Observers never slow the mapping, and lose no change of the map."""

from __future__ import annotations

import threading
import time

import numpy as np

from supermap_cli.observing import MAX_IMAGES, MAX_IN_MEMORY, Observers
from supermap_cli.types.memory import MapDelta, TemporalEdge
from supermap_cli.types.sensing import CameraFrame
from supermap_cli.types.session import SessionSummary
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
    assert warnings == ["plugin failing was left out: ZeroDivisionError: "]
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


def test_an_observer_cannot_change_what_the_map_is_made_of() -> None:
    class Painter(f.ObserverLog):
        def frame(self, frame: CameraFrame, T_map_base: np.ndarray, sweep: object) -> None:
            frame.rgb[:] = 0

    scene = s.render(s.ROOM, s.looking((0, 0, 1.5), (2, 0, 0.5)), 0)
    keyframe = scene.keyframe
    frame = CameraFrame(0, "camera", keyframe.rgb, keyframe.depth_m, keyframe.camera, np.eye(4))
    before = frame.rgb.copy()
    observers = Observers([("painter", Painter())])
    observers.frame(frame, np.eye(4), None)
    (warning,) = observers.close()
    assert "read-only" in warning
    np.testing.assert_array_equal(frame.rgb, before)


def test_one_that_exits_is_left_out_with_a_warning() -> None:
    class Leaver(f.ObserverLog):
        def mapped(self, *arguments: object) -> None:
            raise SystemExit(3)

    observers = Observers([("leaver", Leaver())])
    observers.mapped(None, numbered(0))
    assert observers.close() == ["plugin leaver was left out: SystemExit: 3"]
