"""ONNX models, their outputs and their labels: detections come out, or one line that names the file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import DetectorError
from supermap_cli.input_files import read_class_names
from supermap_onnx import OnnxOptions
from supermap_onnx.detector import OnnxDetector
from support.frames import frame
from support.fuzzing import MUTATIONS, Edit, fuzzing, mutated, one_input, one_line
from support.tiny_onnx import write_constant_model

SIZE = (64, 64)
CELLS = 8 * 8 + 4 * 4 + 2 * 2
NAMES = {"names": "{0: 'cup', 1: 'chair', 2: 'book'}"}
LAYOUTS = {
    "yolox": [(1, CELLS, 8)],
    "ultralytics": [(1, 7, CELLS)],
    "segmenting": [(1, 7 + 4, CELLS), (1, 4, 16, 16)],
    "end to end": [(1, 20, 6)],
}
EXTREMES = st.sampled_from([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, 0.0, -1.0, 1.0, 0.5, 2.0, 64.0, 1e9])


def outputs(layout: str, values: list[tuple[float, float]], fill: float) -> list[np.ndarray]:
    """Sound tensors of a layout in which some numbers are others."""
    made = [np.full(shape, fill, np.float32) for shape in LAYOUTS[layout]]
    for share, value in values:
        tensor = made[int(share * len(made))]
        tensor.ravel()[int(share * 7919 % 1 * tensor.size)] = value
    return made


def detect(model: Path, **more: Any) -> None:
    detector = OnnxDetector(OnnxOptions.model_validate({"model": model, "threads": 1, **more}))
    check(detector.detect(frame()))


def check(found: Any) -> None:
    assert np.isfinite(found.boxes_xyxy).all()
    assert ((found.scores >= 0) & (found.scores <= 1)).all()
    assert all(label for label in found.labels)


VALUES = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), EXTREMES), max_size=30)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_any_outputs(tmp_path: Path, layout: str) -> None:
    @fuzzing(15)
    @given(VALUES, st.sampled_from([0.0, 0.9, 1e-3, -5.0]))
    def any_outputs(values: list[tuple[float, float]], fill: float) -> None:
        with one_input("model outputs"):
            write_constant_model(tmp_path / "m.onnx", outputs(layout, values, fill), SIZE, NAMES)
            one_line(lambda: detect(tmp_path / "m.onnx"))

    any_outputs()


@pytest.mark.parametrize("layout", LAYOUTS)
def test_outputs_that_change(tmp_path: Path, layout: str) -> None:
    detector = OnnxDetector(
        OnnxOptions(model=write_constant_model(tmp_path / "m.onnx", outputs(layout, [], 0.0), SIZE, NAMES), threads=1)
    )

    @fuzzing(40)
    @given(VALUES, st.sampled_from([0.0, 0.9, 1e-3, -5.0, np.nan]), st.integers(0, 200), st.booleans())
    def changing(values: list[tuple[float, float]], fill: float, length: int, flat: bool) -> None:
        later = outputs(layout, values, fill)
        later[0] = later[0].ravel() if flat else later[0][:, :, :length] if length < 90 else later[0][:, : length % 30]
        detector._run = lambda _: later  # type: ignore[method-assign]
        with one_input("model outputs"):
            one_line(lambda: check(detector.detect(frame())))

    changing()


@fuzzing(20)
@given(
    st.lists(st.lists(st.sampled_from([0, 1, 2, 3, 6, 7, 8, CELLS]), max_size=4), max_size=3),
    st.sampled_from([(0, 0), (1, 1), (64, 64), (31, 33), (7, 4000)]),
    st.sampled_from(
        [NAMES, {}, {"task": "pose"}, {"names": "{}"}, {"names": "9" * 100}, {"names": "['\\x1b[2J', '']"}]
    ),
)
def test_any_shapes(tmp_path: Path, shapes: list[list[int]], size: tuple[int, int], metadata: dict[str, str]) -> None:
    with one_input("model shapes"):
        tensors = [np.zeros(shape, np.float32) for shape in shapes]
        one_line(lambda: detect(write_constant_model(tmp_path / "m.onnx", tensors, size, metadata)))


@cache
def sound(folder: Path) -> bytes:
    return write_constant_model(folder / "sound.onnx", outputs("ultralytics", [], 0.0), SIZE, NAMES).read_bytes()


@fuzzing(40)
@given(MUTATIONS)
def test_changed_files(tmp_path: Path, changes: list[Edit]) -> None:
    (tmp_path / "m.onnx").write_bytes(mutated(sound(tmp_path), changes))
    with one_input("model file"):
        one_line(lambda: detect(tmp_path / "m.onnx"))


LABELS = st.one_of(
    st.binary(max_size=60),
    st.lists(st.text(max_size=12), max_size=5).map(lambda names: "\n".join(names).encode("utf-8", "surrogatepass")),
    st.sampled_from([b"\xef\xbb\xbfcup\nchair\nbook", b"cup\r\nchair\r\nbook\r\n", b"a\n" * 100_000, b"x" * 1_000_000]),
    st.sampled_from([b"cup\nchair\n\x1b[2J", b"a\0b\nc\nd", b"\xff\xfec\0u\0p\0", b"cup\nchair\nbook"]),
)


@fuzzing(80, share=2)
@given(LABELS)
def test_any_labels(tmp_path: Path, content: bytes) -> None:
    model, labels = tmp_path / "m.onnx", tmp_path / "labels.txt"
    if not model.exists():
        write_constant_model(model, outputs("ultralytics", [], 0.9), SIZE, NAMES)
    labels.write_bytes(content)
    with one_input("labels"):
        one_line(lambda: detect(model, labels=labels))
        names = one_line(lambda: read_class_names(labels, DetectorError, option="recorded.labels"))
        assert all(name and "\0" not in name for name in names or ())
