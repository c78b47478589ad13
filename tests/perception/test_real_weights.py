"""Two published models on frames of a real kitchen: what they found when the expectation was recorded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.types.detections import Detections
from supermap_onnx import OnnxOptions
from supermap_onnx.detector import OnnxDetector
from support.frames import frame, shared_file

RECORDED = Path(__file__).with_name("redkitchen_detections.json")
TOPIC = "/camera/color/image_raw/compressed"
CAMERA = PinholeCamera(640, 480, 585, 585, 320, 240)
FRAMES = (0, 60, 120)
SURE = 0.35


def pictures(recording: Path) -> list[NDArray[np.uint8]]:
    """The colour images whose numbers are `FRAMES`."""
    found = []
    with recording.open("rb") as file:
        for number, message in enumerate(make_reader(file).iter_messages(topics=[TOPIC])):
            if number in FRAMES:
                data = message[2].data
                image = cv2.imdecode(np.frombuffer(data[data.index(b"\xff\xd8\xff") :], np.uint8), cv2.IMREAD_COLOR)
                found.append(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
            if number > FRAMES[-1]:
                break
    return found


def described(found: Detections) -> list[dict[str, Any]]:
    """The sure detections: label, score, box in pixels, pixels of the mask."""
    return [
        {
            "label": label,
            "score": round(float(score), 3),
            "box": [round(float(side), 1) for side in box],
            "mask_px": None if mask is None else int(mask.pixels.sum()),
        }
        for label, score, box, mask in zip(found.labels, found.scores, found.boxes_xyxy, found.masks, strict=True)
        if score >= SURE
    ]


@pytest.mark.parametrize("model", ["yolox_nano", "yolo11n-seg"])
def test_a_published_model_finds_in_the_kitchen_what_it_found_before(model: str) -> None:
    path, recording = shared_file(f"models/{model}.onnx"), shared_file("data/redkitchen.mcap")
    detector = OnnxDetector(OnnxOptions(model=path, threads=1, device="cpu"))
    expected = json.loads(RECORDED.read_text(encoding="utf-8"))[model]
    for image, recorded in zip(pictures(recording), expected, strict=True):
        found = described(detector.detect(frame(image, camera=CAMERA)))
        assert [each["label"] for each in found] == [each["label"] for each in recorded]
        for now, then in zip(found, recorded, strict=True):
            assert now["score"] == pytest.approx(then["score"], abs=0.01)
            assert now["box"] == pytest.approx(then["box"], abs=1.0)
            if then["mask_px"] is not None:
                assert now["mask_px"] == pytest.approx(then["mask_px"], rel=0.03)
