"""SAM 2 and 2.1 (Ravi et al. 2024) with boxes as prompts; an image is embedded once for all its boxes.

Encoder: `image` (1, 3, 1024, 1024) ImageNet-normalised -> `image_embed`, `high_res_feats_0`, `high_res_feats_1`.
Decoder: these, `point_coords` (boxes, points, 2) pixels of the encoder's input, `point_labels` (boxes, points) where a
box's corners are 2 and 3, `mask_input` and `has_mask_input` -> masks (boxes, k, 256, 256) logits, `iou_predictions`
(boxes, k). Source: `SAM2ImagePredictor` of facebookresearch/sam2, `Sam2Processor` of transformers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.inference.images import ImageFormat
from supermap_cli.inference.masks import full_mask
from supermap_cli.inference.session import OnnxModel, TensorDescription, sides
from supermap_cli.types.detections import Detections, RegionMask, cut_mask
from supermap_cli.types.sensing import CameraFrame
from supermap_sam import Sam2Options
from supermap_sam.model_files import find_model_files

NAME = "sam2"

_INPUT_PX = 1024
"""Side of the encoder's input in pixels where the model leaves it open (`image_size` of SAM 2)."""
_FEATURES = ("image_embed", "high_res_feats_0", "high_res_feats_1")
_CORNERS = (2, 3)
"""Labels of a box's upper left and lower right corner (`PromptEncoder._embed_boxes`)."""
_MASK_SHARE = 4
"""Pixels of the input to one of a mask prompt (`mask_input_size`)."""
_BOXES = 32
"""Boxes a pass at most; bounds the memory: a box's masks take about 1 MB. Chosen."""


class Sam2:
    """A segmenter. Raises `DetectorError` for models that are no SAM 2."""

    def __init__(self, options: Sam2Options) -> None:
        encoder, decoder = find_model_files(options.encoder, options.decoder, NAME)
        self._options = options
        self._encoder, self._decoder = (
            OnnxModel(path, option=f"{NAME}.{part}", threads=options.threads, device=options.device)
            for path, part in ((encoder, "encoder"), (decoder, "decoder"))
        )
        self._image = self._encoder.inputs[0]
        _check(self._encoder, len(self._image.shape) == 4 and set(_FEATURES) <= set(self._encoder.output_names))
        wanted = {*_FEATURES, "point_coords", "point_labels"}
        _check(self._decoder, wanted <= self._decoder.input_names and "iou_predictions" in self._decoder.output_names)
        height, width = sides(self._image, (2, 3))
        self._size = (height or _INPUT_PX, width or _INPUT_PX)
        self._format = ImageFormat(size_px=self._size)
        self._boxes_a_pass = _boxes_a_pass(self._decoder.input("point_coords"))

    @property
    def warnings(self) -> Sequence[str]:
        """Where another device is used than the one asked for."""
        return (*self._encoder.warnings, *self._decoder.warnings)

    def segment(self, frame: CameraFrame, detections: Detections) -> tuple[RegionMask | None, ...]:
        """A mask for every detection; existing masks are passed through; `None` where the model expects a miss."""
        masks = list(detections.masks)
        missing = [i for i, mask in enumerate(masks) if mask is None]
        if missing:
            logits, ious = self.mask_logits(frame.rgb, detections.boxes_xyxy[missing])
            for i, mask, iou in zip(missing, logits, ious, strict=True):
                masks[i] = cut_mask(full_mask(mask, frame.rgb.shape[:2])) if iou >= self._options.min_iou else None
        return tuple(masks)

    def mask_logits(self, rgb: NDArray[np.uint8], boxes_xyxy: Float32Array) -> tuple[Float32Array, Float32Array]:
        """For boxes (n, 4) in pixels of an image (h, w, 3): logits (n, rows, columns) over the whole image, and the IoU
        (n,) that the model expects of each: of a box's masks the best one.
        """
        embedding = self._encoder.run({self._image.name: self._format.tensor(rgb, self._size)})
        height, width = rgb.shape[:2]
        scale = np.array([self._size[1] / width, self._size[0] / height], np.float32)
        corners = boxes_xyxy.reshape(-1, 2, 2).astype(np.float32) * scale
        masks, ious = [], []
        for first in range(0, len(corners), self._boxes_a_pass):
            answer = self._decode(embedding, corners[first : first + self._boxes_a_pass])
            masks.append(answer[0])
            ious.append(answer[1])
        return np.concatenate(masks), np.concatenate(ious)

    def _decode(
        self, embedding: Mapping[str, NDArray[Any]], corners: Float32Array
    ) -> tuple[Float32Array, Float32Array]:
        """The best mask of each box (n, 2 corners, 2), and its expected IoU."""
        n = len(corners)
        feeds: dict[str, NDArray[Any]] = {name: embedding[name] for name in _FEATURES}
        feeds["point_coords"] = corners
        feeds["point_labels"] = np.tile(np.array(_CORNERS, np.float32), (n, 1))
        mask_prompt = self._decoder.input("mask_input")
        prompts = n if mask_prompt is not None and not isinstance(mask_prompt.shape[0], int) else 1
        side = (self._size[0] // _MASK_SHARE, self._size[1] // _MASK_SHARE)
        feeds["mask_input"] = np.zeros((prompts, 1, *side), np.float32)
        feeds["has_mask_input"] = np.zeros(prompts, np.float32)
        outputs = self._decoder.run(feeds, cure="export it for any number of boxes, or for one")
        ious = outputs["iou_predictions"]
        masks = next(output for name, output in outputs.items() if name != "iou_predictions" and output.ndim == 4)
        if ious.ndim != 2 or masks.shape[:2] != ious.shape or len(ious) != n:
            raise DetectorError(
                f"the model's outputs are not understood: {list(masks.shape)}, {list(ious.shape)}",
                where=str(self._decoder.path),
                cure="export a SAM 2 decoder with masks [boxes, k, 256, 256] and iou_predictions [boxes, k]",
            )
        if not (np.isfinite(ious).all() and np.isfinite(masks).all()):
            cure = "export it in float32, not in half precision"
            raise DetectorError("the model's outputs hold NaN or infinity", where=str(self._decoder.path), cure=cure)
        best = ious.argmax(axis=1)
        return np.asarray(masks[np.arange(n), best], np.float32), np.asarray(ious[np.arange(n), best], np.float32)


def _boxes_a_pass(points: TensorDescription | None) -> int:
    """As many boxes as the decoder is fixed to, else several."""
    fixed = sides(points, (0,))[0] if points is not None and points.shape else None
    return _BOXES if fixed is None else 1


def _check(model: OnnxModel, ours: bool) -> None:
    if not ours:
        raise DetectorError(
            f"no SAM 2: {model.described()}",
            where=str(model.path),
            cure="export its encoder with the outputs image_embed, high_res_feats_0, high_res_feats_1, its decoder "
            "with these, point_coords and point_labels as inputs and iou_predictions as an output",
        )
