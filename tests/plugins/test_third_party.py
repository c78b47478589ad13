"""The example plugin, installed as its author would ship it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "supermap-example-detector"

USE_IT = """
import json, sys
import numpy as np
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.types.sensing import CameraFrame

heavy = sorted({"cv2", "onnxruntime", "scipy", "open3d", "rosbags"} & set(sys.modules))
plugins = load_plugins()
loaded_heavy = sorted({"cv2", "onnxruntime", "scipy", "open3d", "rosbags"} & set(sys.modules))
detector = plugins.detectors.make("red", {"min_area_px": "50", "label": "extinguisher"}, None)
rgb = np.full((60, 80, 3), 120, np.uint8)
rgb[10:30, 20:40] = (220, 20, 20)
rgb[50:53, 5:8] = (220, 20, 20)
found = detector.detect(CameraFrame(7, "camera", rgb, None, PinholeCamera(80, 60, 60, 60, 40, 30), np.eye(4)))
print(json.dumps({
    "broken": [plugin.error for plugin in plugins.broken],
    "origin": plugins.detectors.get("red").origin,
    "boxes": found.boxes_xyxy.tolist(),
    "labels": found.labels,
    "mask": int(found.masks[0].pixels.sum()),
    "heavy": loaded_heavy,
}))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example installed into it, as pip does it."""
    source, target = tmp_path_factory.mktemp("source") / "example", tmp_path_factory.mktemp("target")
    shutil.copytree(EXAMPLE, source, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"),
            *("--disable-pip-version-check", "--target", str(target), str(source)),
        ],
        check=True,
        timeout=300,
    )
    return target


def python(folder: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, *arguments],
        check=True,
        capture_output=True,
        text=True,
        env=environment,
        cwd=folder,
        timeout=120,
    )
    return done.stdout


def test_a_third_partys_detector_is_found_and_used(installed: Path) -> None:
    answer = json.loads(python(installed, "-c", USE_IT))
    assert answer == {
        "broken": [],
        "origin": "supermap-example-detector (plugin red)",
        "boxes": [[20, 10, 40, 30]],
        "labels": ["extinguisher"],
        "mask": 400,
        "heavy": [],
    }


def test_the_command_line_lists_it(installed: Path) -> None:
    listed = json.loads(python(installed, "-m", "supermap_cli.main", "plugins", "--json"))
    assert "supermap-example-detector" in {plugin["distribution"] for plugin in listed["plugins"]}


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("import a_module_that_is_not_there", "ModuleNotFoundError"),
        ("def broken(:", "SyntaxError"),
        ("from supermap_cli import hookimpl\n@hookimpl\ndef register_detector(register): pass", "unknown hook"),
        ("from supermap_cli import hookimpl\n@hookimpl\ndef register_detectors(registry): pass", "registry"),
    ],
)
def test_a_broken_distribution_is_reported_and_the_rest_works(tmp_path: Path, code: str, error: str) -> None:
    (tmp_path / "broken_plugin.py").write_text(code, encoding="utf-8")
    metadata = tmp_path / "broken_plugin-1.2.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-plugin\nVersion: 1.2\n", encoding="utf-8")
    (metadata / "entry_points.txt").write_text("[supermap]\nbroken = broken_plugin\n", encoding="utf-8")
    listed = json.loads(python(tmp_path, "-m", "supermap_cli.main", "plugins", "--json"))
    (broken,) = listed["broken"]
    assert (broken["name"], broken["distribution"], broken["version"]) == ("broken", "broken-plugin", "1.2")
    assert error in broken["error"]
    assert {"onnx", "recorded"} <= {plugin["name"] for plugin in listed["plugins"]}
