"""Grounding DINO (Liu et al. 2023), MM Grounding DINO and LLMDet, as Hugging Face's exports have them.

In: `pixel_values` (1, 3, H, W), `pixel_mask` (1, H, W), and (1, tokens) each `input_ids`, `token_type_ids`,
`attention_mask`. Out: `logits` (1, queries, 256) before the sigmoid, one for each token, and `pred_boxes`
(1, queries, 4), centre and size from 0 to 1.
Source: `GroundingDinoForObjectDetection` and `GroundingDinoProcessor` of transformers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array, UInt8Array
from supermap_cli.inference.images import ImageFormat, read_image_format
from supermap_cli.inference.model_file import model_digest
from supermap_cli.inference.session import OnnxModel, sides
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame
from supermap_open_vocabulary import GroundingDinoOptions
from supermap_open_vocabulary.candidates import PhraseCandidates, joined, to_detections, to_pixels
from supermap_open_vocabulary.captions import Caption, Encode, make_captions
from supermap_open_vocabulary.model_folder import ModelFolder, find_model_folder
from supermap_open_vocabulary.phrase_order import takes_several_phrases
from supermap_open_vocabulary.phrases import read_phrases

NAME = "grounding-dino"

_REQUIRED = {"pixel_values", "input_ids", "attention_mask"}
_KNOWN = {*_REQUIRED, "pixel_mask", "token_type_ids"}
_TEXT_TOKENS = 256
"""Tokens of a caption at most (`max_text_len` of Grounding DINO)."""
_PROBE_PX = 320
"""Pixels of an image whose feature maps, of strides 8 to 64, have more cells (2125) than there are queries (900)."""
_LARGEST = 1e4
"""No logit or share of an image is larger. Chosen."""


class GroundingDino:
    """A detector of any words. Raises `DetectorError` for a model of another kind."""

    def __init__(self, options: GroundingDinoOptions) -> None:
        self._options = options
        self.phrases = read_phrases(options.prompt, options.labels, NAME)
        files = find_model_folder(options.model, NAME)
        self._model = OnnxModel(files.model, option=f"{NAME}.model", threads=options.threads, device=options.device)
        self._fixed_size = _checked(self._model)
        self._format = read_image_format(files.folder, ImageFormat(shortest_px=800, longest_px=1333), DetectorError)
        encode: Encode = files.tokenizer().encode
        length = _text_length(self._model)
        budget = min(_max_text_tokens(files), length or _TEXT_TOKENS)
        several = not options.one_phrase and takes_several_phrases(self._probed, encode, length)
        self._warnings = self._model.warnings
        if not several and not options.one_phrase and len(self.phrases) > 1:
            self._warnings = (*self._warnings, _one_phrase_warning(files.model.name, len(self.phrases)))
        self.captions = make_captions(self.phrases, encode, budget=budget, length=length, one_phrase=not several)
        self._identity = f"{files.model.stem} {model_digest(files.model, *self.phrases)}"

    @property
    def identity(self) -> str:
        """The model file's name, and a digest of its weights and the phrases."""
        return self._identity

    @property
    def warnings(self) -> Sequence[str]:
        """Where the model is not run as asked for."""
        return self._warnings

    def image_stamps_ns(self, camera_id: str) -> None:
        """`None`: it can process any image."""

    def detect(self, frame: CameraFrame) -> Detections:
        """Detections down to the score floor, best first, without masks."""
        found = self.candidates(frame.rgb).above(self._options.score_floor)
        return to_detections(
            frame, found, self.phrases, iou=self._options.iou, max_detections=self._options.max_detections
        )

    def candidates(self, rgb: UInt8Array) -> PhraseCandidates:
        """Every query's box and score of each phrase, pass after pass, for an image (h, w, 3)."""
        pixels = self._image_feeds(rgb)
        passes = []
        for caption in self.captions:
            logits, boxes = self._run(caption, pixels)
            scores = np.zeros((len(logits), len(self.phrases)), np.float32)
            scores[:, list(caption.phrases)] = caption.scores(logits)
            passes.append(PhraseCandidates(to_pixels(boxes, rgb.shape[:2]), scores))
        return joined(passes)

    def _image_feeds(self, rgb: UInt8Array) -> dict[str, np.ndarray]:
        """`pixel_values` and `pixel_mask`. Where the model's size is fixed, the image is fitted into it and the rest is
        masked, or it is stretched where there is no mask to say so.
        """
        size = self._fixed_size
        if size is None:
            values = self._format.tensor(rgb, self._format.input_size(rgb.shape[:2]))
            return {"pixel_values": values, "pixel_mask": np.ones((1, *values.shape[2:]), np.int64)}
        if self._model.input("pixel_mask") is None:
            return {"pixel_values": self._format.tensor(rgb, size)}
        scale = min(size[0] / rgb.shape[0], size[1] / rgb.shape[1])
        rows, columns = (max(1, round(side * scale)) for side in rgb.shape[:2])
        values, mask = np.zeros((1, 3, *size), np.float32), np.zeros((1, *size), np.int64)
        values[:, :, :rows, :columns] = self._format.tensor(rgb, (rows, columns))
        mask[:, :rows, :columns] = 1
        return {"pixel_values": values, "pixel_mask": mask}

    def _run(self, caption: Caption, pixels: dict[str, np.ndarray]) -> tuple[Float32Array, Float32Array]:
        """`logits` (queries, tokens) and `pred_boxes` (queries, 4) of a caption."""
        outputs = self._model.run({**pixels, **caption.feeds()}, cure="export it with dynamic text and image sizes")
        logits, boxes = outputs["logits"], outputs["pred_boxes"]
        if logits.ndim != 3 or boxes.shape != (1, logits.shape[1], 4) or logits.shape[2] < caption.spans[-1][1]:
            raise DetectorError(
                f"the model's outputs are not understood: {list(logits.shape)}, {list(boxes.shape)}",
                where=str(self._model.path),
                cure="export a Grounding DINO with the outputs logits [1, queries, 256] and pred_boxes",
            )
        last = caption.spans[-1][1]
        sound = not np.isnan(logits[0, :, :last]).any() and (logits[0, :, :last] < _LARGEST).all()
        if not sound or not (np.abs(boxes) < _LARGEST).all():
            cure = "export it in float32, not in half precision, or choose another model"
            raise DetectorError("the model's outputs hold NaN or infinity", where=str(self._model.path), cure=cure)
        return logits[0], boxes[0]

    def _probed(self, caption: Caption) -> Float32Array:
        """The logits of a caption, for an image of noise."""
        side = self._fixed_size or (_PROBE_PX, _PROBE_PX)
        noise = np.random.default_rng(0).integers(0, 256, (*side, 3), np.uint8)
        mask = np.ones((1, *side), np.int64)
        return self._run(caption, {"pixel_values": self._format.tensor(noise, side), "pixel_mask": mask})[0]


