"""`supermap db vacuum`: what is old goes, what answers need stays, and the map is sound at every moment of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.errors import MemoryStoreError, QueryError
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.memory.pruning import PrunePolicy
from supermap_cli.memory.values import Checkpoint
from supermap_cli.query.retention_policy import parse_retention_policy
from supermap_cli.types.memory import MapDelta, Observation
from support import databases, kitchen, large_memories
from support import memories as m
from support.cli import document, supermap
from support.databases import examples

DAY_S = 86_400


def pictured(number: int, at: float, score: float, crop: bytes | None = b"\xff\xd8\xff" + bytes(5000)) -> Observation:
    plain = m.observation(number, at, score=score)
    return Observation(**{**plain.__dict__, "crop_jpeg": crop})


def long_memory(path: Path) -> Path:
    """A chair seen 20 times on each of two days, and moved between; the fifth look of each day was the best."""

    def day(start: float, index: int) -> MapDelta:
        stamps = [start + second for second in range(1, 21)]
        return MapDelta(
            keyframes=tuple(
                type(keyframe)(**{**keyframe.__dict__, "thumbnail_jpeg": b"\xff\xd8\xff" + bytes(3000)})
                for keyframe in m.keyframes(stamps)
            ),
            instances=(m.instance(1, "chair", (index, 0, 0.5), seen=(1, stamps[-1]), observations=20 * (index + 1)),),
            observations=tuple(
                pictured(1, at, 0.9 if i == 4 else 0.5, None if i % 2 else b"\xff\xd8\xff" + bytes(5000))
                for i, at in enumerate(stamps)
            ),
            states=(
                m.state(1, 0, (1, 20), (0, 0, 0.5), gone=DAY_S + 1 if index else None),
                *((m.state(1, 1, (stamps[0], stamps[-1]), (1, 0, 0.5)),) if index else ()),
            ),
            visits=(m.visit(1, 20, 20, 0, (stamps[0], stamps[-1])),),
            temporal_edges=(m.temporal("moved", (1, 0), (1, 1), 20, DAY_S + 1, distance_m=1.0),) if index else (),
        )

    return m.make_memory(path, ("monday", (0, 30), day(0, 0)), ("tuesday", (DAY_S, DAY_S + 30), day(DAY_S, 1)))


@pytest.fixture
def db(tmp_path: Path) -> Path:
    return long_memory(tmp_path / "map.db")


def problems(db: Path) -> list[object]:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        return list(check(reader))


def observations(db: Path) -> list[tuple[float, bool]]:
    """When each observation was made, in seconds, and whether it has its crop."""
    with closing(databases.connect(db)) as connection:
        found = connection.execute(
            "SELECT stamp_ns, crop_jpeg IS NOT NULL FROM observation JOIN keyframe ON keyframe.id = keyframe_id "
            "ORDER BY stamp_ns"
        )
        return [((stamp_ns - m.ns(0)) / 1e9, bool(crop)) for stamp_ns, crop in found]


def vacuum(db: Path, *keep: str) -> None:
    result = supermap("db", "vacuum", "--db", db, *(word for rule in keep for word in ("--keep", rule)))
    assert result.exit_code == 0, result.output or repr(result.exception)


def test_of_old_observations_the_first_the_last_and_the_best_stay(db: Path) -> None:
    vacuum(db, "observations=12h")
    assert [at for at, _ in observations(db)] == [1, 5, 20, *(DAY_S + second for second in range(1, 21))]
    assert problems(db) == []


def test_of_old_crops_the_best_of_every_state_stays(db: Path) -> None:
    vacuum(db, "crops=12h")
    assert [at for at, has_crop in observations(db) if has_crop and at < DAY_S] == [5]
    assert len(observations(db)) == 40
    assert sum(has_crop for at, has_crop in observations(db) if at > DAY_S) == 10
    assert problems(db) == []


def test_no_crop_stays_where_none_is_to_be_kept(db: Path) -> None:
    vacuum(db, "crops=none")
    assert not any(has_crop for _, has_crop in observations(db))
    assert len(observations(db)) == 40


def test_old_thumbnails_go(db: Path) -> None:
    vacuum(db, "thumbnails=tuesday")
    with closing(databases.connect(db)) as connection:
        kept = connection.execute("SELECT traversal_id, count(thumbnail_jpeg) FROM keyframe GROUP BY 1").fetchall()
    assert kept == [(1, 0), (2, 20)]
    assert problems(db) == []


def test_states_edges_and_visits_stay(db: Path) -> None:
    before = {table: dump(db, table) for table in ("state", "temporal_edge", "visit", "instance", "spatial_edge")}
    vacuum(db, "observations=1s", "crops=none", "thumbnails=none")
    assert {table: dump(db, table) for table in before} == before


def everything(db: Path) -> list[list[object]]:
    return [dump(db, table) for table in ("traversal", "keyframe", "observation", "instance", "state")]


def dump(db: Path, table: str) -> list[object]:
    with closing(databases.connect(db)) as connection:
        return list(connection.execute(f"SELECT * FROM {table} ORDER BY 1, 2").fetchall())


@pytest.mark.sqlite_only("what PostgreSQL gives back to its disk is its own affair")
def test_the_file_gets_smaller(db: Path) -> None:
    before = db.stat().st_size
    told = document("db_vacuum", "db", "vacuum", "--db", db, "--keep", "crops=none", "--keep", "thumbnails=none")
    assert told["given_up"] == {"observations": 0, "crops": 20, "thumbnails": 40, "size_bytes": 20 * 5003 + 40 * 3003}
    assert told["size_before_bytes"] == before
    assert told["size_after_bytes"] == db.stat().st_size < before - 200_000


def test_a_dry_run_says_what_would_go_and_changes_nothing(db: Path) -> None:
    content = everything(db)
    words = ("--keep", "observations=12h", "--keep", "crops=12h", "--keep", "thumbnails=12h")
    planned = document("db_vacuum", "db", "vacuum", "--db", db, *words, "--dry-run")
    assert everything(db) == content
    done = document("db_vacuum", "db", "vacuum", "--db", db, *words)
    assert planned["given_up"] == done["given_up"] != {"observations": 0}
    assert done["given_up"]["observations"] == 17
    printed = supermap("db", "vacuum", "--db", db, *words, "--dry-run").stdout
    assert "0 observations from before" in printed


def test_doing_it_twice_gives_up_nothing_more(db: Path) -> None:
    words = ("--keep", "observations=12h", "--keep", "crops=12h")
    document("db_vacuum", "db", "vacuum", "--db", db, *words)
    again = document("db_vacuum", "db", "vacuum", "--db", db, *words)
    assert again["given_up"]["observations"] == again["given_up"]["crops"] == 0


def test_answers_say_that_observations_were_given_up(db: Path) -> None:
    vacuum(db, "observations=12h")
    told = document("history", "history", "chair-1", "--db", db)
    assert told["evidence"]["given_up_before_ns"] == m.ns(DAY_S + 20) - 12 * 3600 * 10**9
    assert [len(told["intervals"]), told["sightings"][0]["observation_count"]] == [2, 3]
    assert "only the telling ones were kept" in supermap("history", "chair-1", "--db", db).stdout
    changed = document("diff", "diff", "--db", db)
    assert [change["kind"] for change in changed["changes"]] == ["moved"]
    assert changed["changes"][0]["evidence_before"]["observations"] == [1, 5, 20]
    assert any("given up" in note for note in changed["notes"])
    answered = document("answer", "query", "chair in monday", "--db", db)
    assert [instance["id"] for instance in answered["instances"]] == ["chair-1"]
    assert any("only the telling ones" in note for note in answered["notes"])


def test_where_nothing_was_given_up_nothing_is_said(db: Path) -> None:
    vacuum(db)
    assert "given_up_before_ns" not in document("history", "history", "chair-1", "--db", db)["evidence"]
    assert not any("given up" in note for note in document("diff", "diff", "--db", db)["notes"])


def test_the_database_lets_nothing_go_that_was_not_given_up(db: Path) -> None:
    vacuum(db, "observations=12h", "crops=12h")
    for sql in (
        "DELETE FROM observation WHERE id = (SELECT max(id) FROM observation)",
        "UPDATE observation SET crop_jpeg = NULL WHERE id = (SELECT max(id) FROM observation)",
        "UPDATE observation SET score = 1 WHERE id = 1",
    ):
        with pytest.raises(Exception, match="observations"):
            m.run_sql(db, sql)


def test_a_map_goes_on_after_it(db: Path) -> None:
    vacuum(db, "observations=12h", "crops=none", "thumbnails=none")
    with open_store(str(db)) as store:
        m.add_traversal(
            store, "wednesday", (3 * DAY_S, 3 * DAY_S + 9), MapDelta(keyframes=m.keyframes([3 * DAY_S + 1]))
        )
    assert problems(db) == []


def test_while_a_build_has_not_ended_nothing_is_given_up(db: Path) -> None:
    with open_store(str(db)) as store:
        store.begin_traversal(m.start("wednesday", (3 * DAY_S, 3 * DAY_S + 9)))
    result = supermap("db", "vacuum", "--db", db, "--keep", "crops=none")
    assert isinstance(result.exception, MemoryStoreError)
    assert "has not come to its end" in str(result.exception)
    assert sum(has_crop for _, has_crop in observations(db)) == 20


def test_while_a_build_writes_it_is_refused(db: Path) -> None:
    with open_store(str(db)):
        assert isinstance(supermap("db", "vacuum", "--db", db).exception, MemoryStoreError)


def test_readers_are_not_blocked(db: Path) -> None:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        (chair,) = reader.instances
        vacuum(db, "observations=12h")
        assert len(reader.observations(chair)) == 40
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        assert len(reader.observations(chair)) == 23


@pytest.mark.sqlite_only("a server looks after its disk itself")
def test_without_room_the_map_stays_and_the_error_says_what_is_needed(
    db: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = type("usage", (), {"free": 1000})
    monkeypatch.setattr("supermap_cli.memory.databases.sqlite.shutil.disk_usage", lambda _: usage)
    result = supermap("db", "vacuum", "--db", db, "--keep", "crops=none")
    assert isinstance(result.exception, MemoryStoreError)
    assert "free space" in str(result.exception)
    assert problems(db) == []


@pytest.mark.parametrize(
    ("said", "seconds"),
    [
        ("5s", DAY_S + 15),
        ("2min", DAY_S + 20 - 120),
        ("12h", DAY_S + 20 - 12 * 3600),
        ("1d", 20),
        ("0.5 d", DAY_S + 20 - 12 * 3600),
        ("1 traversal", DAY_S),
        ("2traversals", 0),
        ("tuesday", DAY_S),
        ("monday", 0),
        ("2026-01-05T09:00:07Z", 7),
    ],
)
def test_ages_count_back_from_the_newest_time_in_the_map(db: Path, said: str, seconds: float) -> None:
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        assert parse_retention_policy([f"crops={said}"], reader) == PrunePolicy(crops_ns=m.ns(seconds))


@pytest.mark.parametrize(
    "words",
    [("crops",), ("crops=",), ("voxels=1d",), ("crops=5 parsecs",), ("observations=none",), ("crops=1d", "crops=2d")],
)
def test_what_is_not_understood_is_an_error_that_shows_how_to_say_it(db: Path, words: tuple[str, ...]) -> None:
    with open_store(str(db), read_only=True) as store, store.reader() as reader, pytest.raises(QueryError):
        parse_retention_policy(words, reader)


@pytest.mark.sqlite_only("a server looks after its disk itself")
def test_what_checkpoints_took_is_given_back_when_a_build_is_done(tmp_path: Path) -> None:
    db = tmp_path / "map.db"
    with open_store(str(db), create=True) as store:
        traversal_id = store.begin_traversal(m.start("monday", (0, 10)))
        large = Checkpoint(m.ns(1), {"engine": os.urandom(2_000_000)})
        store.commit(traversal_id, MapDelta(keyframes=m.keyframes([1])), large)
        store.finish_traversal(traversal_id)
    with closing(databases.connect(db)) as connection:
        assert connection.execute("PRAGMA freelist_count").fetchone() == (0,)
    assert db.stat().st_size < 500_000


seconds = st.one_of(st.none(), st.integers(-5, 1200))
limits = st.tuples(seconds, seconds, seconds, st.booleans())


@pytest.mark.sqlite_only("about files")
@settings(max_examples=examples(15))
@given(limits)
def test_whatever_is_given_up_the_map_is_sound_and_every_state_has_its_evidence(
    tmp_path_factory: pytest.TempPathFactory,
    given_limits: tuple[int | None, int | None, int | None, bool],
) -> None:
    crops, seen, thumbnails, best_crops = given_limits
    db = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    kept = PrunePolicy(m.maybe_ns(crops), m.maybe_ns(seen), m.maybe_ns(thumbnails), best_crops)
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        before = {instance.id: reader.observations(instance) for instance in reader.instances}
    with open_store(str(db)) as store:
        store.prune(kept)
        store.vacuum()
    assert problems(db) == []
    with open_store(str(db), read_only=True) as store, store.reader() as reader:
        for instance in reader.instances:
            left = reader.observations(instance)
            for state in instance.states:
                old, now = (
                    [o for o in some if state.first_seen_ns <= o.stamp_ns <= state.last_seen_ns]
                    for some in (before[instance.id], left)
                )
                if old:
                    assert {old[0].id, old[-1].id} <= {o.id for o in now}
                    assert max(o.score for o in now) == max(o.score for o in old)
                    assert {o.traversal_id for o in now} == {o.traversal_id for o in old}
            young = [o.id for o in before[instance.id] if o.stamp_ns >= (kept.observations_ns or 0)]
            assert set(young) <= {o.id for o in left}


KILLED = """
import sys
from supermap_cli.main import main
from supermap_cli.memory import pruning
pruning.BATCH = 10
sys.argv = ["supermap", "db", "vacuum", "--db", sys.argv[1], "--keep", "observations=1s", "--keep", "crops=none",
            "--keep", "thumbnails=none"]
main()
"""


@pytest.mark.sqlite_only("looks at SQLite's files")
def test_killed_at_any_moment_it_leaves_a_sound_map_and_can_be_done_again(tmp_path: Path) -> None:
    origin = large_memories.grow(long_memory(tmp_path / "origin.db"), 250)
    before = origin.read_bytes()
    rng = np.random.default_rng(5)
    unfinished = 0
    for _ in range(5):
        db = tmp_path / "map.db"
        db.write_bytes(before)
        with subprocess.Popen([sys.executable, "-c", KILLED, db], stderr=subprocess.DEVNULL, env=os.environ) as run:
            deadline = time.monotonic() + 30
            while not db.with_name("map.db-wal").exists() and run.poll() is None and time.monotonic() < deadline:
                time.sleep(0.002)
            time.sleep(rng.uniform(0, 0.3))
            run.send_signal(signal.SIGKILL)
        assert problems(db) == []
        unfinished += len(observations(db)) > 251 * 6
        vacuum(db, "observations=1s", "crops=none", "thumbnails=none")
        assert problems(db) == []
        for name in ("map.db", "map.db-wal", "map.db-shm"):
            (tmp_path / name).unlink(missing_ok=True)
    assert unfinished > 0
