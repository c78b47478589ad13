"""Small RT-DETR, D-FINE and RF-DETR models of random weights: transformers' own, and exports of them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from transformers import (
    DFineConfig,
    DFineForObjectDetection,
    RfDetrConfig,
    RfDetrForInstanceSegmentation,
    RfDetrForObjectDetection,
    RTDetrConfig,
    RTDetrForObjectDetection,
    RTDetrImageProcessorPil,
)

from parity.exporting import Called, export, randomise

SIDE = 128
NAMES = dict(enumerate(("cup", "chair", "book", "table", "lamp")))
RESNET = {
    "model_type": "rt_detr_resnet",
    "embedding_size": 8,
    "hidden_sizes": [8, 16, 24, 32],
    "depths": [1, 1, 1, 1],
    "layer_type": "basic",
    "hidden_act": "relu",
    "out_features": ["stage2", "stage3", "stage4"],
}
DECODER: dict[str, Any] = {
    "d_model": 32,
    "num_queries": 30,
    "decoder_layers": 2,
    "decoder_ffn_dim": 32,
    "decoder_in_channels": [32, 32, 32],
    "encoder_hidden_dim": 32,
    "encoder_in_channels": [16, 24, 32],
    "encoder_ffn_dim": 32,
    "encoder_attention_heads": 4,
    "decoder_attention_heads": 4,
}
DINOV2 = {
    "model_type": "rf_detr_dinov2",
    "hidden_size": 32,
    "num_hidden_layers": 4,
    "num_attention_heads": 2,
    "image_size": SIDE,
    "patch_size": 16,
    "num_windows": 2,
    "out_features": ["stage2", "stage4"],
}


def make_model(kind: str, seed: int = 0) -> tuple[Any, Any]:
    """A model and transformers' processor for it. RF-DETR's own needs torchvision, and does what RT-DETR's does with
    normalised images: the best of all queries and classes.
    """
    torch.manual_seed(seed)
    size = {"height": SIDE, "width": SIDE}
    processor: Any = RTDetrImageProcessorPil(size=size)
    if kind == "rt-detr":
        model: Any = RTDetrForObjectDetection(RTDetrConfig(backbone_config=dict(RESNET), id2label=NAMES, **DECODER))
    elif kind == "d-fine":
        model = DFineForObjectDetection(DFineConfig(backbone_config=dict(RESNET), id2label=NAMES, **DECODER))
    else:
        config = RfDetrConfig(
            backbone_config=dict(DINOV2),
            id2label=NAMES,
            d_model=32,
            num_queries=30,
            decoder_ffn_dim=32,
            decoder_layers=2,
            decoder_self_attention_heads=4,
            decoder_cross_attention_heads=4,
            intermediate_size=32,
        )
        model = (RfDetrForInstanceSegmentation if kind == "rf-detr-seg" else RfDetrForObjectDetection)(config)
        processor = RTDetrImageProcessorPil(size=size, do_normalize=True)
    model = model.eval()
    randomise(model, seed, 0.5 if kind == "d-fine" else 1.0)
    return model, processor


@contextmanager
def same_size_kept() -> Iterator[None]:
    """torch with an `interpolate` that leaves out what does nothing: ONNX has no bicubic one with smoothing, which
    RF-DETR has for position embeddings of another size than the image's.
    """
    own = torch.nn.functional.interpolate

    def interpolate(data: torch.Tensor, size: Any = None, *arguments: Any, **more: Any) -> torch.Tensor:
        if size is not None and tuple(map(int, size)) == tuple(data.shape[-2:]):
            return data
        return own(data, size, *arguments, **more)

    torch.nn.functional.interpolate = interpolate
    try:
        yield
    finally:
        torch.nn.functional.interpolate = own


def export_model(kind: str, model: Any, processor: Any, path: Path) -> Path:
    """The model with the published export's names: Hugging Face's, or RF-DETR's own."""
    own_names = kind.startswith("rf-detr")
    outputs = ("dets", "labels") if own_names else ("logits", "pred_boxes")
    masks = ("masks",) if kind == "rf-detr-seg" else ()

    def call(pixel_values: Any) -> Any:
        made = model(pixel_values=pixel_values)
        boxes = (made.pred_boxes, made.logits) if own_names else (made.logits, made.pred_boxes)
        return (*boxes, made.pred_masks) if masks else boxes

    name = "input" if own_names else "pixel_values"
    with same_size_kept():
        export(path, Called(call, model), {name: torch.rand(1, 3, SIDE, SIDE)}, (*outputs, *masks))
    processor.save_pretrained(path.parent)
    labels = {str(number): label for number, label in NAMES.items()}
    settings = {"model_type": model.config.model_type, "id2label": labels}
    (path.parent / "config.json").write_text(json.dumps(settings), encoding="utf-8")
    return path
