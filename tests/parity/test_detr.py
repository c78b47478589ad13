"""RT-DETR, D-FINE and RF-DETR: our whole path against transformers' processor, model and post-processing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs torch: pip install -e '.[perception-tests]'")
pytest.importorskip("transformers", reason="needs transformers: pip install -e '.[perception-tests]'")

import torch

from parity import detr
from parity.comparing import Difference, compare, mask_overlap, picture, together
from supermap_cli.inference.masks import full_mask
from supermap_onnx import OnnxOptions
from supermap_onnx.detector import open_detector_model
from supermap_onnx.detr import DetrDetector

KINDS = ("rt-detr", "d-fine", "rf-detr", "rf-detr-seg")
SHAPES = ((96, 150), (150, 96), (480, 640))


def make_detector(path: Path, **more: Any) -> DetrDetector:
    options = OnnxOptions(model=path, threads=1, device="cpu", **more)
    return DetrDetector(open_detector_model(options), options)


def differences(kind: str, folder: Path) -> Difference:
    """All answers of the queries, best first, as transformers gives them: one for each of the best query and class."""
    torch.set_num_threads(1)
    model, processor = detr.make_model(kind)
    detector = make_detector(detr.export_model(kind, model, processor, folder / "model.onnx"))
    results = []
    for shape in SHAPES:
        image = picture(sum(shape), *shape)
        with torch.no_grad():
            outputs = model(**processor(images=image, return_tensors="pt"))
        (theirs,) = processor.post_process_object_detection(outputs, threshold=0.0, target_sizes=[shape])
        ours = detector.answers(image)
        order = np.argsort(-ours.class_scores, axis=None, kind="stable")[: len(theirs["scores"])]
        queries, classes = np.unravel_index(order, ours.class_scores.shape)
        names = [detector._names[i] for i in classes]
        labels = [detr.NAMES[int(label)] for label in theirs["labels"]]
        results.append(
            compare(
                (ours.boxes_xyxy[queries], ours.class_scores[queries, classes], names),
                (theirs["boxes"].numpy(), theirs["scores"].numpy(), labels),
            )
        )
        if ours.mask_logits is not None:
            results.append(masks(ours.mask_logits, outputs.pred_masks[0], shape))
    return together(results)


def masks(ours: Any, theirs: torch.Tensor, shape: tuple[int, int]) -> Difference:
    large = torch.nn.functional.interpolate(theirs[None], size=shape, mode="bilinear", align_corners=False)[0] > 0
    overlaps = [mask_overlap(full_mask(one, shape), other.numpy()) for one, other in zip(ours, large, strict=True)]
    return Difference(0, 0.0, 0.0, 0, len(overlaps), min(overlaps))


@pytest.mark.parametrize("kind", KINDS)
def test_boxes_labels_scores_and_masks_are_those_of_transformers(kind: str, tmp_path: Path) -> None:
    difference = differences(kind, tmp_path)
    difference.check()
    assert difference.boxes >= 30
    assert (difference.masks > 0) == (kind == "rf-detr-seg")
