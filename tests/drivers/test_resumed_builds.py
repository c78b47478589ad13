"""What becomes of a build that was stopped: it goes on, is in the way of another recording, or is taken out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import MapStore, open_store
from supermap_cli.memory.values import Checkpoint, TraversalStart
from supermap_cli.types.memory import MapDelta
from support import databases
from support import fakes as f
from support import scenes as s
from support.fake_builds import DAY_S, KITCHEN, build, monday


def test_a_build_killed_before_its_last_changes_ends_like_an_undisturbed_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who moves by itself is nowhere when the traversal has ended, also if only that was left to be written."""
    config = f.config(keyframes={"batch": 1, "checkpoint_s": 0})
    recording = f.FakeRecording(f.film((*KITCHEN, s.PERSON)))
    plugins = f.FakePlugins(tracker=f.ResumableTracker)
    with open_store(str(tmp_path / "undisturbed.db"), create=True) as store:
        build(store, recording, plugins, config)
    commit = MapStore.commit

    def power_cut(store: MapStore, traversal_id: int, delta: MapDelta, checkpoint: Checkpoint | None = None) -> None:
        if not delta.keyframes:
            raise KeyboardInterrupt
        commit(store, traversal_id, delta, checkpoint)

    with open_store(str(tmp_path / "stopped.db"), create=True) as store:
        monkeypatch.setattr(MapStore, "commit", power_cut)
        with pytest.raises(KeyboardInterrupt):
            build(store, recording, plugins, config)
        monkeypatch.setattr(MapStore, "commit", commit)
        log = f.ObserverLog()
        build(store, recording, f.FakePlugins(tracker=f.ResumableTracker, observer=log), config, unfinished="resume")
    contents = [databases.contents(tmp_path / name, but=("traversal",)) for name in ("stopped.db", "undisturbed.db")]
    assert contents[0] == contents[1]
    assert [stamp_ns for stamp_ns, _ in log.mapped_keyframes] == [None]


def stopped_build(store: MapStore) -> None:
    """What a build leaves that was killed before its first batch."""
    store.begin_traversal(
        TraversalStart("tuesday.fake", "killed", s.ns(DAY_S), s.ns(DAY_S + 2), np.eye(4), name="tuesday")
    )


@pytest.mark.parametrize("unfinished", ["refuse", "resume"])
def test_a_stopped_build_of_another_recording_is_in_the_way(store: MapStore, unfinished: str) -> None:
    stopped_build(store)
    with pytest.raises(MemoryStoreError, match=r"'tuesday' was stopped at 0 %.*tuesday.fake --resume.*--restart"):
        build(store, monday(), unfinished=unfinished)
    assert [traversal.name for traversal in store.traversals()] == ["tuesday"]


def test_what_a_stopped_build_had_written_is_taken_out_when_asked(store: MapStore) -> None:
    stopped_build(store)
    summary = build(store, monday(), unfinished="restart")
    assert [traversal.name for traversal in store.traversals()] == ["monday"]
    assert any("'tuesday' had been stopped" in warning for warning in summary.warnings)
