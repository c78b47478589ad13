"""The map of a small room that a robot has driven through."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.navigation.grid import OccupancyGrid
from supermap_cli.navigation.observed_space import occupancy_grid
from support import driven_room


@pytest.fixture(scope="session")
def room_db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return driven_room.write_map(tmp_path_factory.mktemp("driven") / "room.db")


@pytest.fixture(scope="session")
def reader(room_db: Path) -> Iterator[MapReader]:
    with open_store(str(room_db), read_only=True) as store, store.reader() as opened:
        yield opened


@pytest.fixture(scope="session")
def grid(reader: MapReader) -> OccupancyGrid:
    return occupancy_grid(reader)
