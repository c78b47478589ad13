"""Observers follow a mapping session in threads of their own: they never slow it, and lose no change of the map."""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import IO, Any, Literal

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.protocols import Observer
from supermap_cli.types import memory
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, Tracks
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta
from supermap_cli.types.packing import pack, unpack
from supermap_cli.types.sensing import CameraFrame, Sweep
from supermap_cli.types.session import SessionContext, SessionSummary

Event = Literal["started", "frame", "perceived", "mapped", "committed", "ended"]

MAX_IMAGES = 8
"""Frames and perceptions that wait for an observer (2 MB each at 640 x 480); further ones are dropped."""

MAX_IN_MEMORY = 64
"""Events that wait in memory (up to 2 MB each where large objects change); further changes wait in a file."""

CLOSE_TIMEOUT_S = 60.0
"""s; how long an observer may take after the end for what it has not been told yet."""

SPOOLED: Mapping[type, tuple[str, ...]] = {
    KeyframeRecord: (),
    memory.Observation: (),
    memory.VoxelCloud: (),
    memory.StateRecord: (),
    memory.Visit: (),
    memory.InstanceRecord: (),
    memory.SpatialEdge: (),
    memory.TemporalEdge: (),
    MapDelta: (),
    Box3D: (),
    Hypothesis: (),
    SessionContext: (),
    SessionSummary: (),
}
"""What events that wait in a file consist of."""


class _Spool:
    """Events in a temporary file, first in, first out: one thread adds, one takes, without waiting for each other."""

    def __init__(self) -> None:
        self._file: IO[bytes] | None = None
        self._places: deque[tuple[int, int]] = deque()
        """Offset and length of each event, in bytes."""
        self._end = 0

    def __len__(self) -> int:
        return len(self._places)

    def add(self, event: Event, arguments: tuple[Any, ...]) -> tuple[int, int]:
        """Write an event to the file. It stands in the queue once its place, which is returned, is `queued`."""
        self._file = self._file or tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed with the spool
        if not self._places:  # all was taken
            self._file.truncate(0)
            self._end = 0
        content = memoryview(pack((event, arguments), SPOOLED, compressed=False))
        offset, length = self._end, len(content)
        while content:
            written = os.pwrite(self._file.fileno(), content, offset + length - len(content))
            content = content[written:]
        self._end = offset + length
        return offset, length

    def queued(self, place: tuple[int, int]) -> None:
        self._places.append(place)

    def first(self) -> tuple[Event, tuple[Any, ...]]:
        """The oldest event, which stays until it is `taken`."""
        if self._file is None:
            raise ValueError("the spool is empty")
        offset, length = self._places[0]
        event, arguments = unpack(os.pread(self._file.fileno(), length, offset), SPOOLED)
        return event, arguments

    def taken(self) -> None:
        self._places.popleft()

    def clear(self) -> None:
        self._places.clear()

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


