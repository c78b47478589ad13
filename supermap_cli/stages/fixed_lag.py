"""Results that come late, out of order, or never: each keyframe waits for its own, and all are mapped in their order.

A fixed lag: the map is that of a detector that answers at once, whatever the delays, as long as none is longer than the
wait; who reads the map meanwhile sees it as it was one delay ago.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from supermap_cli.types.sensing import MAIN_CAMERA

K = TypeVar("K")
R = TypeVar("R")


@dataclass
class _AwaitedKeyframe(Generic[K, R]):
    """A keyframe under way: `open` until its result has come."""

    stamp_ns: int
    camera_id: str
    keyframe: K
    open: bool
    result: R | None = None


@dataclass
class FixedLag(Generic[K, R]):
    """Keyframes in the order of their stamps, each with its result.

    One whose result is still awaited holds back those after it, for `wait_ns` at most; then it goes without. So no more
    keyframes are held than come in that time.
    """

    wait_ns: int
    _held: deque[_AwaitedKeyframe[K, R]] = field(default_factory=deque)

    def __len__(self) -> int:
        """How many are held."""
        return len(self._held)

    def expect(self, stamp_ns: int, keyframe: K, *, awaited: bool, camera_id: str = MAIN_CAMERA) -> None:
        """The next keyframe, and whether a result is to come for it."""
        self._held.append(_AwaitedKeyframe(stamp_ns, camera_id, keyframe, awaited))

    def arrive(self, stamp_ns: int, result: R, camera_id: str = MAIN_CAMERA) -> bool:
        """The result for a camera's keyframe of this stamp has come. `False`: too late, it has gone without."""
        for waiting in self._held:
            if (waiting.stamp_ns, waiting.camera_id) == (stamp_ns, camera_id) and waiting.open:
                waiting.result, waiting.open = result, False
                return True
        return False

    def settled(self, now_ns: int | None) -> Iterator[tuple[K, R | None]]:
        """The keyframes that need wait no longer, each once. `now_ns` is the sensor time that has been reached; `None`:
        nothing comes any more.
        """
        while self._held and not (now_ns is not None and self._waits(self._held[0], now_ns)):
            ready = self._held.popleft()
            yield ready.keyframe, ready.result

    def _waits(self, held: _AwaitedKeyframe[K, R], now_ns: int) -> bool:
        return held.open and now_ns - held.stamp_ns <= self.wait_ns
