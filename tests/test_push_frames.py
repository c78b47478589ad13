"""The example that pushes frames: numpy arrays in, a map out."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from support import databases

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "push_frames.py"


def test_the_example_makes_a_map(tmp_path: Path) -> None:
    db = tmp_path / "map.db"
    subprocess.run([sys.executable, str(EXAMPLE), str(db)], check=True, timeout=120)
    ((label, x, y, z),) = databases.query(db, "SELECT label, center_x, center_y, center_z FROM instance")
    assert label == "suitcase"
    assert abs(x - 2.0) < 0.1
    assert abs(y) < 0.1
    assert abs(z - 0.35) < 0.1


def test_it_stays_short() -> None:
    body = EXAMPLE.read_text().split("def look")[1]
    assert len(body.splitlines()) <= 42
