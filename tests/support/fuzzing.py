"""What all fuzzers share: how many examples, the time and memory that one may take, changed bytes, and counts.

    @fuzzing(12)
    @given(...)
    def test_something(...):
        with one_input("mcap"):
            ...

`SUPERMAP_FUZZ_EXAMPLES` says how many examples each test tries (`make fuzz`); without it each tries the few that it
names, the same ones every time. `--hypothesis-seed` repeats a run, and `SUPERMAP_FUZZ_SHRINK=yes` makes what it finds
smaller.
"""

from __future__ import annotations

import os
import re
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

from supermap_cli.errors import SupermapError

LONGEST_S, LONGEST_WAIT_S = 20, 120
"""Seconds of computing that one input may take, and by the clock: a wait that never ends, on a busy machine."""

MOST_MB = 800
"""MB that one input may add to what the process holds: with the program itself, which takes 200, this makes 1 GB."""

TRIED: Counter[str] = Counter()
"""How many inputs of each format were tried in this process."""

_EXAMPLES = os.environ.get("SUPERMAP_FUZZ_EXAMPLES")

_SHRINKS = os.environ.get("SUPERMAP_FUZZ_SHRINK", "no") == "yes"
"""Whether a found input is made smaller, which takes minutes where an input takes a second."""

_PHASES = (Phase.explicit, Phase.generate, Phase.shrink)


def fuzzing(in_ci: int, *, share: float = 1.0) -> settings:
    """Settings of a fuzzer: `in_ci` examples, or that `share` of `SUPERMAP_FUZZ_EXAMPLES` for one that is slow."""
    return settings(
        max_examples=in_ci if _EXAMPLES is None else max(1, round(int(_EXAMPLES) * share)),
        deadline=None,
        derandomize=_EXAMPLES is None,
        suppress_health_check=list(HealthCheck),
        database=None,
        phases=_PHASES if _SHRINKS else _PHASES[:2],
    )


class TooMuchError(BaseException):
    """An input takes too long or too much memory; nothing that is tried may catch it."""


@contextmanager
def one_input(form: str) -> Iterator[None]:
    """Count one input of a format; it may take 20 s and 1 GB, and warn of nothing that numpy computes."""
    TRIED[form] += 1
    with _time_limit(), _memory_limit(), warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


@contextmanager
def _time_limit() -> Iterator[None]:
    def too_long(number: int, *_: object) -> None:
        raise TooMuchError(f"{LONGEST_S} s of computing" if number == signal.SIGPROF else f"{LONGEST_WAIT_S} s")

    before = {number: signal.signal(number, too_long) for number in (signal.SIGPROF, signal.SIGALRM)}
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_WAIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _memory_limit() -> Iterator[None]:
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak counts anew, see proc(5)
    before_mb = peak_memory_mb()
    yield
    added_mb = peak_memory_mb() - before_mb
    if added_mb > MOST_MB:
        raise TooMuchError(f"{added_mb:.0f} MB")


def peak_memory_mb() -> float:
    """The most memory this process held since its peak was last reset, in MB (VmHWM)."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(re.search(r"VmHWM:\s+(\d+) kB", status).group(1)) / 1000  # type: ignore[union-attr]


def one_line(run: Callable[[], Any], *refused: type[Exception]) -> Any:
    """What a function gives; an error that the user can mend (or one of `refused`) has one line, and gives `None`."""
    try:
        return run()
    except (SupermapError, *refused) as error:
        text = str(error)
    assert text
    assert "\n" not in text
    return None


@dataclass(frozen=True)
class Edit:
    """A change of bytes at a place, given as a share of the whole."""

    kind: str
    share: float
    data: bytes

    def apply(self, data: bytes) -> bytes:
        """The changed bytes."""
        at = int(self.share * len(data))
        if self.kind == "cut":
            return data[:at]
        if self.kind == "insert":
            return data[:at] + self.data + data[at:]
        if self.kind == "remove":
            return data[:at] + data[at + len(self.data) :]
        return data[:at] + self.data + data[at + len(self.data) :]


_EXTREMES = st.sampled_from(
    [
        *(b"\0" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\1\0\0\0", b"\0\0\0\x10"),
        *(b"\0" * 8, b"\xff" * 8, b"\xff" * 7 + b"\x7f", b"\0\0\0\0\0\0\xf0\x7f", b"\0\0\0\0\0\0\xf8\x7f"),
        *(b"\0\0\0\0\0\0\xe0\x7f", b"\0" * 64),
    ]
)
EDITS = st.builds(
    Edit,
    st.sampled_from(["overwrite", "overwrite", "overwrite", "cut", "insert", "remove"]),
    st.floats(0, 1, exclude_max=True),
    st.one_of(_EXTREMES, st.binary(min_size=1, max_size=12)),
)
MUTATIONS = st.lists(EDITS, min_size=1, max_size=4)
"""Changes of some bytes: extreme numbers of any layout, or any bytes."""


def mutated(data: bytes, changes: list[Edit]) -> bytes:
    """The bytes after all changes."""
    for change in changes:
        data = change.apply(data)
    return data
