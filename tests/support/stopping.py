"""Builds in processes of their own, which are killed, stopped or starved at a chosen moment."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Engine, event, select

from supermap_cli.main import main
from supermap_cli.memory import open_store, pruning
from supermap_cli.simulation.detection.detector_errors import DetectorErrors
from supermap_cli.simulation.recording.recorder import record
from supermap_cli.simulation.rigs import DepthSensor, OdometryDrift
from supermap_cli.simulation.route import Route
from supermap_cli.simulation.scenario import Scenario, SimulatedTraversal
from supermap_schema.models import Base
from support import databases, simulated, simulated_traversals

SETTINGS = "[build.keyframes]\nrate_hz = 5\nbatch = 3\ncheckpoint_s = 0.05\n"
"""Small batches and frequent checkpoints: many moments to be killed at."""

RUN_LIMIT_S = 300
"""Seconds that one command may take: many times what it takes on a busy machine."""

Rows = dict[str, list[tuple[object, ...]]]
"""The rows of a memory by table."""


def long_route(start_ns: int, seconds: float) -> Route:
    """Along the wall and back, looking at the middle of the room."""
    share = np.sin(np.linspace(0, np.pi, 24))
    xy = np.column_stack([np.full(24, 2.4), -1.9 + 3.2 * share])
    yaw = np.arctan2(-xy[:, 1], -xy[:, 0] - 0.4)
    return Route(start_ns, np.linspace(0, 1, 24) * seconds, xy, np.unwrap(yaw))


def record_two_visits(folder: Path) -> tuple[Path, ...]:
    """Two visits of a few seconds with noise, drift and a detector that errs."""
    noisy = replace(simulated_traversals.small_rig(), depth=DepthSensor(), drift=OdometryDrift())
    short = simulated_traversals.two_traversals(noisy)
    later_ns = short.traversals[1].route.start_ns
    traversals = (
        SimulatedTraversal("monday", long_route(simulated.START_NS, 4.0), simulated_traversals.T_WORLD_ODOM),
        SimulatedTraversal("tuesday", long_route(later_ns, 3.5), simulated_traversals.T_WORLD_ODOM),
    )
    scenario: Scenario = replace(short, traversals=traversals)
    return record(scenario, folder, errors=DetectorErrors()).recordings


def build_undisturbed(folder: Path, recordings: Sequence[Path]) -> Path:
    """The memory of some recordings, built without a disturbance; `folder` is empty before."""
    (folder / "supermap.toml").write_text(SETTINGS)
    code, told = run(folder, "build", *recordings, "--db", "map.db")
    assert code == 0, told
    return folder / "map.db"


@dataclass(frozen=True)
class Moment:
    """When a build's process is to be killed: `seconds` after it began, or after the `nth` of its SQL statements that
    begin with `statement`, or with `commit` after the commit of that statement's transaction began.
    """

    seconds: float = 0.0
    statement: str | None = None
    nth: int = 1
    commit: bool = False


def die() -> None:
    """Kill this process."""
    os.kill(os.getpid(), signal.SIGKILL)


def kill(moment: Moment) -> None:
    """A `prepare`: the process is killed at the given moment."""
    at(moment, die)


def in_small_batches() -> None:
    """A `prepare`: prune in many transactions."""
    pruning.BATCH = 2


def count_moments(path: str) -> None:
    """A `prepare`: write down how long the command took, and how many statements and transactions it had."""
    in_small_batches()
    counts = {"statements": 0, "commits": 0}
    began_s = time.monotonic()

    def count(name: str) -> None:
        counts[name] += 1

    def write() -> None:
        Path(path).write_text(json.dumps({**counts, "seconds": time.monotonic() - began_s}))

    event.listen(Engine, "before_cursor_execute", lambda *_: count("statements"))
    event.listen(Engine, "commit", lambda *_: (count("commits"), write()))


def at(moment: Moment, action: Callable[[], None]) -> None:
    """Do something once, at the given moment of this process."""
    done = threading.Event()

    def act() -> None:
        if not done.is_set():
            done.set()
            action()

    def later() -> None:
        if moment.seconds > 0:
            timer = threading.Timer(moment.seconds, act)
            timer.daemon = True
            timer.start()
        else:
            act()

    if moment.statement is None:
        later()
        return
    wanted, left = moment.statement, moment.nth

    def before_statement(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        nonlocal left
        left -= statement.lstrip().startswith(wanted)
        if left == 0 and not moment.commit:
            later()

    def before_commit(_connection: object) -> None:
        if left <= 0 and moment.commit:
            later()

    event.listen(Engine, "before_cursor_execute", before_statement)
    event.listen(Engine, "commit", before_commit)


def _run(arguments: Sequence[str], folder: str, prepare: Callable[[Any], None] | None, given: Any) -> None:
    os.chdir(folder)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if prepare is not None:
        prepare(given)
    sys.argv = ["supermap", *arguments]
    with Path("stderr.txt").open("w") as file, Path(os.devnull).open("w") as nothing:
        os.dup2(file.fileno(), 2)
        os.dup2(nothing.fileno(), 1)
    main()


_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(
    [
        *("supermap_cli.drivers.traversal_build", "supermap_cli.memory.databases.sqlite", "supermap_schema.upgrading"),
        *(f"supermap_cli.recordings.{each}" for each in ("bag_recording", "sqlite_storage", "self_calibration")),
        *("supermap_bytetrack.tracker", "supermap_depth_segmenter.segmenter", "supermap_recorded.detector"),
        *("supermap_recorded.odometry", "supermap_kiss_icp", "supermap_onnx"),
        *("rosbags.typesys.stores.ros2_jazzy", "scipy.optimize", "scipy.spatial", "scipy.sparse.csgraph"),
    ]
)
"""What a build imports, so that no child spends its time on that."""


def start(
    folder: Path, *arguments: str | Path, prepare: Callable[[Any], None] | None = None, given: Any = None
) -> ForkServerProcess:
    """Start `supermap ARGUMENTS` in a folder; `prepare(given)` is called there first; its stderr is `stderr.txt`."""
    told = [str(each) for each in arguments]
    if databases.on_postgresql():
        after = {"--db": lambda path: path if "://" in path else databases.place(folder / path)}
        told = [after.get(option, str)(each) for option, each in pairwise(("", *told))]
    process = _CONTEXT.Process(target=_run, args=(told, str(folder), prepare, given))
    process.start()
    return process


def run(
    folder: Path, *arguments: str | Path, prepare: Callable[[Any], None] | None = None, given: Any = None
) -> tuple[int, str]:
    """Run `supermap ARGUMENTS` in a folder to its end; returns the exit code, negative for a signal, and its stderr."""
    process = start(folder, *arguments, prepare=prepare, given=given)
    process.join(RUN_LIMIT_S)
    if process.exitcode is None:
        process.kill()
        process.join(10)
        raise TimeoutError(f"supermap {' '.join(map(str, arguments))} took more than {RUN_LIMIT_S} s")
    return process.exitcode, (folder / "stderr.txt").read_text()


def limit_files(size_bytes: int) -> None:
    """A `prepare`: no file may grow beyond this, as on a disk that is full."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, size_bytes))


def wait_after_commits(seconds: float) -> None:
    """A `prepare`: a slow build."""

    def wait(*_: object) -> None:
        time.sleep(seconds)

    event.listen(Engine, "commit", wait)


def rows(url: str | Path) -> Rows:
    """All rows of a memory by table, but for how long stages took."""
    with open_store(str(url), read_only=True) as store, store.reader() as reader:
        found = {}
        for table in Base.metadata.sorted_tables:
            columns = [column for column in table.columns if column.name != "timings"]
            statement = select(*columns).order_by(*table.primary_key.columns)
            found[table.name] = [tuple(row) for row in reader.connection.execute(statement)]
        return found
