"""Why the last build of a recording failed, so that `supermap inspect` can say it again. It is kept among the user's
own state, not in the map: a build that fails leaves none.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from supermap_cli.errors import BuildStoppedError, SupermapError

MOST_KEPT = 100
"""Recordings of which it is known; the oldest go first."""


@contextmanager
def remembered(recording: Path) -> Iterator[None]:
    """Keep the error that ends a build of a recording; forget an older one where it ends well."""
    try:
        yield
    except BuildStoppedError:
        raise
    except SupermapError as error:
        _write(recording, str(error))
        raise
    _write(recording, None)


def last_failure(recording: Path) -> str | None:
    """The line with which the last build of a recording ended; `None` where it ended well, or the file is another."""
    kept = _read().get(_key(recording))
    return kept if isinstance(kept, str) else None


def _file() -> Path:
    from platformdirs import user_state_path  # noqa: PLC0415 - keeps start-up light

    return user_state_path("supermap") / "failed_builds.json"


def _key(recording: Path) -> str:
    """A recording by its place, and by its time and size: another one there has failed in no way yet."""
    try:
        status = recording.stat()
        return f"{recording.resolve()} {status.st_mtime_ns} {status.st_size}"
    except (OSError, ValueError):
        return str(recording)


def _read() -> dict[str, object]:
    try:
        kept = json.loads(_file().read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return kept if isinstance(kept, dict) else {}


def _write(recording: Path, message: str | None) -> None:
    """Where it cannot be kept, it is not: the build has said it."""
    kept, key = _read(), _key(recording)
    if message is None and key not in kept:
        return
    kept.pop(key, None)
    if message is not None:
        kept[key] = message
    file = _file()
    with suppress(OSError, ValueError):
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".partial")
        partial.write_text(json.dumps(dict(list(kept.items())[-MOST_KEPT:]), indent=1), encoding="utf-8")
        partial.replace(file)
