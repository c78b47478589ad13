"""What holds for all tests."""

import os
import shutil
import signal
import tempfile
from collections.abc import Generator
from functools import partial
from types import FrameType

import pytest
from hypothesis import settings

from support import databases

settings.register_profile(  # a busy machine is no failure; `make fuzz` tries more examples
    "suite", deadline=None, derandomize="CI" in os.environ, max_examples=30
)
settings.load_profile("suite")


TEST_LIMIT_S = int(os.environ.get("SUPERMAP_TEST_LIMIT_S", "900"))
"""Seconds that one test may take, with its fixtures: several times what the slowest takes on a busy machine."""


def pytest_configure(config: pytest.Config) -> None:
    # A shell ignores SIGINT for a job (nohup ... &), and the children of tests would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})
    state = tempfile.mkdtemp(prefix="supermap-state-")  # what is kept of builds that failed
    config.add_cleanup(partial(shutil.rmtree, state, ignore_errors=True))
    os.environ["XDG_STATE_HOME"] = state
    config.addinivalue_line("markers", "sqlite_only(reason): about what only an SQLite file has")
    config.addinivalue_line("markers", "postgresql_only: about what only a PostgreSQL server has")
    databases.replay_migrations()
    if databases.on_postgresql():
        databases.start_server(config)
        databases.use_postgresql()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """No test hangs: every wait of the main thread ends when the test has taken too long."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"{item.nodeid} took more than {TEST_LIMIT_S} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(TEST_LIMIT_S)
    try:
        return (yield)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    absent = os.environ.get(databases.ABSENT)
    for item in items:
        sqlite_only = item.get_closest_marker("sqlite_only")
        if databases.on_postgresql() and absent:
            item.add_marker(pytest.mark.skip(reason=absent))
        elif databases.on_postgresql() and sqlite_only:
            item.add_marker(pytest.mark.skip(reason=sqlite_only.args[0]))
        elif not databases.on_postgresql() and item.get_closest_marker("postgresql_only"):
            item.add_marker(pytest.mark.skip(reason="runs in `make test-postgresql`"))
