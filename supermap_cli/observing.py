"""Observers follow a mapping session in threads of their own: they never slow it, and lose no change of the map."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
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
    SessionSummary: (),
}
"""What events that wait in a file consist of."""


@dataclass
class _Spool:
    """Events in a temporary file, first in, first out."""

    file: IO[bytes] | None = None
    lengths: deque[int] = field(default_factory=deque)
    read_at: int = 0

    def write(self, event: Event, arguments: tuple[Any, ...]) -> None:
        self.file = self.file or tempfile.TemporaryFile()  # noqa: SIM115 - closed with the spool
        content = pack((event, arguments), SPOOLED)
        self.file.seek(self.read_at + sum(self.lengths))
        self.file.write(content)
        self.lengths.append(len(content))

    def read(self) -> tuple[Event, tuple[Any, ...]]:
        if self.file is None:
            raise ValueError("the spool is empty")
        self.file.seek(self.read_at)
        length = self.lengths.popleft()
        event, arguments = unpack(self.file.read(length), SPOOLED)
        self.read_at += length
        if not self.lengths:
            self.file.truncate(0)
            self.read_at = 0
        return event, arguments

    def close(self) -> None:
        if self.file is not None:
            self.file.close()


class ObserverThread:
    """One observer, told in a thread of its own. `dropped` counts frames and perceptions that it missed."""

    def __init__(self, name: str, observer: Observer) -> None:
        self.name = name
        self.dropped = 0
        self.failure: str | None = None
        self._observer = observer
        self._waiting: deque[tuple[Event, tuple[Any, ...]]] = deque()
        self._images = 0
        self._spool = _Spool()
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=f"observer {name}", daemon=True)
        self._thread.start()

    def tell(self, event: Event, *arguments: Any) -> None:
        """Have the observer told, when it gets to it."""
        image = event in {"frame", "perceived"}
        with self._changed:
            if self.failure is not None:
                return
            behind = bool(self._spool.lengths) or len(self._waiting) >= MAX_IN_MEMORY
            if image and (behind or self._images >= MAX_IMAGES):
                self.dropped += 1
                return
            self._images += image
            try:
                if behind:
                    self._spool.write(event, arguments)
                else:
                    self._waiting.append((event, arguments))
            except OSError as error:  # no room for what it has not got to yet
                self.failure = f"{type(error).__name__}: {error}"
            self._changed.notify_all()

    def close(self, timeout_s: float = CLOSE_TIMEOUT_S) -> list[str]:
        """Let the observer get to the end of what it has to be told. Returns what it missed, one line each."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout_s)
        told = []
        if self.failure is not None:
            told.append(f"plugin {self.name} was left out: {self.failure}")
        if self.dropped:
            told.append(f"plugin {self.name} was too slow for {self.dropped} frames and perceptions, and missed them")
        if self._thread.is_alive():
            with self._changed:
                left = len(self._waiting) + len(self._spool.lengths)
                self._waiting.clear()
                self._spool.lengths.clear()
            told.append(f"plugin {self.name} had not got to the last {left} events after {timeout_s:g} s")
        return told

    def _run(self) -> None:
        while (next_event := self._next()) is not None:
            event, arguments = next_event
            try:
                getattr(self._observer, event)(*arguments)
            except BaseException as error:  # an observer's fault must not cost the map, nor `sys.exit` go unnoticed
                with self._changed:
                    self.failure = f"{type(error).__name__}: {error}"
                break
        self._spool.close()

    def _next(self) -> tuple[Event, tuple[Any, ...]] | None:
        """The next event; waits for it. `None` at the end."""
        with self._changed:
            while not self._waiting and not self._spool.lengths:
                if self._closed:
                    return None
                self._changed.wait()
            event, arguments = self._waiting.popleft() if self._waiting else self._spool.read()
            self._images -= event in {"frame", "perceived"}
            return event, arguments


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
        if self._threads:
            self._tell("frame", _read_only(frame), _read_only(T_map_base), _read_only(sweep))

    def perceived(
        self, keyframe: Keyframe, detections: Detections, masks: Sequence[RegionMask | None], tracks: Tracks
    ) -> None:
        """What was found in a keyframe."""
        if self._threads:
            seen = (_read_only(keyframe), _read_only(detections), tuple(_read_only(mask) for mask in masks))
            self._tell("perceived", *seen, _read_only(tracks))

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
    """An array, or a value with its arrays, that an observer may look at and not write to: the map is made of them."""
    if isinstance(value, np.ndarray):
        view = value.view()
        view.setflags(write=False)
        return view
    if not is_dataclass(value) or isinstance(value, type):
        return value
    arrays = {own.name: getattr(value, own.name) for own in fields(value) if own.init}
    return replace(
        value, **{name: _read_only(array) for name, array in arrays.items() if isinstance(array, np.ndarray)}
    )
