"""Memory of this process, in 10^6 bytes."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

_STATUS = Path("/proc/self/status")


def peak_memory_mb() -> float:
    """Greatest resident memory of this process so far, 10^6 bytes.

    On Linux `ru_maxrss` includes the memory before exec (getrusage(2)), so /proc/self/status is read there (proc(5)).
    """
    if (highest_mb := _status_mb("VmHWM")) is not None:
        return highest_mb
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (peak if sys.platform == "darwin" else peak * 1024) / 1e6


def memory_mb() -> float:
    """Resident memory of this process now, 10^6 bytes; the greatest so far where /proc is missing."""
    return _status_mb("VmRSS") or peak_memory_mb()


def _status_mb(name: str) -> float | None:
    if not _STATUS.is_file():
        return None
    fields = dict(line.split(":", 1) for line in _STATUS.read_text(encoding="ascii").splitlines())
    return int(fields[name].split()[0]) * 1024 / 1e6 if name in fields else None
