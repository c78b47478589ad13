"""A map for one test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from supermap_cli.memory import MapStore, open_store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[MapStore]:
    with open_store(str(tmp_path / "map.db"), create=True) as opened:
        yield opened
