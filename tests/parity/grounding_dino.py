"""Small Grounding DINO models of random weights: transformers' own, and exports of them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from transformers import (
    BertTokenizerFast,
    GroundingDinoConfig,
    GroundingDinoForObjectDetection,
    GroundingDinoImageProcessorPil,
    GroundingDinoProcessor,
    MMGroundingDinoConfig,
    MMGroundingDinoForObjectDetection,
)
from transformers.models.grounding_dino import modeling_grounding_dino
from transformers.models.mm_grounding_dino import modeling_mm_grounding_dino

from parity.exporting import Called, export, randomise

WORDS = (
    *("a", "chair", "plant", "trash", "can", "red", "coffee", "table", "office", "monitor", "cup", "book", "##s"),
    *("shelf", "desk", "lamp", "small", "white", "board"),
)
INPUTS = ("pixel_values", "input_ids", "token_type_ids", "attention_mask", "pixel_mask")
MASKING = (modeling_grounding_dino, modeling_mm_grounding_dino)
SIZE = {"shortest_edge": 132, "longest_edge": 200}
TRACED = (132, 164, 3)
"""An image of which each stage of the backbone has an odd side: a trace keeps whether it fills sides up."""
KINDS = {
    "grounding-dino": (GroundingDinoConfig, GroundingDinoForObjectDetection),
    "mm-grounding-dino": (MMGroundingDinoConfig, MMGroundingDinoForObjectDetection),
}


def vocabulary() -> list[str]:
    """BERT's numbers for what the model knows by number: [CLS] 101, [SEP] 102, "." 1012, "?" 1029."""
    words = [f"[unused{i}]" for i in range(1030)]
    for i, token in {0: "[PAD]", 100: "[UNK]", 101: "[CLS]", 102: "[SEP]", 103: "[MASK]", 1012: ".", 1029: "?"}.items():
        words[i] = token
    return [*words, *WORDS]


