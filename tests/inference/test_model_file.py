"""Model files are data: what may be loaded, and where its tensors may lie."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import DetectorError
from supermap_cli.inference.model_file import check_model_file, external_data, model_digest
from support.tiny_onnx import _bytes, _number, _text, write_constant_model


def model_with_external(path: Path, location: str) -> Path:
    """A model of one tensor whose bytes lie in another file."""
    entry = _text(1, "location") + _text(2, location)
    tensor = _number(1, 2) + _number(2, 1) + _text(8, "w") + _bytes(13, entry) + _number(14, 1)
    path.write_bytes(_number(1, 8) + _bytes(7, _text(2, "graph") + _bytes(5, tensor)))
    return path


def check(path: Path) -> None:
    check_model_file(path, DetectorError, option="onnx.model")


@pytest.mark.parametrize(
    "location", ["../w.bin", "/etc/passwd", "a/../../w.bin", "C:\\w.bin", "..\\w.bin", "\\\\host\\w", ""]
)
def test_tensors_outside_the_models_folder_are_refused(tmp_path: Path, location: str) -> None:
    (tmp_path / "w.bin").write_bytes(b"12345678")
    (tmp_path / "models").mkdir()
    with pytest.raises(DetectorError, match="outside its folder"):
        check(model_with_external(tmp_path / "models" / "m.onnx", location))


def test_tensors_beside_the_model_are_taken_and_named_where_they_are_missing(tmp_path: Path) -> None:
    model = model_with_external(tmp_path / "m.onnx", "weights/w.bin")
    assert external_data(model) == {"weights/w.bin"}
    with pytest.raises(DetectorError, match=r"data is missing: weights/w\.bin"):
        check(model)
    (tmp_path / "weights").mkdir()
    (tmp_path / "weights" / "w.bin").write_bytes(b"12345678")
    check(model)


def test_the_digest_of_a_model_is_also_that_of_its_external_tensors(tmp_path: Path) -> None:
    model = model_with_external(tmp_path / "m.onnx", "w.bin")
    (tmp_path / "w.bin").write_bytes(b"12345678")
    before = model_digest(model)
    (tmp_path / "w.bin").write_bytes(b"12345679")
    assert model_digest(model) != before
    assert model_digest(model, "cup") != model_digest(model, "chair")


@pytest.mark.parametrize("name", ["m.pt", "m.pth", "m.bin", "m.pkl", "m.safetensors", "m.engine", "M.PT"])
def test_other_formats_are_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"anything")
    with pytest.raises(DetectorError, match=r"no ONNX model; such files are not loaded.*export the model to ONNX"):
        check(tmp_path / name)


def test_pickles_are_refused_whatever_they_are_called(tmp_path: Path) -> None:
    (tmp_path / "pickled.onnx").write_bytes(pickle.dumps({"weights": [1.0]}))
    with zipfile.ZipFile(tmp_path / "saved.onnx", "w") as archive:
        archive.writestr("data.pkl", b"")
    with pytest.raises(DetectorError, match="a pickle file"):
        check(tmp_path / "pickled.onnx")
    with pytest.raises(DetectorError, match="a PyTorch file"):
        check(tmp_path / "saved.onnx")


@pytest.mark.parametrize("size", [0, 1, 7, 40, 200])
def test_a_model_that_is_cut_short_has_the_external_data_before_the_cut(tmp_path: Path, size: int) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [np.zeros((1, 7, 9), np.float32)], (64, 64))
    model.write_bytes(model.read_bytes()[:size])
    assert external_data(model) == frozenset()
