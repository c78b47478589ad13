"""Detection by an ONNX model of the YOLOX or the YOLOv8/11 family."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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


@hookimpl
def register_detectors(register: Register) -> None:
    """The detector `onnx`."""
    register("onnx", _make_detector, OnnxOptions)


def _make_detector(options: OnnxOptions, recording: Recording) -> Detector:  # noqa: ARG001 - it looks at any image
    from supermap_onnx.detector import OnnxDetector  # noqa: PLC0415 - loads onnxruntime

    return OnnxDetector(options)
