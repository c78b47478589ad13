"""Installed plugins that fail to load, for tests of what happens then."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from supermap_cli import plugin_manager


def break_plugin(monkeypatch: pytest.MonkeyPatch, name: str, error: BaseException) -> None:
    """Let the installed plugin of that entry-point name raise when it is loaded."""
    found = plugin_manager.entry_points

    def fail() -> object:
        raise error

    def with_one_broken(**wanted: str) -> list[SimpleNamespace]:
        return [
            SimpleNamespace(name=each.name, dist=each.dist, load=fail if each.name == name else each.load)
            for each in found(**wanted)
        ]

    monkeypatch.setattr(plugin_manager, "entry_points", with_one_broken)
