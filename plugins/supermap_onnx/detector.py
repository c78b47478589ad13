"""Runs an ONNX detector on camera images."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.geometry.suppression import suppress
from supermap_cli.inference.model_file import model_digest
from supermap_cli.inference.session import OnnxModel, TensorDescription
from supermap_cli.types.detections import Detections
from supermap_cli.types.sensing import CameraFrame
from supermap_onnx import OnnxOptions
from supermap_onnx.layouts import EndToEnd, Layout, recognise_layout
from supermap_onnx.letterbox import PADDING_GREY, fit_letterbox
from supermap_onnx.masks import decode_masks
from supermap_onnx.weights import class_names, find_model, likely_labels

_DEFAULT_INPUT_SIZE = (640, 640)
"""(height, width) in pixels where the model leaves them open: the usual training size of YOLOX and YOLOv8/11."""
_MIN_BOX_PX = 2.0
"""Pixels: detections of a smaller width or height are left out. Chosen."""
_LARGEST_OUTPUT = 1e9
"""No pixel, score or mask coefficient is larger, and products of two stay finite in float32. Chosen."""

_TASKS = ("detect", "segment")
"""What Ultralytics' exports call, in their metadata, the tasks whose outputs are boxes with classes."""


def open_detector_model(options: OnnxOptions) -> OnnxModel:
    """The model that the options name. Raises `DetectorError` for one whose metadata says that it detects no boxes."""
    path = find_model(options.model)
    model = OnnxModel(path, option="onnx.model", threads=options.threads, device=options.device)
    _check_task(model.metadata.get("task"), path)
    return model


class OnnxDetector:
    """A YOLOX or YOLOv8/11 model, recognised by its tensors. Raises `DetectorError` for anything else."""

    def __init__(self, options: OnnxOptions, model: OnnxModel | None = None) -> None:
        self._options = options
        self._model = open_detector_model(options) if model is None else model
        path, metadata = self._model.path, self._model.metadata
        self._path = path
        self._input, self._input_size = _image_input(self._model.inputs, path)
        grey = np.full((1, 3, *self._input_size), PADDING_GREY, np.float32)
        outputs = self._run(grey)
        _check_numbers(outputs, str(path))
        layout = recognise_layout(outputs, self._input_size)
        if layout is None:
            shapes = ", ".join(str(list(output.shape)) for output in outputs)
            raise DetectorError(
                f"the model's outputs are not understood: {shapes}",
                where=str(path),
                cure="export a YOLOX or a YOLOv8/11 detection or segmentation model, batch 1",
            )
        self._layout: Layout = layout
        self._shapes = [output.shape for output in outputs]
        self._names = class_names(options.labels, metadata, layout.classes, path)
        self._identity = f"{path.stem} {model_digest(path, *self._names)}"

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
        letterbox = fit_letterbox(frame.rgb.shape[:2], self._input_size, centred=self._layout.centred)
        outputs = self._run(self._layout.feed(letterbox.paste(frame.rgb)))
        self._check_outputs(outputs, frame.stamp_ns)
        candidates = self._layout.read(outputs, self._options.score_floor)
        if candidates.class_scores.shape[1] > len(self._names):
            raise DetectorError(
                f"the model found class {candidates.class_scores.shape[1] - 1} of {len(self._names)} that have a name",
                cure="say --option onnx.labels=FILE with a name on each line",
            )
        kept = suppress(candidates.boxes_xyxy, candidates.class_scores, self._options.iou, self._options.max_detections)
        boxes = letterbox.to_image(candidates.boxes_xyxy[kept.index])
        large_enough = ((boxes[:, 2:] - boxes[:, :2]) >= _MIN_BOX_PX).all(axis=1)
        boxes, class_scores = boxes[large_enough], kept.class_scores[large_enough]
        coefficients = candidates.coefficients[kept.index[large_enough]]
        hypotheses = tuple(likely_labels(row, self._names) for row in class_scores)
        scores = np.array([labels[0].score for labels in hypotheses], np.float32)
        masks = decode_masks(boxes, coefficients, candidates.prototypes, letterbox)
        return Detections(frame.stamp_ns, boxes, scores, hypotheses, masks)

    def _run(self, tensor: Float32Array) -> list[Float32Array]:
        height, width = self._input_size
        outputs = self._model.run({self._input: tensor}, cure=f"export it for one image of {width}x{height}")
        return [np.asarray(output, np.float32) for output in outputs.values()]

    def _check_outputs(self, outputs: Sequence[Float32Array], stamp_ns: int) -> None:
        """Raise `DetectorError` for outputs of other shapes than the first ones, and for numbers that are none.

        The number of detections of a model with its own suppression may vary.
        """
        rows_vary = isinstance(self._layout, EndToEnd)
        alike = len(outputs) == len(self._shapes) and all(
            output.ndim == len(shape)
            and all(
                now == first or (rows_vary and index == 0 and axis == 1)
                for axis, (now, first) in enumerate(zip(output.shape, shape, strict=True))
            )
            for index, (output, shape) in enumerate(zip(outputs, self._shapes, strict=True))
        )
        where = f"{self._path}, image at {stamp_ns} ns"
        if not alike:
            now, first = (", ".join(str(list(shape)) for shape in each) for each in (_shapes(outputs), self._shapes))
            cure = "export it with fixed output shapes (dynamic=False)"
            raise DetectorError(f"the model's outputs changed shape: {now} instead of {first}", where=where, cure=cure)
        _check_numbers(outputs, where)


def _check_numbers(outputs: Sequence[Float32Array], where: str) -> None:
    """Raise `DetectorError` for outputs that are no pixels, scores or coefficients."""
    if not all((np.abs(output) < _LARGEST_OUTPUT).all() for output in outputs):
        cure = "export it in float32, not in half precision, or choose another model"
        raise DetectorError("the model's outputs hold NaN or infinity, or numbers as large", where=where, cure=cure)


def _shapes(outputs: Sequence[Float32Array]) -> list[tuple[int, ...]]:
    return [output.shape for output in outputs]


def _check_task(task: str | None, path: Path) -> None:
    """Raise `DetectorError` for a model whose metadata says that it detects no boxes: pose, obb, classify."""
    if task is not None and task not in _TASKS:
        raise DetectorError(
            f"a model for the task {task!r}, which gives no upright boxes with labels",
            where=f"{path}, metadata 'task'",
            cure="export a detection or segmentation model (task 'detect' or 'segment')",
        )


def _image_input(inputs: Sequence[TensorDescription], path: Path) -> tuple[str, tuple[int, int]]:
    """The input's name and (height, width); sizes that the model leaves open become 640."""
    image = inputs[0] if inputs else None
    shape: Sequence[int | str | None] = () if image is None else image.shape
    one_image = len(inputs) == 1 and len(shape) == 4 and (shape[1] == 3 or not isinstance(shape[1], int))
    if image is None or not one_image or image.dtype not in {np.float32, np.float16}:
        raise DetectorError(
            f"the model's input is not understood: {', '.join(map(str, inputs))}",
            where=str(path),
            cure="a detector takes one image, [1, 3, height, width] of floats",
        )
    size = tuple(
        given if isinstance(given, int) else default
        for given, default in zip(shape[2:], _DEFAULT_INPUT_SIZE, strict=True)
    )
    return image.name, (size[0], size[1])
