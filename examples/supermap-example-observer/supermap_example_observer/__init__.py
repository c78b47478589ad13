"""The plugin's hook. Every run of `supermap` imports this module, so nothing heavy is imported here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from supermap_cli import hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Observer
    from supermap_cli.types.session import SessionContext


@hookimpl
def observe_session(context: SessionContext) -> Observer | None:  # noqa: ARG001 - `started` is told the same
    """Write a log where the environment names one."""
    path = os.environ.get("SUPERMAP_JSON_LOG")
    if path is None:
        return None
    from supermap_example_observer.json_log import JsonLog  # noqa: PLC0415 - loaded when used

    return JsonLog(Path(path))