class ObserverThread:
    """One observer, told in a thread of its own. `dropped` counts frames and perceptions that it missed, `untold` what
    it was not told after a failure.
    """

    def __init__(self, name: str, observer: Observer) -> None:
        self.name = name
        self.dropped = 0
        self.untold = 0
        self.failure: str | None = None
        self._observer = observer
        self._waiting: deque[tuple[Event, tuple[Any, ...]]] = deque()
        self._images = 0
        self._spool = _Spool()
        self._closed = False
        self._telling = threading.Lock()
        """Held by who tells, also while the spool is written; the observer's thread does not wait for it."""
        self._changed = threading.Condition()
        """Guards the queues, and is held for moments only: never while a file is used, or the observer is at work."""
        self._thread = threading.Thread(target=self._run, name=f"observer {name}", daemon=True)
        self._thread.start()

    def tell(self, event: Event, *arguments: Any) -> None:
        """Have the observer told, when it gets to it."""
        with self._telling:
            if self._queued_in_memory(event, arguments):
                return
            try:
                place = self._spool.add(event, arguments)
            except (OSError, TypeError, ValueError) as error:  # no room for it, or nothing that can be kept
                with self._changed:
                    self._fail(error)
                    self.untold += 1
                return
            with self._changed:
                if self.failure is None:
                    self._spool.queued(place)
                    self._changed.notify_all()
                else:
                    self.untold += 1

    def _queued_in_memory(self, event: Event, arguments: tuple[Any, ...]) -> bool:
        """Whether an event needs no place in the spool: it waits in memory, or the observer misses it."""
        image = event in {"frame", "perceived"}
        with self._changed:
            if self.failure is not None or self._closed:
                self.untold += self.failure is not None
                return True
            behind = len(self._spool) > 0 or len(self._waiting) >= MAX_IN_MEMORY
            if image and (behind or self._images >= MAX_IMAGES):
                self.dropped += 1
                return True
            if behind:
                return False
            self._images += image
            self._waiting.append((event, arguments))
            self._changed.notify_all()
            return True

    def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> list[str]:
        """Let the observer get to the end of what it has to be told. Returns what it missed, one line each."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout_s)
        told = []
        with self._changed:
            if self.failure is not None:
                told.append(f"plugin {self.name} was left out: {self.failure}")
            if self.dropped:
                missed = f"{self.dropped} frames and perceptions"
                told.append(f"plugin {self.name} was too slow for {missed}, and missed them")
            left = self._forgotten() + self.untold
            if self._thread.is_alive():
                told.append(f"plugin {self.name} had not got to the last {left} events after {timeout_s:g} s")
            elif left:
                told.append(f"plugin {self.name} was not told the last {left} events")
        return told

    def _run(self) -> None:
        try:
            while (next_event := self._next()) is not None:
                event, arguments = next_event
                getattr(self._observer, event)(*_read_only(arguments))
        except BaseException as error:  # an observer's fault must not cost the map, nor `sys.exit` go unnoticed
            with self._changed:
                self._fail(error)
                self.untold += self._forgotten()
        with self._telling:  # nobody writes to it any more
            self._spool.close()

    def _next(self) -> tuple[Event, tuple[Any, ...]] | None:
        """The next event; waits for it. `None` at the end."""
        with self._changed:
            while not self._waiting and not self._spool:
                if self._closed:
                    return None
                self._changed.wait()
            if self._waiting:
                event, arguments = self._waiting.popleft()
                self._images -= event in {"frame", "perceived"}
                return event, arguments
        spooled = self._spool.first()
        with self._changed:
            if not self._spool:  # `close` waits no longer
                return None
            self._spool.taken()
        return spooled

    def _fail(self, error: BaseException) -> None:
        self.failure = self.failure or f"{type(error).__name__}: {error}"

    def _forgotten(self) -> int:
        """Empty both queues; how many events that were."""
        left = len(self._waiting) + len(self._spool)
        self._waiting.clear()
        self._spool.clear()
        return left


class Observers:
    """All observers of a session, called like one. While `muted` nobody is told: a build that goes on maps anew what it
    had committed before.
    """

    def __init__(self, observers: Iterable[tuple[str, Observer]] = ()) -> None:
        self.muted = False
        self._threads = [ObserverThread(name, observer) for name, observer in observers]
        self._closed = False

    def __len__(self) -> int:
        return len(self._threads)

    def started(self, context: SessionContext) -> None:
        """A traversal begins."""
        self._tell("started", context)

    def frame(self, frame: CameraFrame, T_map_base: FloatArray, sweep: Sweep | None) -> None:
        """A frame has its place in the map."""
        self._tell("frame", frame, T_map_base, sweep)

    def perceived(
        self, keyframe: Keyframe, detections: Detections, masks: Sequence[RegionMask | None], tracks: Tracks
    ) -> None:
        """What was found in a keyframe."""
        self._tell("perceived", keyframe, detections, masks, tracks)

    def mapped(self, keyframe: KeyframeRecord | None, delta: MapDelta) -> None:
        """What a keyframe, or the end of the traversal, changed."""
        self._tell("mapped", keyframe, delta)

    def committed(self, batch: MapDelta) -> None:
        """A batch stands in the database."""
        self._tell("committed", batch)

    def ended(self, summary: SessionSummary) -> None:
        """The traversal is complete, or stopped."""
        self._tell("ended", summary)

    def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> list[str]:
        """Let all get to the end of what they have to be told. Returns what went wrong, one line each."""
        if self._closed:
            return []
        self._closed = True
        until_s = time.monotonic() + timeout_s
        told = [thread.close(max(0.0, until_s - time.monotonic())) for thread in self._threads]
        return [line for lines in told for line in lines]

    def _tell(self, event: Event, *arguments: Any) -> None:
        if not self.muted:
            for thread in self._threads:
                thread.tell(event, *arguments)


def _read_only(value: Any) -> Any:
    """A value that an observer may look at and not write to, because the map is made of it: arrays within tuples,
    lists, dicts and dataclasses are views without write access, lists and dicts the observer's own. What holds none of
    them is the value itself.
    """
    protected = value
    if isinstance(value, np.ndarray):
        protected = value.view()
        protected.setflags(write=False)
    elif type(value) is tuple:
        items = tuple(_read_only(item) for item in value)
        protected = items if any(new is not old for new, old in zip(items, value, strict=True)) else value
    elif isinstance(value, list):
        protected = [_read_only(item) for item in value]
    elif isinstance(value, Mapping):
        protected = {key: _read_only(item) for key, item in value.items()}
    elif is_dataclass(value) and not isinstance(value, type):
        protected = _read_only_instance(value)
    return protected


def _read_only_instance(value: Any) -> Any:
    """A dataclass's instance with its fields protected; it was checked when it was made, and is not checked again."""
    old = {own.name: getattr(value, own.name) for own in fields(value)}
    new = {name: _read_only(item) for name, item in old.items()}
    if all(new[name] is old[name] for name in old):
        return value
    instance = object.__new__(type(value))
    for name, item in new.items():
        object.__setattr__(instance, name, item)
    return instance
