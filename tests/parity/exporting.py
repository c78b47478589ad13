"""Exports torch modules to ONNX, with the names that published exports have."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

OPSET = 17


class Called(torch.nn.Module):
    """A module whose inputs are given in an order and whose outputs are a tuple, as an export needs them."""

    def __init__(self, call: Any, *modules: torch.nn.Module) -> None:
        super().__init__()
        self.call = call
        self.parts = torch.nn.ModuleList(modules)

    def forward(self, *inputs: torch.Tensor) -> Any:
        return self.call(*inputs)


def export(
    path: Path,
    module: torch.nn.Module,
    inputs: Mapping[str, torch.Tensor],
    outputs: Sequence[str],
    dynamic: Mapping[str, Mapping[int, str]] | None = None,
) -> Path:
    """The module as an .onnx file, traced."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module.eval(),
            tuple(inputs.values()),
            str(path),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes={name: dict(axes) for name, axes in (dynamic or {}).items()},
            opset_version=OPSET,
            dynamo=False,
        )
    return path


def randomise(module: torch.nn.Module, seed: int, spread: float) -> None:
    """Weights far enough from 0 that outputs differ from query to query: untrained ones give nearly one answer."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, weights in module.named_parameters():
            if weights.dim() > 1 and "embeddings" not in name:
                weights.normal_(0, spread / weights.shape[1] ** 0.5, generator=generator)
