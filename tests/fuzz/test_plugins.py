"""Plugins that raise, print, or answer with anything: a build ends well, or with one line; no map is broken."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli import plugin_manager
from support import bags
from support.fuzzed_commands import run
from support.fuzzing import fuzzing, one_input

CODE = """
import numpy as np
from supermap_cli import Options, hookimpl
from supermap_cli.types.detections import Detections, Hypothesis, RegionMask, Tracks
from supermap_cli.types.sensing import StampedPose

def act():
    if HOW == "raises":
        raise WHAT
    return WHAT

def answer(place, usual):
    return act() if place == PLACE else usual()

class Backend:
    def __init__(self, place="none"):
        if place == PLACE:
            act()
    inputs = frozenset({"poses"})
    warnings = ()
    def image_stamps_ns(self, camera_id):
        return answer("image_stamps_ns", lambda: None)
    def detect(self, frame):
        box = np.array([[24, 16, 40, 32]], np.float32)
        usual = lambda: Detections(frame.stamp_ns, box, np.ones(1, np.float32), ((Hypothesis("box", 1.0),),), (None,))
        return answer("detect", usual)
    def segment(self, frame, detections):
        return answer("segment", lambda: (None,) * len(detections))
    def update(self, detections, priors, size):
        return answer("update", lambda: Tracks(np.arange(len(detections))))
    def register_pose(self, pose):
        return answer("register_pose", lambda: pose)
    def finish(self):
        answer("finish", lambda: None)
    def started(self, context): answer("started", lambda: None)
    def frame(self, frame, T, sweep): answer("frame", lambda: None)
    def perceived(self, *given): answer("perceived", lambda: None)
    def mapped(self, *given): answer("mapped", lambda: None)
    def committed(self, *given): answer("committed", lambda: None)
    def ended(self, *given): answer("ended", lambda: None)

def make(options, recording):
    return answer("factory", Backend)

@hookimpl
def register_detectors(register):
    answer("register", lambda: register("theirs", make))
@hookimpl
def register_segmenters(register): register("theirs", make)
@hookimpl
def register_trackers(register): register("theirs", make)
@hookimpl
def register_odometry(register): register("theirs", make, needs={"poses"})
@hookimpl
def spatial_predicates():
    return answer("spatial_predicates", list)
@hookimpl
def open_recording(path, request):
    return answer("open_recording", lambda: None)
@hookimpl
def observe_session(context):
    return answer("observe_session", Backend)
@hookimpl
def prepare_connection(connection):
    answer("prepare_connection", lambda: None)
@hookimpl
def register_commands(app):
    answer("register_commands", lambda: None)
"""

PLACES = st.sampled_from(
    [
        *("image_stamps_ns", "detect", "segment", "update", "register_pose", "finish", "factory", "register"),
        *("spatial_predicates", "open_recording", "observe_session", "prepare_connection", "register_commands"),
        *("started", "frame", "perceived", "mapped", "committed", "ended"),
    ]
)
ERRORS = st.sampled_from(
    [
        *(ValueError("two\nlines"), KeyError("x"), RuntimeError(""), OSError(5, "disk"), MemoryError(), SystemExit(0)),
        *(StopIteration(), AttributeError("a"), ZeroDivisionError(), TimeoutError("late"), UnicodeError("\x1b[2J")),
        *(NotImplementedError(), AssertionError(), EOFError(), RecursionError()),
    ]
)
ANSWERS = st.sampled_from([None, 0, 1, float("nan"), "x", "", b"x", (), [], [None], [1], {}, object(), Exception, True])
FAULTS = st.one_of(st.tuples(st.just("raises"), ERRORS), st.tuples(st.just("answers"), ANSWERS))


@pytest.fixture(autouse=True)
def _forget_plugins() -> Iterator[None]:
    yield
    sys.modules.pop("their_package", None)
    plugin_manager._load_installed.cache_clear()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bags.write_recording(tmp_path_factory.mktemp("recording") / "run.mcap", frames=6)


def install(monkeypatch: pytest.MonkeyPatch, place: str, how: str, what: Any) -> None:
    """The built-in plugins and a faulty one."""
    module = ModuleType("their_package")
    module.__dict__.update(PLACE=place, HOW=how, WHAT=what)
    exec(CODE, module.__dict__)  # noqa: S102 - code of another package
    distribution = SimpleNamespace(name="their-dist", version="1")
    entry = SimpleNamespace(name="theirs", value="their_package", dist=distribution, load=lambda: module)
    real = metadata.entry_points
    monkeypatch.setattr(plugin_manager, "entry_points", lambda **wanted: [*real(**wanted), entry])
    plugin_manager._load_installed.cache_clear()


ROLES = ("--detector=theirs", "--segmenter=theirs", "--tracker=theirs", "--odometry=theirs")


@fuzzing(12, share=0.3)
@given(PLACES, FAULTS)
def test_any_fault_at_any_place(tmp_path: Path, recording: Path, place: str, fault: tuple[str, Any]) -> None:
    db = tmp_path / "map.db"
    for path in tmp_path.iterdir():
        path.unlink()
    with pytest.MonkeyPatch.context() as patch, one_input("plugin"):
        install(patch, place, *fault)
        run(["build", str(recording), "--db", str(db), *ROLES])
        if db.exists():
            run(["db", "sql", "SELECT count(*) FROM visit", "--db", str(db)])
        run(["no-such-command"])
    if db.exists():
        assert run(["db", "check", "--db", str(db)])[0] == 0
