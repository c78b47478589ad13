"""Builds of rendered recordings: a kitchen on monday, and what stands there on tuesday."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.build_summary import BuildSummary
from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.memory import MapStore
from support import fakes as f
from support import scenes as s

DAY_S = 86_400.0
KITCHEN = (*s.ROOM, s.TABLE, s.CUP)


def build(
    store: MapStore,
    recording: f.FakeRecording,
    plugins: f.FakePlugins | None = None,
    config: BuildConfig | None = None,
    **options: object,
) -> BuildSummary:
    """Build one traversal; where odom stands in the map is known, unless told otherwise."""
    loaded = (plugins or f.FakePlugins()).load()
    return TraversalBuild(recording, loaded, config or f.config(), store).run(**{"align": "none", **options})  # type: ignore[arg-type]


def monday() -> f.FakeRecording:
    return f.FakeRecording(f.film(KITCHEN))


def tuesday(*things: s.Thing) -> f.FakeRecording:
    return f.FakeRecording(f.film((*s.ROOM, *things), start_s=DAY_S), Path("tuesday.fake"))
