"""The picture that proves an answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from supermap_cli.errors import QueryError
from supermap_cli.types.memory import MapDelta
from support import memories as m
from support.cli import supermap


def jpeg(value: int) -> bytes:
    return cv2.imencode(".jpg", np.full((8, 8, 3), value, np.uint8))[1].tobytes()


@pytest.fixture
def db(tmp_path: Path) -> Path:
    """A cup that was seen twice, the second time with a better score; a book without pictures."""
    seen = [replace(m.observation(1, at, "cup", score), crop_jpeg=jpeg(value)) for at, score, value in
            ((1, 0.6, 50), (9, 0.9, 200))]  # fmt: skip
    delta = MapDelta(
        m.keyframes([1, 9]),
        tuple(seen),
        (m.instance(1, "cup", seen=(1, 9)), m.instance(2, "book", seen=(1, 9))),
        (m.state(1, 0, (1, 9), label="cup"), m.state(2, 0, (1, 9), (0, 5, 0), label="book")),
    )
    return m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))


def test_the_best_crop_is_written(db: Path, tmp_path: Path) -> None:
    result = supermap("query", "where is the cup", "--db", db, "--crop", tmp_path / "cup.jpg")
    assert result.exit_code == 0
    assert (tmp_path / "cup.jpg").read_bytes() == jpeg(200)
    assert "cup-1, seen 2026-01-05T09:00:09.0Z (observation 2)" in result.stdout


def test_without_a_picture_there_is_an_error_and_no_file(db: Path, tmp_path: Path) -> None:
    result = supermap("query", "where is the book", "--db", db, "--crop", tmp_path / "book.jpg")
    assert isinstance(result.exception, QueryError)
    assert not (tmp_path / "book.jpg").exists()


def test_nothing_but_a_picture_is_written_over(db: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.jpg").write_text("notes")
    assert supermap("query", "cup", "--db", db, "--crop", tmp_path / "notes.jpg").exit_code == 1
    assert (tmp_path / "notes.jpg").read_text() == "notes"
