"""How much of anything a recording may hold, so that a small hostile file cannot take the memory of a machine."""

from __future__ import annotations

from supermap_cli.types.limits import RecordingLimits

Limits = RecordingLimits

SMALL_BYTES, LARGEST_RATIO = 64 << 20, 64
"""Beyond 64 MiB nothing that is held in memory may unpack to more than 64 times its size (estimate: depth images of an
empty wall, the most that real recordings reach, unpack to 30 to 60 times theirs).
"""


def most_unpacked(packed_bytes: int, limit_bytes: int) -> int:
    """Bytes that a chunk or message of a packed size may unpack to."""
    return min(limit_bytes, max(SMALL_BYTES, LARGEST_RATIO * packed_bytes))
