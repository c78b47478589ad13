"""Detectors of any words: Grounding DINO and its kin. They need the extra `open-vocabulary`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from supermap_cli import Options, Register, hookimpl

if TYPE_CHECKING:
    from supermap_cli.protocols import Detector, Recording

PREFERENCE = -10
"""Where the user names no detector, one that needs no words is taken. Chosen."""


class OpenVocabularyOptions(Options):
    """Options that the detectors of any words share."""

    model: Path | None = Field(
        default=None,
        description="the model's .onnx file, with its tokenizer.json in the same folder or the one above; default: the "
        "folder of the detector's name in SuperMap's user data folder, under models/",
    )
    prompt: str | None = Field(default=None, description="what to look for: words with commas between them")
    labels: Path | None = Field(default=None, description="text file with what to look for, a word on each line")
    iou: float = Field(
        default=0.7, gt=0, le=1, description="overlap above which the weaker of two boxes of one word goes"
    )
    max_detections: int = Field(default=200, ge=1, description="greatest number of detections of an image")
    threads: int = Field(default=0, ge=0, description="threads of onnxruntime, 0 = one for each core")
    device: Literal["auto", "cpu", "cuda", "tensorrt", "openvino", "coreml", "directml"] = Field(
        default="auto", description="where the model runs; auto: a GPU where this onnxruntime has one"
    )


class GroundingDinoOptions(OpenVocabularyOptions):
    """Options of the detector `grounding-dino`.

    The default of `score_floor` is the threshold of transformers' `post_process_grounded_object_detection`.
    """

    score_floor: float = Field(default=0.25, ge=0.001, le=1, description="detections below this score are left out")
    one_phrase: bool = Field(
        default=False,
        description="ask for one word a pass, also where the model takes several: slower, the same result",
    )


@hookimpl
def register_detectors(register: Register) -> None:
    """The detector `grounding-dino`."""
    register("grounding-dino", _make_grounding_dino, GroundingDinoOptions, preference=PREFERENCE)


def _make_grounding_dino(options: GroundingDinoOptions, recording: Recording) -> Detector:  # noqa: ARG001 - any image
    from supermap_open_vocabulary.grounding_dino import GroundingDino  # noqa: PLC0415 - loads onnxruntime

    return GroundingDino(options)
