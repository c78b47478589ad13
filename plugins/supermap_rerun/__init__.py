"""Shows a map that is being built, or that was built, in Rerun (https://rerun.io). Needs the extra `rerun`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from supermap_cli import hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Observer
    from supermap_cli.types.session import SessionContext

VIEWER = "rerun"
"""The name by which `SessionContext.viewers` asks for it; its value is "spawn", the URL of a viewer, or a file."""


@hookimpl
def observe_session(context: SessionContext) -> Observer | None:
    """An observer, where the user asked for it."""
    target = context.viewers.get(VIEWER)
    if target is None:
        return None
    from supermap_rerun.observer import RerunObserver  # noqa: PLC0415 - loads rerun
    from supermap_rerun.streams import stream_to  # noqa: PLC0415

    return RerunObserver(stream_to(target), target)
