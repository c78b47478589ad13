"""The map as a recording for Rerun (`.rrd`), written by the plugin that shows a build in it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from supermap_cli.errors import ExportError, PluginError
from supermap_cli.exporting.replay import names, replay
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Observer
from supermap_cli.types.session import SessionContext

VIEWER = "rerun"
"""The name of the viewer, and of the plugin that knows it."""


def check_rerun() -> None:
    """Raises `ExportError` where Rerun is not installed."""
    if find_spec("rerun") is None:
        raise ExportError("Rerun is not installed", cure="pip install 'supermap-cli[rerun]'")


def write_rrd(source: ExportSource, path: Path, plugins: Plugins) -> int:
    """Write the recording; returns its number of keyframes.

    Raises `ExportError` where Rerun is missing and for a selection without traversals, `PluginError` where its plugin
    is.
    """
    check_rerun()
    if not source.traversals:
        raise ExportError("no traversal is selected, and so nothing to show", cure="build a recording into the map")
    viewers = {VIEWER: str(path)}
    observer = _observer(plugins, SessionContext("", source.reader.where, "", (), {}, viewers=viewers))
    named = getattr(observer, "named", None)
    if named is not None:
        named(names(source))
    try:
        return replay(source, observer, viewers)
    finally:
        close = getattr(observer, "close", None)
        if close is not None:
            close()


def _observer(plugins: Plugins, context: SessionContext) -> Observer:
    for plugin in plugins.working:
        if plugin.name == VIEWER and "observe_session" in plugin.hooks:
            made: list[Observer | None] = plugin.hook.observe_session(context=context)
            for observer in made:
                if observer is not None:
                    return observer
    raise PluginError("there is no working plugin 'rerun'", cure="`supermap plugins` says what is wrong with it")
