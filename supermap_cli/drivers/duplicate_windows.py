"""Whether a stretch of a recording is in the map already, under another window: its seconds enter a map once."""

from __future__ import annotations

from collections.abc import Sequence

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.protocols import Recording
from supermap_cli.recordings.fingerprint import window_fingerprint


def check_no_overlap(recording: Recording, known: Sequence[StoredTraversal]) -> None:
    """Raise `MemoryStoreError` where a part of the window was mapped by a traversal of the same recording.

    What it recorded after its last keyframe does not count: a recording built in parts goes on where it stopped.
    """
    content = recording.content_fingerprint()
    for traversal in known:
        start_ns, end_ns = traversal.start_ns - traversal.clock_shift_ns, traversal.end_ns - traversal.clock_shift_ns
        if traversal.mapped_ns is None or traversal.fingerprint != window_fingerprint(content, start_ns, end_ns):
            continue
        mapped_ns = traversal.mapped_ns - traversal.clock_shift_ns
        common_ns = min(mapped_ns, recording.end_ns) - max(start_ns, recording.start_ns)
        if common_ns >= 0:
            raise MemoryStoreError(
                f"{common_ns / 1e9:.1f} s of this window are in the map already, as traversal {traversal.name!r}",
                where=str(recording.path),
                cure="build what is not in it (--start, --end), or the window into a database of its own (--db), "
                "or those seconds once more (--again)",
            )
