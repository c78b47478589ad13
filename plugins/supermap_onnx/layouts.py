"""Tensor layouts of the YOLOX and YOLOv8/11 families, told apart by their shapes.

Sources: YOLOX `yolox/utils/demo_utils.py` (`demo_postprocess`), Ultralytics' export formats `detect` and `segment`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, UInt8Array

STRIDES = (8, 16, 32)
"""Pixels of the input between the cells of the three grids (YOLOX `demo_postprocess`, p6=False)."""
_MOST_LOG_SIZE = 12.0
"""Logarithm of a box's size in cells: e^12 cells are wider than any image, and no larger box is an infinite one."""
_END_TO_END_COLUMNS = 6
"""x0, y0, x1, y1, score, class (Ultralytics' export with `nms=True`)."""


@dataclass(frozen=True)
class Candidates:
    """Boxes a network proposes, before suppression.

    `boxes_xyxy` (n, 4) float32 pixels of the network's input; `class_scores` (n, classes) float32;
    `coefficients` (n, k) float32 of `prototypes` (k, h, w), both empty for a model without masks.
    """

    boxes_xyxy: Float32Array
    class_scores: Float32Array
    coefficients: Float32Array
    prototypes: Float32Array


class Layout(Protocol):
    """How to feed a network and read its outputs."""

    @property
    def centred(self) -> bool:
        """Whether the image lies in the middle of the input."""
        ...

    @property
    def classes(self) -> int | None:
        """The number of classes, where the tensors say so."""
        ...

    def feed(self, canvas_rgb: UInt8Array) -> Float32Array:
        """The padded image (h, w, 3) as the input tensor (1, 3, h, w)."""
        ...

    def read(self, outputs: Sequence[Float32Array], score_floor: float) -> Candidates:
        """The candidates whose best class reaches `score_floor`."""
        ...


@dataclass(frozen=True)
class Yolox:
    """[1, n, 5 + classes]: box, objectness and class scores at every cell of the grids of strides 8, 16 and 32.

    `decoded` says that grid and stride have been applied inside the model.
    """

    classes: int
    input_size: tuple[int, int]
    decoded: bool
    centred: bool = False

    def feed(self, canvas_rgb: UInt8Array) -> Float32Array:
        """BGR, 0 to 255."""
        return np.ascontiguousarray(canvas_rgb.transpose(2, 0, 1)[::-1][None], dtype=np.float32)

    def read(self, outputs: Sequence[Float32Array], score_floor: float) -> Candidates:
        """Undo the grid: centre = (xy + cell) * stride, size = exp(wh) * stride; score = objectness * class."""
        rows = outputs[0][0]
        likely = np.flatnonzero(rows[:, 4] >= score_floor)
        class_scores = rows[likely, 5:] * rows[likely, 4:5]
        enough = class_scores.max(axis=1, initial=0) >= score_floor
        likely, class_scores = likely[enough], class_scores[enough]
        box = rows[likely, :4]
        if not self.decoded:
            cells, strides = grid(self.input_size)
            box = np.concatenate(
                [
                    (box[:, :2] + cells[likely]) * strides[likely],
                    np.exp(box[:, 2:].clip(max=_MOST_LOG_SIZE)) * strides[likely],
                ],
                axis=1,
            )
        return Candidates(_to_xyxy(box), class_scores, *_no_masks(len(box)))


@dataclass(frozen=True)
class Ultralytics:
    """[1, 4 + classes + k, n], decoded, with prototypes [1, k, h, w] where it segments."""

    classes: int
    centred: bool = True

    def feed(self, canvas_rgb: UInt8Array) -> Float32Array:
        """RGB, 0 to 1."""
        return _unit_rgb(canvas_rgb)

    def read(self, outputs: Sequence[Float32Array], score_floor: float) -> Candidates:
        """Centre and size in pixels of the input, class scores, mask coefficients."""
        columns = outputs[0][0]
        likely = np.flatnonzero(columns[4 : 4 + self.classes].max(axis=0) >= score_floor)
        rows = columns[:, likely].T
        masks = (rows[:, 4 + self.classes :], outputs[1][0]) if len(outputs) > 1 else _no_masks(len(rows))
        return Candidates(_to_xyxy(rows[:, :4]), np.ascontiguousarray(rows[:, 4 : 4 + self.classes]), *masks)


