"""DETR and its kin, RT-DETR, D-FINE and RF-DETR (with masks, too): a set of queries, no suppression needed.

Three contracts, told apart by the names of the outputs:

| export | in | out |
| --- | --- | --- |
| Hugging Face | `pixel_values` | `logits` (1, Q, classes), `pred_boxes` (1, Q, 4) centre and size from 0 to 1 |
| RF-DETR | `input` | `dets` (1, Q, 4) likewise, `labels` (1, Q, classes) logits; `masks` (1, Q, h, w) logits |
| RT-DETR, D-FINE | `images`, `orig_target_sizes` (1, 2) | `labels`, `scores` (1, Q), `boxes` (1, Q, 4) xyxy pixels |

Sources: `RTDetrImageProcessor` and `RfDetrImageProcessor` of transformers; `export_onnx.py` of lyuwenyu/RT-DETR and
Peterande/D-FINE; `deploy/export.py` of roboflow/rf-detr.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array, UInt8Array
from supermap_cli.inference.images import ImageFormat, read_image_format, read_settings
from supermap_cli.inference.masks import full_mask
from supermap_cli.inference.model_file import model_digest
from supermap_cli.inference.session import OnnxModel, TensorDescription, sides
from supermap_cli.types.detections import Detections, RegionMask, cut_mask
from supermap_cli.types.sensing import CameraFrame
from supermap_onnx import OnnxOptions
from supermap_onnx.weights import class_names, likely_labels

_PLAIN = ImageFormat(size_px=(640, 640), mean=(0.0, 0.0, 0.0), std=(1.0, 1.0, 1.0))
"""RT-DETR and D-FINE: 0 to 1, not normalised (`preprocessor_config.json` of PekingU/rtdetr_r50vd)."""
_IMAGENET = ImageFormat(size_px=(640, 640))
_SOFTMAX_TYPES = {"detr", "conditional_detr_softmax", "table-transformer", "yolos"}
"""`model_type` of models whose last class is "no object" (`DetrForObjectDetection`)."""
_COCO_IDS = (90, 91)
"""Columns of a model whose classes are COCO's own category numbers, 1 to 90 with gaps, 0 unused."""
_MIN_BOX_PX = 2.0
"""Pixels: detections of a smaller width or height are left out. Chosen."""
_LARGEST = 1e6
"""No logit, share of an image or pixel is larger. Chosen."""


@dataclass(frozen=True)
class _Contract:
    """The names of the outputs. `centred`: boxes are centre and size from 0 to 1, and `classes` are logits."""

    boxes: str
    classes: str
    masks: str | None
    image: ImageFormat
    scores: str | None = None

    @property
    def centred(self) -> bool:
        return self.scores is None


_CONTRACTS = (
    _Contract("pred_boxes", "logits", "pred_masks", _PLAIN),
    _Contract("dets", "labels", "masks", _IMAGENET),
    _Contract("boxes", "labels", None, _PLAIN, scores="scores"),
)


@dataclass(frozen=True)
class QueryAnswers:
    """What the queries of an image say: `boxes_xyxy` (n, 4) float32 pixels of the image, `class_scores` (n, classes)
    float32, `mask_logits` (n, h, w) float32 over the whole image, `None` for a model without masks.
    """

    boxes_xyxy: Float32Array
    class_scores: Float32Array
    mask_logits: Float32Array | None


def is_detr(model: OnnxModel) -> bool:
    """Whether a model's outputs have the names of one of the contracts."""
    return _contract(model) is not None


