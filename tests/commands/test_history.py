"""`supermap history`."""

from __future__ import annotations

from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from support import kitchen
from support import memories as m
from support.cli import document, supermap


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


def test_a_history_has_states_events_and_sightings(db: Path) -> None:
    history = document("history", "history", "chair-1", "--db", db)
    assert [(interval["state"], interval["gone_ns"]) for interval in history["intervals"]] == [
        (0, m.ns(1001)),
        (1, None),
    ]
    assert [(event["kind"], event["distance_m"]) for event in history["events"]] == [("moved", 3.6056)]
    assert [(sighting["traversal"], sighting["supported"]) for sighting in history["sightings"]] == [
        ("monday", 3),
        ("tuesday", 3),
    ]
    printed = supermap("history", "chair-1", "--db", db).stdout
    assert "chair-1 state 1" in printed
    assert "3.61" in printed


def test_an_unknown_id_is_an_error(db: Path) -> None:
    assert isinstance(supermap("history", "piano-1", "--db", db).exception, QueryError)
