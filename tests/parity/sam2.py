"""A small SAM 2 of random weights: transformers' own, and exports of its encoder and its decoder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from transformers import RTDetrImageProcessorPil, Sam2Config, Sam2Model

from parity.exporting import Called, export, randomise

SIDE = 128
CELLS = SIDE // 16


def make_model(seed: int = 0) -> tuple[Any, Any]:
    """A model and a processor that stretches and normalises images as SAM 2's own does, which needs torchvision."""
    backbone = {
        "model_type": "sam2_hiera_det_model",
        "hidden_size": 8,
        "image_size": [SIDE, SIDE],
        "blocks_per_stage": [1, 2, 2, 1],
        "embed_dim_per_stage": [8, 16, 32, 64],
        "num_attention_heads_per_stage": [1, 2, 2, 4],
        "window_size_per_stage": [4, 4, 4, 4],
        "global_attention_blocks": [4],
    }
    vision = {
        "backbone_config": backbone,
        "backbone_channel_list": [64, 32, 16, 8],
        "backbone_feature_sizes": [[4 * CELLS, 4 * CELLS], [2 * CELLS, 2 * CELLS], [CELLS, CELLS]],
        "fpn_hidden_size": 32,
    }
    config = Sam2Config(
        vision_config=vision,
        prompt_encoder_config={"hidden_size": 32, "image_size": SIDE},
        mask_decoder_config={"hidden_size": 32, "mlp_dim": 64, "num_attention_heads": 4, "iou_head_hidden_dim": 32},
    )
    torch.manual_seed(seed)
    model = Sam2Model(config).eval()
    randomise(model, seed, 1.0)
    return model, RTDetrImageProcessorPil(size={"height": SIDE, "width": SIDE}, do_normalize=True)


def export_model(model: Any, folder: Path) -> tuple[Path, Path]:
    """Encoder and decoder with the published exports' names."""

    def encode(image: Any) -> Any:
        high_0, high_1, embedding = model.get_image_embeddings(image)
        return embedding, high_0, high_1

    def decode(embedding: Any, high_0: Any, high_1: Any, points: Any, labels: Any) -> Any:
        made = model(
            image_embeddings=[high_0, high_1, embedding],
            input_points=points.unsqueeze(0),
            input_labels=labels.unsqueeze(0).to(torch.int32),
        )
        return made.pred_masks[0], made.iou_scores[0]

    image = torch.rand(1, 3, SIDE, SIDE)
    names = ("image_embed", "high_res_feats_0", "high_res_feats_1")
    encoder = export(folder / "encoder.onnx", Called(encode, model), {"image": image}, names)
    with torch.no_grad():
        features = encode(image)
    inputs = {
        **dict(zip(names, features, strict=True)),
        "point_coords": torch.rand(3, 2, 2) * SIDE,
        "point_labels": torch.tensor([[2.0, 3.0]] * 3),
    }
    dynamic = {name: {0: "boxes"} for name in ("point_coords", "point_labels", "masks", "iou_predictions")}
    decoder = export(folder / "decoder.onnx", Called(decode, model), inputs, ("masks", "iou_predictions"), dynamic)
    return encoder, decoder