def make_processor(folder: Path) -> GroundingDinoProcessor:
    """transformers' own processor; its tokenizer.json and image format are written into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    tokenizer = BertTokenizerFast(vocab={word: i for i, word in enumerate(vocabulary())}, do_lower_case=True)
    images = GroundingDinoImageProcessorPil(size=SIZE)
    tokenizer.save_pretrained(folder)
    images.save_pretrained(folder)
    return GroundingDinoProcessor(images, tokenizer)


def make_model(kind: str, seed: int = 0) -> Any:
    """A model of a few thousand weights that has all parts of the published one."""
    config_type, model_type = KINDS[kind]
    config = config_type(
        backbone_config={
            "model_type": "swin",
            "image_size": 64,
            "embed_dim": 8,
            "depths": [1, 1, 1, 1],
            "num_heads": [1, 1, 2, 2],
            "window_size": 4,
            "out_indices": [2, 3, 4],
        },
        text_config={
            "model_type": "bert",
            "vocab_size": len(vocabulary()),
            "hidden_size": 32,
            "num_hidden_layers": 2,
            "num_attention_heads": 2,
            "intermediate_size": 64,
        },
        num_queries=40,
        d_model=32,
        encoder_layers=2,
        decoder_layers=2,
        encoder_attention_heads=4,
        decoder_attention_heads=4,
        encoder_ffn_dim=64,
        decoder_ffn_dim=64,
        disable_custom_kernels=True,
    )
    torch.manual_seed(seed)
    model = model_type(config).eval()
    randomise(model, seed, 0.6)
    return model


def export_model(
    model: Any,
    processor: Any,
    path: Path,
    phrases: Sequence[str],
    *,
    baked: bool = False,
    traced: tuple[int, ...] = TRACED,
) -> Path:
    """The model as an .onnx file, traced with some phrases; `baked`: with their mask built in, as by a trace of a loop
    over phrases.
    """
    image = np.random.default_rng(1).integers(0, 256, traced, np.uint8)
    inputs = processor(images=image, text=[list(phrases)], return_tensors="pt")
    given = {name: inputs[name] for name in INPUTS}

    def call(pixel_values: Any, input_ids: Any, token_type_ids: Any, attention_mask: Any, pixel_mask: Any) -> Any:
        made = model(
            pixel_values=pixel_values,
            input_ids=input_ids,
            token_type_ids=token_type_ids,
            attention_mask=attention_mask,
            pixel_mask=pixel_mask,
        )
        return made.logits, made.pred_boxes

    image_axes, text_axes = {0: "batch", 2: "height", 3: "width"}, {0: "batch", 1: "tokens"}
    dynamic = dict.fromkeys(INPUTS[1:4], text_axes)
    dynamic |= {"pixel_values": image_axes, "pixel_mask": {0: "batch", 1: "height", 2: "width"}}
    with masking(looped_masks if baked else exportable_masks), traced_shapes():
        export(path, Called(call, model), given, ("logits", "pred_boxes"), dynamic)
    (path.parent / "config.json").write_text(json.dumps({"max_text_len": 256}), encoding="utf-8")
    return path


@contextmanager
def masking(function: Any) -> Iterator[None]:
    """transformers with another function for the mask of the text."""
    name = "generate_masks_with_special_tokens_and_transfer_map"
    before = [getattr(module, name) for module in MASKING]
    for module in MASKING:
        setattr(module, name, function)
    try:
        yield
    finally:
        for module, own in zip(MASKING, before, strict=True):
            setattr(module, name, own)


@contextmanager
def traced_shapes() -> Iterator[None]:
    """torch with an `as_tensor` that keeps the shapes of feature maps traced: its own makes them constants, and the
    export would be right for images of one size only.
    """
    own = torch.as_tensor

    def as_tensor(data: Any, *arguments: Any, **more: Any) -> torch.Tensor:
        if isinstance(data, list) and data and isinstance(data[0], tuple | torch.Size):
            return torch.stack([torch.stack([own(side) for side in sides]) for sides in data]).to(torch.long)
        return own(data, *arguments, **more)

    torch.as_tensor = as_tensor
    try:
        yield
    finally:
        torch.as_tensor = own


def exportable_masks(input_ids: torch.Tensor, special_tokens: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """What transformers' own function gives, by operators that ONNX has: it has no running maximum."""
    special = is_special(input_ids, special_tokens)
    places = torch.cumsum(torch.ones_like(input_ids), dim=1) - 1
    length = places[:, -1:] + 1
    row, column = places.unsqueeze(2), places.unsqueeze(1)
    marked = special.unsqueeze(1)
    before = torch.where(marked & (column < row), column, torch.full_like(column, -1)).max(dim=2).values
    after = torch.where(marked & (column >= row), column, length.unsqueeze(2)).min(dim=2).values
    within = (after != 0) & (after != length - 1) & (after != length)
    mask = (row == column) | ((after.unsqueeze(2) == after.unsqueeze(1)) & within.unsqueeze(1))
    return mask, torch.where(within, places - before - 1, torch.zeros_like(places))


def looped_masks(input_ids: torch.Tensor, special_tokens: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """A loop over the delimiters of one text: a trace keeps as many turns of it as the traced text has delimiters."""
    length = input_ids.shape[1]
    every = torch.cumsum(torch.ones_like(input_ids), dim=1)
    mask = every.unsqueeze(2) == every.unsqueeze(1)
    positions = torch.zeros_like(input_ids)
    places = torch.nonzero(is_special(input_ids, special_tokens)[0])[:, 0]
    previous = places[0]
    for i in range(len(places)):
        place = places[i]
        if not (int(place) == 0 or int(place) == length - 1):
            numbers = torch.cumsum(torch.ones_like(input_ids[0]), dim=0) - 1
            inside = (numbers > previous) & (numbers <= place)
            mask = mask | (inside.unsqueeze(1) & inside.unsqueeze(0)).unsqueeze(0)
            positions = torch.where(inside.unsqueeze(0), (numbers - previous - 1).unsqueeze(0), positions)
        previous = place
    return mask, positions


def is_special(input_ids: torch.Tensor, special_tokens: Any) -> torch.Tensor:
    """(texts, tokens) whether a token parts phrases."""
    numbers = special_tokens.tolist() if isinstance(special_tokens, torch.Tensor) else special_tokens
    marks = [input_ids == number for number in numbers]
    return torch.stack(marks).any(dim=0)