def _one_phrase_warning(name: str, phrases: int) -> str:
    return (
        f"{name} scores words otherwise when it is asked for them in another order: its export is made for one phrase. "
        f"It is asked for one a pass, {phrases} passes an image; get or make an export for several phrases"
    )


def _checked(model: OnnxModel) -> tuple[int, int] | None:
    """The image (height, width) that a model is fixed to. Raises `DetectorError` for a model of another kind."""
    image = model.input("pixel_values")
    ours = model.input_names >= _REQUIRED and model.input_names <= _KNOWN
    if not ours or image is None or len(image.shape) != 4 or not {"logits", "pred_boxes"} <= set(model.output_names):
        raise DetectorError(
            f"no Grounding DINO: {model.described()}",
            where=str(model.path),
            cure="export one with the inputs pixel_values, pixel_mask, input_ids, token_type_ids, attention_mask "
            "and the outputs logits, pred_boxes",
        )
    height, width = sides(image, (2, 3))
    return None if height is None or width is None else (height, width)


def _text_length(model: OnnxModel) -> int | None:
    """The number of tokens that a model is fixed to."""
    text = model.input("input_ids")
    return None if text is None or len(text.shape) != 2 else sides(text, (1,))[0]


def _max_text_tokens(files: ModelFolder) -> int:
    given = files.settings().get("max_text_len", _TEXT_TOKENS)
    return given if isinstance(given, int) and 4 <= given <= _TEXT_TOKENS else _TEXT_TOKENS
