"""What a process has in memory."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

_STATUS = Path("/proc/self/status")


def peak_memory_mb() -> float:
    """The most memory this process had at a time, 10^6 bytes.

    Linux counts what the process had before it became this program into `ru_maxrss` (getrusage(2)), so it is asked
    otherwise there.
    """
    if (highest_mb := _status_mb("VmHWM")) is not None:
        return highest_mb
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (peak if sys.platform == "darwin" else peak * 1024) / 1e6


def memory_mb() -> float:
    """What this process has in memory now, where Linux tells it; else the most it had."""
    return _status_mb("VmRSS") or peak_memory_mb()


def _status_mb(name: str) -> float | None:
    if not _STATUS.is_file():
        return None
    fields = dict(line.split(":", 1) for line in _STATUS.read_text(encoding="ascii").splitlines())
    return int(fields[name].split()[0]) * 1024 / 1e6 if name in fields else None
