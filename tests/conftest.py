"""What holds for all tests."""

import os

import pytest
from hypothesis import settings

from support import databases

settings.register_profile("suite", deadline=None, derandomize="CI" in os.environ)  # a busy machine is no failure
settings.load_profile("suite")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "sqlite_only(reason): about what only an SQLite file has")
    config.addinivalue_line("markers", "postgresql_only: about what only a PostgreSQL server has")
    databases.replay_migrations()
    if databases.on_postgresql():
        databases.start_server(config)
        databases.use_postgresql()


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