class DetrDetector:
    """A detector with a fixed set of classes. Raises `DetectorError` for a model that is none."""

    def __init__(self, model: OnnxModel, options: OnnxOptions) -> None:
        contract = _contract(model)
        image = next((tensor for tensor in model.inputs if len(tensor.shape) == 4), None)
        if contract is None or image is None or image.dtype not in (np.float32, np.float16):
            cure = "export an RT-DETR, D-FINE or RF-DETR"
            raise DetectorError(f"no DETR: {model.described()}", where=str(model.path), cure=cure)
        self._model, self._options, self._contract, self._image = model, options, contract, image
        folder = next(
            (place for place in (model.path.parent, model.path.parent.parent) if (place / "config.json").is_file()),
            model.path.parent,
        )
        self._format = read_image_format(folder, contract.image, DetectorError)
        self._fixed_size = _fixed_size(image)
        self._settings = read_settings(folder / "config.json", DetectorError)
        self._softmax = self._settings.get("model_type") in _SOFTMAX_TYPES
        grey = np.full((*(self._fixed_size or self._format.size_px or (640, 640)), 3), 128, np.uint8)
        columns = self.answers(grey).class_scores.shape[1] if contract.centred else None
        self._names = self._class_names(columns)
        self._identity = f"{model.path.stem} {model_digest(model.path, *self._names)}"

    @property
    def identity(self) -> str:
        """The model file's name, and a digest of its weights and class names."""
        return self._identity

    @property
    def warnings(self) -> Sequence[str]:
        """Where another device is used than the one asked for."""
        return self._model.warnings

    def image_stamps_ns(self, camera_id: str) -> None:
        """`None`: it can process any image."""

    def detect(self, frame: CameraFrame) -> Detections:
        """Detections down to the score floor, best first, with masks if the model makes them."""
        found = self.answers(frame.rgb)
        scores = self._of_named_classes(found.class_scores)
        height, width = frame.rgb.shape[:2]
        boxes = np.clip(found.boxes_xyxy, 0, np.array([width, height, width, height], np.float32))
        best = scores.max(axis=1, initial=0)
        large = ((boxes[:, 2:] - boxes[:, :2]) >= _MIN_BOX_PX).all(axis=1)
        likely = np.flatnonzero(large & (best >= self._options.score_floor))
        chosen = likely[np.argsort(-best[likely], kind="stable")][: self._options.max_detections]
        hypotheses = tuple(likely_labels(scores[i], self._names) for i in chosen)
        masks: tuple[RegionMask | None, ...] = (None,) * len(chosen)
        if found.mask_logits is not None:
            masks = tuple(cut_mask(full_mask(found.mask_logits[i], (height, width))) for i in chosen)
        top = np.array([labels[0].score for labels in hypotheses], np.float32)
        return Detections(frame.stamp_ns, boxes[chosen], top, hypotheses, masks, frame.camera_id)

    def answers(self, rgb: UInt8Array) -> QueryAnswers:
        """What every query says of an image (h, w, 3)."""
        size = self._fixed_size or self._format.input_size(rgb.shape[:2])
        tensor = self._format.tensor(rgb, size)
        height, width = rgb.shape[:2]
        feeds: dict[str, NDArray[Any]] = {
            self._image.name: tensor,
            "orig_target_sizes": np.array([[width, height]], np.int64),
            "pixel_mask": np.ones((1, *size), np.int64),
        }
        outputs = self._model.run(feeds, cure=f"export it for one image of {size[1]}x{size[0]}")
        boxes, classes = outputs[self._contract.boxes], outputs[self._contract.classes]
        self._check(boxes, classes)
        if self._contract.centred:
            half = boxes[0][:, 2:] / 2
            corners = np.concatenate([boxes[0][:, :2] - half, boxes[0][:, :2] + half], axis=1)
            boxes_xyxy = np.asarray(corners * np.array([width, height, width, height]), np.float32)
            scores = self._scores(classes[0])
        else:
            boxes_xyxy = np.asarray(boxes[0], np.float32)
            scores = _one_class_each(classes[0], outputs["scores"][0])
        masks = None if self._contract.masks is None else outputs.get(self._contract.masks)
        if masks is not None and (masks.ndim != 4 or masks.shape[:2] != boxes.shape[:2]):
            raise self._not_understood(masks.shape)
        return QueryAnswers(boxes_xyxy, scores, None if masks is None else masks[0])

    def _scores(self, logits: Float32Array) -> Float32Array:
        values = logits.astype(np.float64)
        if self._softmax:
            exponents = np.exp(values - values.max(axis=1, keepdims=True))
            return np.asarray((exponents / exponents.sum(axis=1, keepdims=True))[:, :-1], np.float32)
        with np.errstate(over="ignore"):
            return np.asarray(1 / (1 + np.exp(-values)), np.float32)

    def _check(self, boxes: NDArray[Any], classes: NDArray[Any]) -> None:
        """Raise `DetectorError` for outputs that are no boxes with classes, or no numbers."""
        if boxes.ndim != 3 or boxes.shape[0] != 1 or boxes.shape[2] != 4 or classes.shape[:2] != boxes.shape[:2]:
            raise self._not_understood(boxes.shape, classes.shape)
        if not all((np.abs(output) < _LARGEST).all() for output in (boxes, classes)):
            cure = "export it in float32, not in half precision, or choose another model"
            raise DetectorError("the model's outputs hold NaN or infinity", where=str(self._model.path), cure=cure)

    def _not_understood(self, *shapes: tuple[int, ...]) -> DetectorError:
        return DetectorError(
            f"the model's outputs are not understood: {', '.join(str(list(shape)) for shape in shapes)}",
            where=str(self._model.path),
            cure="export it for one image",
        )

    def _class_names(self, columns: int | None) -> tuple[str, ...]:
        """Of the labels file, the model's metadata, config.json, or COCO; an unused number has no name."""
        given = _configured_names(self._settings.get("id2label"))
        if self._options.labels is None and "names" not in self._model.metadata:
            if given is not None and (columns is None or len(given) == columns):
                return given
            if columns in _COCO_IDS:
                return coco_category_names()[:columns]
            if columns is None:
                columns = 80
        return class_names(self._options.labels, self._model.metadata, columns, self._model.path)

    def _of_named_classes(self, scores: Float32Array) -> Float32Array:
        if scores.shape[1] > len(self._names):
            raise DetectorError(
                f"the model found class {scores.shape[1] - 1} of {len(self._names)} that have a name",
                where=str(self._model.path),
                cure="say --option onnx.labels=FILE with a name on each line",
            )
        named = np.array([bool(name) for name in self._names[: scores.shape[1]]])
        return np.asarray(scores * named, np.float32)


