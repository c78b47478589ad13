"""Detection by an ONNX model with a fixed set of classes: YOLOX, YOLOv8 and later, RT-DETR, D-FINE, RF-DETR."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Detector, Recording


class OnnxOptions(Options):
    """Options of the detector `onnx`. The default `iou` lies between YOLOX's (0.45) and YOLOv8/11's (0.7). Chosen."""

    model: Path | None = Field(
        default=None,
        description="the model's .onnx file, or its name in `supermap models list`; default: detector.onnx in "
        "the models folder, else a detector that was pulled",
    )
    labels: Path | None = Field(
        default=None, description="text file with a class name on each line; default: the model's own names, else COCO"
    )
    score_floor: float = Field(default=0.1, ge=0.001, le=1, description="detections below this score are left out")
    iou: float = Field(
        default=0.6, gt=0, le=1, description="overlap above which the weaker of two boxes of one class goes"
    )
    max_detections: int = Field(default=200, ge=1, description="greatest number of detections of an image")
    threads: int = Field(default=0, ge=0, description="threads of onnxruntime, 0 = one for each core")
    device: Literal["auto", "cpu", "cuda", "tensorrt", "openvino", "coreml", "directml"] = Field(
        default="auto", description="where the model runs; auto: a GPU where this onnxruntime has one"
    )


@hookimpl
def register_detectors(register: Register) -> None:
    """The detector `onnx`."""
    register("onnx", _make_detector, OnnxOptions)


def _make_detector(options: OnnxOptions, recording: Recording) -> Detector:  # noqa: ARG001 - it looks at any image
    from supermap_onnx.detector import OnnxDetector, open_detector_model  # noqa: PLC0415 - loads onnxruntime
    from supermap_onnx.detr import DetrDetector, is_detr  # noqa: PLC0415 - loads onnxruntime

    model = open_detector_model(options)
    return DetrDetector(model, options) if is_detr(model) else OnnxDetector(options, model)
