"""How the process keeps its memory: what one image needed is there for the next one."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3
_MB = 1 << 20


def keep_freed_memory() -> None:
    """Let glibc hold on to freed blocks of up to 32 MB instead of returning each to the system at once.

    An image's arrays are a few megabytes each. By default every one of them is mapped, cleared page by page by the
    system and unmapped again (mallopt(3)), which took half of the time that mapping spends. Nothing happens elsewhere.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return
    mallopt(_M_MMAP_THRESHOLD, 32 * _MB)
    mallopt(_M_TRIM_THRESHOLD, 64 * _MB)
    mallopt(_M_TOP_PAD, 8 * _MB)
