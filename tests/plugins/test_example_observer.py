"""The example observer: what it wrote to its log adds up to what stands in the database."""

from __future__ import annotations

import importlib
import json
import sys
from collections import Counter
from pathlib import Path

import pytest

from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.memory import open_store
from supermap_cli.plugin_manager import Plugins, load_plugins
from supermap_cli.types.session import SessionContext
from support import databases
from support import fakes as f
from support import scenes as s

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "supermap-example-observer"


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch) -> Plugins:
    monkeypatch.setattr(sys, "path", [str(EXAMPLE), *sys.path])
    return load_plugins([f.FakePlugins().plugin_object(), importlib.import_module("supermap_example_observer")])


def test_the_log_adds_up_to_the_database(plugins: Plugins, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, db = tmp_path / "build.jsonl", tmp_path / "map.db"
    monkeypatch.setenv("SUPERMAP_JSON_LOG", str(log))
    monday = f.FakeRecording(f.film((*s.ROOM, s.TABLE, s.CUP)))
    tuesday = f.FakeRecording(f.film((*s.ROOM, s.TABLE), start_s=86_400.0), Path("tuesday.fake"))
    with open_store(str(db), create=True) as store:
        for recording in (monday, tuesday):
            TraversalBuild(recording, plugins, f.config(keyframes={"batch": 4}), store).run(align="none")
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    by_event = {
        event: [line for line in lines if line["event"] == event] for event in {line["event"] for line in lines}
    }
    assert [line["traversal"] for line in by_event["started"]] == ["monday", "tuesday"]
    assert all(line["complete"] for line in by_event["ended"])
    for told in (by_event["mapped"], by_event["committed"]):
        assert sum(line["keyframes"] for line in told) == count(db, "keyframe")
        assert sum(line["observations"] for line in told) == count(db, "observation")
        assert len({number for line in told for number in line["instances"]}) == count(db, "instance")
        assert len({tuple(state) for line in told for state in line["states"]}) == count(db, "state")
        kinds = Counter(kind for line in told for kind in line["temporal_edges"])
        assert kinds == Counter(dict(databases.query(db, "SELECT kind, count(*) FROM temporal_edge GROUP BY kind")))
    mapped_ns = [line["stamp_ns"] for line in by_event["mapped"] if line["stamp_ns"] is not None]
    assert len(mapped_ns) == len(set(mapped_ns)) == count(db, "keyframe")


def test_without_a_log_there_is_no_observer(plugins: Plugins, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SUPERMAP_JSON_LOG", raising=False)
    assert plugins.hook.observe_session(context=SessionContext("", "", "", (), {})) == []


def count(db: Path, table: str) -> int:
    ((rows,),) = databases.query(db, f"SELECT count(*) FROM {table}")
    return int(rows)
