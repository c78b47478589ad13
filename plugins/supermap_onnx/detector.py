"""Runs an ONNX detector on camera images."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.types.detections import Detections, Hypothesis
from supermap_cli.types.sensing import CameraFrame
from supermap_onnx import OnnxOptions
from supermap_onnx.layouts import EndToEnd, Layout, recognise_layout
from supermap_onnx.letterbox import PADDING_GREY, fit_letterbox
from supermap_onnx.masks import decode_masks
from supermap_cli.geometry.suppression import suppress
from supermap_onnx.weights import class_names, find_model

_PROVIDERS = ("CUDAExecutionProvider", "CPUExecutionProvider")
"""Execution providers of onnxruntime, the preferred one first."""
_DEFAULT_INPUT_SIZE = (640, 640)
"""(height, width) in pixels where the model leaves them open: the usual training size of YOLOX and YOLOv8/11."""
_MIN_BOX_PX = 2.0
"""Pixels: detections of a smaller width or height are left out. Chosen."""
_MAX_HYPOTHESES = 3
"""Labels that a detection keeps at most. Chosen."""
_MIN_HYPOTHESIS_RATIO = 0.2
"""Least score of a hypothesis, relative to the best one's. Chosen."""

_LARGEST_OUTPUT = 1e9
"""No pixel, score or mask coefficient is larger, and products of two stay finite in float32. Chosen."""

_TASKS = ("detect", "segment")
"""What Ultralytics' exports call, in their metadata, the tasks whose outputs are boxes with classes."""

_DIGEST_CHARS = 8
"""Characters of a model's digest in its identity. Chosen: 32 bits tell a few thousand models apart."""


class OnnxDetector:
    """A YOLOX or YOLOv8/11 model, recognised by its tensors. Raises `DetectorError` for anything else."""

    def __init__(self, options: OnnxOptions) -> None:
        self._options = options
        path = find_model(options.model)
        self._session = _open_session(path, options.threads)
        metadata, inputs = _described(self._session, path)
        _check_task(metadata.get("task"), path)
        self._path = path
        self._input, self._input_type, self._input_size = _image_input(inputs, path)
        grey = np.full((1, 3, *self._input_size), PADDING_GREY, np.float32)
        outputs = self._run_safely(grey, path)
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
        self._identity = f"{path.stem} {_digest(path, self._names)}"

    @property
    def identity(self) -> str:
        """The model file's name, and a digest of its weights and class names."""
        return self._identity

    def image_stamps_ns(self, camera_id: str) -> None:
        """`None`: it can process any image."""

    def detect(self, frame: CameraFrame) -> Detections:
        """Detections down to the score floor, best first, with masks if the model makes them."""
        letterbox = fit_letterbox(frame.rgb.shape[:2], self._input_size, centred=self._layout.centred)
        outputs = self._run_safely(self._layout.feed(letterbox.paste(frame.rgb)), self._path)
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
        hypotheses = tuple(self._hypotheses(row) for row in class_scores)
        scores = np.array([labels[0].score for labels in hypotheses], np.float32)
        masks = decode_masks(boxes, coefficients, candidates.prototypes, letterbox)
        return Detections(frame.stamp_ns, boxes, scores, hypotheses, masks)

    def _hypotheses(self, class_scores: Float32Array) -> tuple[Hypothesis, ...]:
        """The likeliest labels, best first."""
        best = np.argsort(-class_scores, kind="stable")[:_MAX_HYPOTHESES]
        min_score = class_scores[best[0]] * _MIN_HYPOTHESIS_RATIO
        return tuple(
            Hypothesis(self._names[i], min(float(class_scores[i]), 1.0)) for i in best if class_scores[i] >= min_score
        )

    def _run(self, tensor: Float32Array) -> list[Float32Array]:
        outputs = self._session.run(None, {self._input: tensor.astype(self._input_type, copy=False)})
        return [np.asarray(output, np.float32) for output in outputs]

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

    def _run_safely(self, tensor: Float32Array, path: Path) -> list[Float32Array]:
        """Run the model; raises `DetectorError` if it cannot be run."""
        try:
            return self._run(tensor)
        except Exception as error:  # onnxruntime's errors share no base class
            raise DetectorError(
                f"the model does not run: {_first_line(error)}",
                where=str(path),
                cure=f"export it for one image of {self._input_size[1]}x{self._input_size[0]}",
            ) from error


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


def _digest(path: Path, names: Sequence[str]) -> str:
    """The first characters of a digest of a model and its class names: enough to tell a user's models apart."""
    with path.open("rb") as model:
        digest = hashlib.file_digest(model, "sha256")
    digest.update("\n".join(names).encode())
    return digest.hexdigest()[:_DIGEST_CHARS]


def _open_session(path: Path, threads: int) -> Any:
    settings = onnxruntime.SessionOptions()
    settings.intra_op_num_threads = threads
    settings.add_session_config_entry("session.intra_op.allow_spinning", "0")  # mapping runs beside it
    settings.log_severity_level = 4
    available = onnxruntime.get_available_providers()
    providers = [provider for provider in _PROVIDERS if provider in available]
    with _loading(path):
        return onnxruntime.InferenceSession(str(path), settings, providers=providers)


def _described(session: Any, path: Path) -> tuple[Mapping[str, str], Sequence[Any]]:
    """A model's metadata and its inputs."""
    with _loading(path):
        return session.get_modelmeta().custom_metadata_map, session.get_inputs()


@contextmanager
def _loading(path: Path) -> Iterator[None]:
    """Turns whatever a damaged model raises into `DetectorError`."""
    try:
        yield
    except Exception as error:  # onnxruntime's errors share no base class
        raise DetectorError(
            f"the model cannot be loaded: {_first_line(error)}",
            where=str(path),
            cure="it is damaged or no ONNX model; get or export it anew",
        ) from error


def _image_input(inputs: Sequence[Any], path: Path) -> tuple[str, type[np.floating[Any]], tuple[int, int]]:
    """The input's name, type and (height, width); sizes that the model leaves open become 640."""
    types: dict[str, type[np.floating[Any]]] = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
    image = inputs[0] if inputs else None
    shape: Sequence[Any] = [] if image is None else image.shape
    one_image = len(inputs) == 1 and len(shape) == 4 and (shape[1] == 3 or not isinstance(shape[1], int))
    if image is None or not one_image or image.type not in types:
        described = ", ".join(f"{tensor.name} {tensor.shape} {tensor.type}" for tensor in inputs)
        raise DetectorError(
            f"the model's input is not understood: {described}",
            where=str(path),
            cure="a detector takes one image, [1, 3, height, width] of floats",
        )
    size = tuple(
        given if isinstance(given, int) else default
        for given, default in zip(shape[2:], _DEFAULT_INPUT_SIZE, strict=True)
    )
    return image.name, types[image.type], (size[0], size[1])


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
