"""SAM 2: our whole path against transformers' processor, model and post-processing, with boxes as prompts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs torch: pip install -e '.[perception-tests]'")
pytest.importorskip("transformers", reason="needs transformers: pip install -e '.[perception-tests]'")

import torch

from parity import sam2
from parity.comparing import Difference, mask_overlap, picture, together
from supermap_cli.inference.masks import full_mask
from supermap_sam import Sam2Options
from supermap_sam.sam2 import Sam2

UNDECIDED = 1e-4
"""Logits closer to 0 are pixels that rounding decides: those of both networks differ by up to 3e-5."""
SHAPES = ((96, 150), (150, 96), (480, 640))


def differences(folder: Path, boxes: int = 40) -> Difference:
    """The mask of every box that the model takes for its best, and the IoU that it expects."""
    torch.set_num_threads(1)
    model, processor = sam2.make_model()
    encoder, decoder = sam2.export_model(model, folder)
    segmenter = Sam2(Sam2Options(encoder=encoder, decoder=decoder, threads=1, device="cpu"))
    results = []
    for shape in SHAPES:
        image = picture(sum(shape), *shape)
        rng = np.random.default_rng(0)
        corners = np.sort(rng.uniform(0, 1, (boxes, 2, 2)), axis=1) * shape[::-1]
        prompts = corners.reshape(-1, 4).astype(np.float32)
        logits, ious = segmenter.mask_logits(image, prompts)
        inputs = processor(images=image, return_tensors="pt")
        scale = np.array([sam2.SIDE / shape[1], sam2.SIDE / shape[0]] * 2, np.float32)
        with torch.no_grad():
            outputs = model(pixel_values=inputs["pixel_values"], input_boxes=torch.tensor(prompts * scale)[None])
        masks = torch.nn.functional.interpolate(outputs.pred_masks[0], shape, mode="bilinear", align_corners=False)
        best = outputs.iou_scores[0].argmax(dim=1)
        overlaps = []
        for i, mask in enumerate(logits):
            theirs = masks[i, best[i]].numpy()
            decided = np.abs(theirs) > UNDECIDED
            overlaps.append(mask_overlap(full_mask(mask, shape) & decided, (theirs > 0) & decided))
            assert decided.mean() > 0.9
        expected = outputs.iou_scores[0].max(dim=1).values.numpy()
        results.append(Difference(0, 0.0, float(np.abs(ious - expected).max()), 0, len(overlaps), min(overlaps)))
    return together(results)


def test_the_masks_of_boxes_are_those_of_transformers(tmp_path: Path) -> None:
    difference = differences(tmp_path)
    difference.check()
    assert difference.masks == 3 * 40