@dataclass(frozen=True)
class EndToEnd:
    """[1, n, 6 + k]: corners, score and class of the detections that the model's own suppression keeps."""

    classes: int | None = None
    centred: bool = True

    def feed(self, canvas_rgb: UInt8Array) -> Float32Array:
        """RGB, 0 to 1."""
        return _unit_rgb(canvas_rgb)

    def read(self, outputs: Sequence[Float32Array], score_floor: float) -> Candidates:
        """One class each, so the scores of all others are 0."""
        rows = outputs[0][0]
        rows = rows[rows[:, 4] >= score_floor]
        chosen = rows[:, 5].astype(np.int64)
        class_scores = np.zeros((len(rows), int(chosen.max(initial=-1)) + 1), np.float32)
        class_scores[np.arange(len(rows)), chosen] = rows[:, 4]
        masks = (rows[:, 6:], outputs[1][0]) if len(outputs) > 1 else _no_masks(len(rows))
        return Candidates(np.ascontiguousarray(rows[:, :4]), class_scores, *masks)


def recognise_layout(outputs: Sequence[Float32Array], input_size: tuple[int, int]) -> Layout | None:
    """The layout of a network's outputs for an input of (height, width); `None` if it is unknown."""
    if not outputs or outputs[0].ndim != 3 or outputs[0].shape[0] != 1 or len(outputs) > 2:
        return None
    if len(outputs) == 2 and (outputs[1].ndim != 4 or outputs[1].shape[0] != 1):
        return None
    _, rows, columns = outputs[0].shape
    prototypes = outputs[1].shape[1] if len(outputs) == 2 else 0
    cells = len(grid(input_size)[0])
    if rows == cells and columns > 5 and not prototypes:
        return Yolox(columns - 5, input_size, decoded=_lies_on_grid(outputs[0][0], input_size))
    if columns == cells and rows > 4 + prototypes:
        return Ultralytics(rows - 4 - prototypes)
    if columns == _END_TO_END_COLUMNS + prototypes and rows != cells:
        return EndToEnd()
    return None


def grid(input_size: tuple[int, int]) -> tuple[Float32Array, Float32Array]:
    """The cells (n, 2) as (column, row) and their strides (n, 1) pixels, stride after stride, row after row."""
    cells, strides = [], []
    for stride in STRIDES:
        height, width = input_size[0] // stride, input_size[1] // stride
        rows, columns = np.mgrid[:height, :width]
        cells.append(np.column_stack([columns.ravel(), rows.ravel()]))
        strides.append(np.full((height * width, 1), stride))
    return np.concatenate(cells).astype(np.float32), np.concatenate(strides).astype(np.float32)


def _lies_on_grid(rows: Float32Array, input_size: tuple[int, int]) -> bool:
    """Whether box centres are near their own cells: then the model decodes them itself."""
    cells, strides = grid(input_size)
    decoded_offsets = np.abs(rows[:, :2] - (cells + 0.5) * strides)
    return bool(np.median(decoded_offsets) < np.median(np.abs((rows[:, :2] - 0.5) * strides)))


def _unit_rgb(canvas_rgb: UInt8Array) -> Float32Array:
    tensor = np.empty((1, 3, *canvas_rgb.shape[:2]), np.float32)
    np.multiply(canvas_rgb.transpose(2, 0, 1), np.float32(1 / 255), out=tensor[0])
    return tensor


def _to_xyxy(centre_and_size: Float32Array) -> Float32Array:
    """(n, 4) cx, cy, w, h -> xyxy."""
    half = centre_and_size[:, 2:] / 2
    return np.concatenate([centre_and_size[:, :2] - half, centre_and_size[:, :2] + half], axis=1)


def _no_masks(n: int) -> tuple[Float32Array, Float32Array]:
    return np.zeros((n, 0), np.float32), np.zeros((0, 0, 0), np.float32)
