"""What several commands are tried on."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.cli import supermap


@pytest.fixture(scope="session")
def tiny_world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scenario tiny, seed 2, with a recording of three seconds; no test changes it."""
    folder = tmp_path_factory.mktemp("tiny")
    result = supermap("simulate", "tiny", "--seed", "2", "--seconds", "3", "--out", folder)
    assert result.exit_code == 0, result.output
    return folder
