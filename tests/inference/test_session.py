"""Models on devices."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import numpy as np
import onnxruntime
import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.inference.session import PROVIDERS, DeviceName, OnnxModel
from support.tiny_onnx import write_constant_model

IMAGE = np.zeros((1, 3, 8, 8), np.float32)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return write_constant_model(tmp_path / "m.onnx", [np.arange(6, dtype=np.float32).reshape(1, 6)], (8, 8))


def open_model(path: Path, device: str) -> OnnxModel:
    return OnnxModel(path, option="onnx.model", threads=1, device=device)


def test_every_device_has_a_provider() -> None:
    assert set(get_args(DeviceName)) == {"auto", *PROVIDERS}


@pytest.mark.parametrize("device", ["auto", "cpu", "cuda", "tensorrt", "openvino", "coreml", "directml"])
def test_a_device_that_is_not_there_is_said_and_the_cpu_used(
    model: Path, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CPUExecutionProvider"])
    opened = open_model(model, device)
    assert opened.device == "cpu"
    np.testing.assert_array_equal(opened.run({"images": IMAGE})["output0"], [[0, 1, 2, 3, 4, 5]])
    if device in {"auto", "cpu"}:
        assert opened.warnings == ()
    else:
        assert f"runs on the CPU, not on {device}: this onnxruntime lacks it" in opened.warnings[0]


def test_a_device_that_does_not_start_is_said_and_the_cpu_used(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider", "CPUExecutionProvider"]
    )
    opened = open_model(model, "auto")
    assert opened.device == "cpu"
    assert "not on cuda" in opened.warnings[0]


def test_an_input_of_another_shape_is_one_line_with_the_cure(model: Path) -> None:
    with pytest.raises(DetectorError, match=r"does not run.*m\.onnx.*export it for 8x8"):
        open_model(model, "cpu").run({"images": np.zeros((1, 3, 9, 9), np.float32)}, cure="export it for 8x8")
