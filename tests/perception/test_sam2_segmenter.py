"""The segmenter `sam2`: files and contracts. Its masks are compared with transformers' in `tests/parity`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.plugin_manager import load_plugins
from supermap_sam import Sam2Options
from supermap_sam.sam2 import Sam2
from support.tiny_onnx import write_constant_model

NAMES = ("image_embed", "high_res_feats_0", "high_res_feats_1")


def write(path: Path) -> Path:
    tensors = [np.zeros((1, 4, side, side), np.float32) for side in (4, 16, 8)]
    return write_constant_model(path, tensors, (64, 64), names=NAMES, input_name="image")


def test_missing_weights_say_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(DetectorError, match=r"no weights for its encoder.*sam2\.encoder=PATH"):
        Sam2(Sam2Options())
    with pytest.raises(DetectorError, match=r"no weights for its decoder.*sam2\.decoder=PATH"):
        Sam2(Sam2Options(encoder=write(tmp_path / "encoder.onnx")))


def test_a_model_of_another_kind_is_refused_with_its_tensors(tmp_path: Path) -> None:
    write(tmp_path / "encoder.onnx")
    write(tmp_path / "decoder.onnx")
    with pytest.raises(DetectorError, match=r"no SAM 2: image \[1, 3, 64, 64\].*decoder\.onnx"):
        Sam2(Sam2Options(encoder=tmp_path / "encoder.onnx"))


def test_segmenters_and_detectors_that_need_weights_are_not_taken_unasked() -> None:
    plugins = load_plugins()
    assert plugins.segmenters.choose({"color", "depth"}) == "depth"
    assert plugins.detectors.choose({"color", "depth"}) == "onnx"
    assert {"grounding-dino", "onnx"} <= set(plugins.detectors.names())
