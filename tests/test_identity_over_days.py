"""A thing keeps its id from one recording to the next; diffs and its history tell what became of it: whole builds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.memory import open_store
from supermap_cli.memory.checking import check
from supermap_cli.query.clock import clock_of
from supermap_cli.query.diff import Diff, ObjectChange, diff
from supermap_cli.query.history_text import history_sentences
from supermap_cli.query.object_history import ObjectHistory, object_history
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame
from support import fakes as f
from support import scenes as s
from support.cli import document

DAY_S = 86_400.0
Named = Callable[[str], str]


@dataclass(frozen=True)
class Day:
    """What stands there, what the detector calls it, and from where along the arc (-1 to 1) it is looked at."""

    things: Sequence[s.Thing]
    called: Named = lambda label: label
    arc: tuple[float, float] = (-1.0, 1.0)
    target: s.Point = (1.6, 0, 0.4)


@dataclass
class NamingDetector(f.FakeDetector):
    """Calls things by other names."""

    called: Named = lambda label: label

    def detect(self, frame: CameraFrame) -> Detections | None:
        scene = next(scene for scene in self.recording.scenes if scene.keyframe.stamp_ns == frame.stamp_ns)
        things = [replace(thing, label=self.called(thing.label) if thing.label else "") for thing in scene.things]
        return s.detect(replace(scene, things=things), (frame.stamp_ns - s.EPOCH_NS) / 1e9, score=self.score)


def film(day: Day, start_s: float, images: int = 12) -> list[s.Scene]:
    """A wide arc, so that two sides of everything are seen."""
    return [
        s.render((*s.ROOM, *day.things), s.looking((-0.4, 1.2 * share, 1.3), day.target), start_s + i / 6)
        for i, share in enumerate(np.linspace(*day.arc, images))
    ]


def build_days(path: Path, *days: Day) -> Path:
    """One traversal a day, named day-1, day-2, ...; the memory is sound after each."""
    with open_store(str(path), create=True) as store:
        for number, day in enumerate(days):
            recording = f.FakeRecording(film(day, number * DAY_S), Path(f"day-{number + 1}.fake"))

            def detector(of: f.FakeRecording, day: Day = day) -> f.FakeDetector:
                return NamingDetector(of, called=day.called)

            plugins = f.FakePlugins(detector=detector).load()
            TraversalBuild(recording, plugins, f.config(), store).run(align="none")
            with store.reader() as reader:
                assert check(reader) == []
    return path


def compared(path: Path, first: str, second: str) -> Diff:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        return diff(reader, first, second)


def change_of(path: Path, text_id: str, first: str = "day-1", second: str = "day-2") -> ObjectChange:
    (change,) = (change for change in compared(path, first, second).changes if change.id == text_id)
    return change


def life_of(path: Path, text_id: str) -> tuple[ObjectHistory, list[str]]:
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        told = object_history(reader, text_id)
        return told, history_sentences(told, clock_of(reader))


def ids(path: Path) -> set[str]:
    """All objects that there ever were, and are believed in."""
    with closing(open_store(str(path), read_only=True)) as store, store.reader() as reader:
        return {instance.id for instance in reader.believed}


CHAIR, BOX = s.CHAIR, s.BOX.at(2.2, -0.9)


def test_a_thing_seen_again_every_day_is_one(tmp_path: Path) -> None:
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), Day((CHAIR, BOX)), Day((CHAIR, BOX)))
    assert ids(path) == {"chair-1", "box-1"}
    for first, second in (("day-1", "day-2"), ("day-2", "day-3"), ("day-1", "day-3")):
        assert compared(path, first, second).counts["unchanged"] == 2
    told, _ = life_of(path, "chair-1")
    assert len(told.intervals) == 1
    assert [counts.supported > 0 for counts in told.sightings] == [True, True, True]
    assert {frame.traversal for frame in told.frames} == {"day-1", "day-2", "day-3"}


@pytest.mark.parametrize("thing", [CHAIR, s.BOX], ids=["chair", "box"])
def test_a_thing_carried_elsewhere_overnight_keeps_its_id(tmp_path: Path, thing: s.Thing) -> None:
    path = build_days(tmp_path / "map.db", Day((thing,)), Day((thing.at(2.3, 0.9),)))
    text_id = f"{thing.label}-1"
    assert ids(path) == {text_id}
    change = change_of(path, text_id)
    assert (change.kind, change.distance_m) == ("moved", pytest.approx(1.14, abs=0.2))
    assert change.not_before_ns is not None
    assert change.not_after_ns is not None
    assert change.not_before_ns < s.ns(DAY_S / 2) < change.not_after_ns
    told, sentences = life_of(path, text_id)
    assert [interval.state for interval in told.intervals] == [0, 1]
    assert sum(sentence.startswith("moved 1.") for sentence in sentences) == 1


@pytest.mark.parametrize("towards", [(0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.18, -0.18)])
def test_a_thing_pushed_aside_by_25_cm_keeps_its_id(tmp_path: Path, towards: tuple[float, float]) -> None:
    pushed = CHAIR.at(1.6 + towards[0], towards[1])
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), Day((pushed, BOX)))
    assert ids(path) == {"chair-1", "box-1"}
    change = change_of(path, "chair-1")
    assert (change.kind, change.distance_m) == ("moved", pytest.approx(0.25, abs=0.1))
    assert change.not_before_ns is not None
    assert change.not_after_ns is not None
    assert change.not_before_ns < s.ns(DAY_S / 2) < change.not_after_ns
    assert change_of(path, "box-1").kind == "unchanged"


def test_a_thing_that_is_called_otherwise_keeps_its_id(tmp_path: Path) -> None:
    first = Day((CHAIR, BOX))
    later = replace(first, called=lambda label: "stool" if label == "chair" else label)
    path = build_days(tmp_path / "map.db", first, later, later)
    assert ids(path) == {"chair-1", "box-1"}
    change = change_of(path, "chair-1")
    assert (change.kind, change.label_before, change.label_after) == ("unchanged", "chair", "stool")
    assert "another reading, no change" in change.reason
    assert change_of(path, "chair-1", "day-2", "day-3").kind == "unchanged"
    _, sentences = life_of(path, "chair-1")
    assert "called chair in day-1, then stool in day-2, day-3" in sentences


def test_a_thing_taken_away_and_brought_back_keeps_its_id(tmp_path: Path) -> None:
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), Day((BOX,)), Day((CHAIR, BOX)))
    assert ids(path) == {"chair-1", "box-1"}
    assert change_of(path, "chair-1", "day-1", "day-2").kind == "disappeared"
    assert change_of(path, "chair-1", "day-2", "day-3").kind == "appeared"
    back = change_of(path, "chair-1", "day-1", "day-3")
    assert (back.kind, back.reason) == ("unchanged", "seen in its place in both, gone in between")


def test_a_thing_moved_and_moved_back_is_unchanged(tmp_path: Path) -> None:
    away = CHAIR.at(2.3, 0.9)
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), Day((away, BOX)), Day((CHAIR, BOX)))
    assert ids(path) == {"chair-1", "box-1"}
    assert [change_of(path, "chair-1", *pair).kind for pair in (("day-1", "day-2"), ("day-2", "day-3"))] == [
        "moved",
        "moved",
    ]
    back = change_of(path, "chair-1", "day-1", "day-3")
    assert (back.kind, back.reason) == ("unchanged", "seen in its place in both, moved in between")


def test_what_nobody_looked_at_is_never_gone(tmp_path: Path) -> None:
    """On the second day the robot looks the other way; on the third the chair is gone."""
    away = Day((), target=(0.6, 4.0, 0.8))
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), replace(away, things=(s.BOX.at(0.6, 3.4),)), Day((BOX,)))
    kinds = {change.id: change.kind for change in compared(path, "day-1", "day-2").changes}
    assert kinds["chair-1"] == "not observed again"
    box = change_of(path, "box-1", "day-1", "day-2")  # on the third day it stands where it stood
    assert (box.kind, box.reason) == ("unchanged", "seen in its place before and after day-2, which did not see it")
    assert change_of(path, "chair-1", "day-2", "day-3").kind == "disappeared"
    gone = change_of(path, "chair-1", "day-1", "day-3")
    assert gone.kind == "disappeared"
    assert gone.not_before_ns is not None
    assert gone.not_before_ns < s.ns(DAY_S)


def test_the_days_are_told_on_the_command_line(tmp_path: Path) -> None:
    new = s.Thing("cup", (1.2, 0.6, 0.1), (0.2, 0.2, 0.2), (220, 60, 50))
    path = build_days(tmp_path / "map.db", Day((CHAIR, BOX)), Day((CHAIR.at(2.3, 0.9), new)))
    found = document("diff", "diff", "day-1", "day-2", "--db", path)
    assert {change["id"]: change["kind"] for change in found["changes"]} == {
        "chair-1": "moved",
        "box-1": "disappeared",
        "cup-1": "appeared",
    }
    for change in found["changes"]:
        assert change["not_before_ns"] < s.ns(DAY_S / 2) < change["not_after_ns"]
        assert change["crop_before" if change["kind"] == "disappeared" else "crop_after"] is not None
    told = document("history", "history", "chair-1", "--db", path)
    assert [event["kind"] for event in told["events"]][-1] == "moved"
    shown = document("show", "show", "--at", "day-1", "--db", path)
    assert {instance["id"] for instance in shown["instances"]} == {"chair-1", "box-1"}
    assert {instance["id"]: instance["standing"]["presence"] for instance in shown["unknown"]} == {}
