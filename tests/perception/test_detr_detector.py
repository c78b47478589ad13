"""The detector `onnx` with networks of queries: RT-DETR, D-FINE, RF-DETR."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.protocols import Detector
from supermap_onnx.detr import coco_category_names
from support.frames import CAMERA, frame
from support.tiny_onnx import write_constant_model

SIZE = (64, 64)
OF_RT_DETR = ("logits", "pred_boxes")
OF_RF_DETR = ("dets", "labels", "masks")


def make(path: Path, **more: object) -> Detector:
    return load_plugins().detectors.make("onnx", {"model": path, "threads": 1, "device": "cpu", **more}, None)


def queries(classes: int, *found: tuple[int, float, tuple[float, ...]]) -> tuple[np.ndarray, np.ndarray]:
    """Logits and boxes (centre and size, 0 to 1) of 10 queries, of which the first have found something."""
    logits, boxes = np.full((1, 10, classes), -9, np.float32), np.full((1, 10, 4), 0.5, np.float32)
    for i, (label, logit, box) in enumerate(found):
        logits[0, i, label], boxes[0, i] = logit, box
    return logits, boxes


def test_boxes_are_shares_of_the_image_and_scores_sigmoids(tmp_path: Path) -> None:
    outputs = queries(80, (41, 0.0, (0.5, 0.5, 0.25, 0.5)), (56, 2.0, (0.25, 0.25, 0.5, 0.5)))
    found = make(write_constant_model(tmp_path / "m.onnx", outputs, SIZE, names=OF_RT_DETR)).detect(frame())
    assert found is not None
    assert found.labels == ("chair", "cup")
    np.testing.assert_allclose(found.scores, [1 / (1 + np.exp(-2)), 0.5], atol=1e-6)
    np.testing.assert_allclose(found.boxes_xyxy, [[0, 0, 80, 60], [60, 30, 100, 90]], atol=1e-4)


def test_classes_by_cocos_numbers_have_its_names(tmp_path: Path) -> None:
    names = coco_category_names()
    assert (len(names), names[1], names[12], names[62], names[90]) == (91, "person", "", "chair", "toothbrush")
    logits, boxes = queries(91, (62, 1.0, (0.5, 0.5, 0.5, 0.5)), (12, 3.0, (0.5, 0.5, 0.2, 0.2)))
    masks = np.full((1, 10, 16, 16), -1, np.float32)
    masks[0, 0, :, :8] = 1
    model = write_constant_model(
        tmp_path / "m.onnx", (boxes, logits, masks), SIZE, names=OF_RF_DETR, input_name="input"
    )
    found = make(model).detect(frame())
    assert found is not None
    assert found.labels == ("chair",)
    mask = found.masks[0]
    assert mask is not None
    assert (mask.u0, mask.v0, mask.pixels.shape) == (0, 0, (CAMERA.height, CAMERA.width // 2))


def test_boxes_that_the_model_scales_itself_are_taken_as_they_are(tmp_path: Path) -> None:
    outputs = (
        np.array([[56, 41]], np.float32),
        np.array([[[10, 20, 30, 40], [0, 0, 50, 50]]], np.float32),
        np.array([[0.3, 0.9]], np.float32),
    )
    model = write_constant_model(tmp_path / "m.onnx", outputs, SIZE, names=("labels", "boxes", "scores"))
    found = make(model).detect(frame())
    assert found is not None
    assert found.labels == ("cup", "chair")
    np.testing.assert_allclose(found.boxes_xyxy, [[0, 0, 50, 50], [10, 20, 30, 40]])


def test_config_json_names_the_classes(tmp_path: Path) -> None:
    outputs = queries(2, (1, 1.0, (0.5, 0.5, 0.5, 0.5)))
    model = write_constant_model(tmp_path / "m.onnx", outputs, SIZE, names=OF_RT_DETR)
    with pytest.raises(DetectorError, match="does not name its 2 classes"):
        make(model)
    settings = {"model_type": "rt_detr", "id2label": {"0": "mug", "1": "stool"}}
    (tmp_path / "config.json").write_text(json.dumps(settings), encoding="utf-8")
    found = make(model).detect(frame())
    assert found is not None
    assert found.labels == ("stool",)


def test_the_last_class_of_a_detr_is_no_object(tmp_path: Path) -> None:
    outputs = queries(3, (0, 5.0, (0.5, 0.5, 0.5, 0.5)), (2, 20.0, (0.5, 0.5, 0.2, 0.2)))
    model = write_constant_model(tmp_path / "m.onnx", outputs, SIZE, names=OF_RT_DETR)
    settings = {"model_type": "detr", "id2label": {"0": "mug", "1": "stool"}}
    (tmp_path / "config.json").write_text(json.dumps(settings), encoding="utf-8")
    found = make(model, score_floor=0.4).detect(frame())
    assert found is not None
    assert found.labels[0] == "mug"
    assert found.scores[0] > 0.99


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e30])
def test_outputs_that_are_no_numbers_are_one_line(tmp_path: Path, number: float) -> None:
    logits, boxes = queries(80)
    boxes[0, 3, 2] = number
    with pytest.raises(DetectorError, match=r"NaN or infinity.*m\.onnx"):
        make(write_constant_model(tmp_path / "m.onnx", (logits, boxes), SIZE, names=OF_RT_DETR))


def test_outputs_that_do_not_fit_are_one_line(tmp_path: Path) -> None:
    logits, boxes = queries(80)
    with pytest.raises(DetectorError, match=r"not understood.*m\.onnx"):
        make(write_constant_model(tmp_path / "m.onnx", (logits[:, :4], boxes), SIZE, names=OF_RT_DETR))
