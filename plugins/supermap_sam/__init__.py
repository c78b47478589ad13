"""Masks for boxes that came without, by SAM 2."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Recording, Segmenter

PREFERENCE = -10
"""Where the user names no segmenter, one that needs no weights is taken. Chosen."""


class Sam2Options(Options):
    """Options of the segmenter `sam2`. The default of `min_iou` leaves out what SAM 2 itself takes for a miss."""

    encoder: Path | None = Field(
        default=None,
        description="the image encoder's .onnx file; default: the one with `encoder` in its name in the folder sam2 in "
        "SuperMap's user data folder, under models/",
    )
    decoder: Path | None = Field(
        default=None, description="the mask decoder's .onnx file; default: the one with `decoder` beside the encoder"
    )
    min_iou: float = Field(
        default=0.5, ge=0, le=1, description="masks whose IoU the model expects to be less are left out"
    )
    threads: int = Field(default=0, ge=0, description="threads of onnxruntime, 0 = one for each core")
    device: Literal["auto", "cpu", "cuda", "tensorrt", "openvino", "coreml", "directml"] = Field(
        default="auto", description="where the model runs; auto: a GPU where this onnxruntime has one"
    )


@hookimpl
def register_segmenters(register: Register) -> None:
    """The segmenter `sam2`."""
    register("sam2", _make_sam2, Sam2Options, preference=PREFERENCE)


def _make_sam2(options: Sam2Options, recording: Recording) -> Segmenter:  # noqa: ARG001 - it looks at any image
    from supermap_sam.sam2 import Sam2  # noqa: PLC0415 - loads onnxruntime

    return Sam2(options)