def coco_category_names() -> tuple[str, ...]:
    """The names of COCO's categories (Lin et al. 2014) by their numbers, 0 to 90; empty for those without a class."""
    return tuple(files("supermap_onnx").joinpath("coco91.txt").read_text(encoding="utf-8").splitlines())


def _contract(model: OnnxModel) -> _Contract | None:
    names = set(model.output_names)
    for contract in _CONTRACTS:
        if {contract.boxes, contract.classes, contract.scores or contract.boxes} <= names:
            return contract
    return None


def _fixed_size(image: TensorDescription) -> tuple[int, int] | None:
    height, width = sides(image, (2, 3))
    return None if height is None or width is None else (height, width)


def _configured_names(labels: object) -> tuple[str, ...] | None:
    """The names of config.json's `id2label`; `None` where it has none of its own ("LABEL_0")."""
    if not isinstance(labels, Mapping) or not labels:
        return None
    try:
        by_number = {int(number): str(name).strip() for number, name in labels.items()}
    except (TypeError, ValueError):
        return None
    if set(by_number) != set(range(len(by_number))) or all(name.startswith("LABEL_") for name in by_number.values()):
        return None
    return tuple("" if by_number[i] in {"N/A", "no object"} else by_number[i] for i in range(len(by_number)))


def _one_class_each(classes: NDArray[Any], scores: NDArray[Any]) -> Float32Array:
    """(n, classes) scores of answers with one class each; all others are 0."""
    chosen = np.clip(classes, 0, None).astype(np.int64)
    made = np.zeros((len(chosen), int(chosen.max(initial=0)) + 1), np.float32)
    made[np.arange(len(chosen)), chosen] = scores
    return made
