"""Where a recording for Rerun goes to: a viewer that is started, one that runs already, or a file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import rerun as rr

from supermap_rerun.views import blueprint

APPLICATION = "supermap"
SPAWN = "spawn"
_URL = ("rerun+http://", "rerun+https://", "rerun://")

_streams: dict[str, rr.RecordingStream] = {}
"""By target: the traversals of one command go into one recording."""


def stream_to(target: str) -> rr.RecordingStream:
    """A stream to "spawn" (a viewer on this machine), to a viewer's URL, or into a `.rrd` file that is written anew.

    Raises `OSError` or `RuntimeError` where it cannot be opened.
    """
    if target not in _streams:
        stream = rr.RecordingStream(APPLICATION, send_properties=False)
        stream.set_log_time_enabled(False)  # the map's own time is enough, and the same in every run
        stream.set_log_tick_enabled(False)
        if target == SPAWN:
            with _without_analytics():
                stream.spawn()
        elif target.startswith(_URL):
            stream.connect_grpc(target)
        else:
            stream.save(target)
        stream.send_blueprint(blueprint())
        _streams[target] = stream
    return _streams[target]


def close_stream(target: str) -> None:
    """Write out what is left and forget the stream; the next one to this target begins anew."""
    stream = _streams.pop(target, None)
    if stream is not None:
        stream.flush()
        stream.disconnect()


@contextmanager
def _without_analytics() -> Iterator[None]:
    """A viewer that is started meanwhile sends no usage data: it sends none where it runs as part of a CI."""
    before = os.environ.get("CI")
    os.environ["CI"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["CI"]
        else:
            os.environ["CI"] = before
