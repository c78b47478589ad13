"""The detector `onnx`: layouts of tensors, class names, weights."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.types.sensing import CameraFrame
from supermap_onnx import OnnxOptions
from supermap_onnx.detector import OnnxDetector
from supermap_onnx.layouts import EndToEnd, Ultralytics, Yolox, grid, recognise_layout
from supermap_onnx.weights import find_model, parse_names
from support.frames import frame, shared_file
from support.tiny_onnx import write_constant_model

SIZE = (128, 128)
CELLS = 16 * 16 + 8 * 8 + 4 * 4
WIDE = PinholeCamera(256, 128, 200.0, 200.0, 127.5, 63.5)
NAMES = {"names": "{0: 'cup', 1: 'chair', 2: 'book'}"}


def options(model: Path, **more: object) -> OnnxOptions:
    return OnnxOptions.model_validate({"model": model, **more})


def wide_frame() -> CameraFrame:
    """256x128: shrunk to half, it leaves 64 rows of the input to be padded."""
    return frame(camera=WIDE)


def ultralytics(*rows: tuple[float, ...], coefficients: int = 0) -> NDArray[np.float32]:
    """[1, 7 + k, cells] with the given columns (cx, cy, w, h, cup, chair, book, ...)."""
    tensor = np.zeros((1, 7 + coefficients, CELLS), np.float32)
    for i, row in enumerate(rows):
        tensor[0, :, i] = row
    return tensor


def yolox(cell: int, box: tuple[float, float, float, float], objectness: float, label: int) -> NDArray[np.float32]:
    """[1, cells, 8] in which one cell holds a box (cx, cy, w, h) of the input, not decoded."""
    cells, strides = grid(SIZE)
    tensor = np.zeros((1, CELLS, 8), np.float32)
    tensor[0, cell, :2] = np.array(box[:2]) / strides[cell] - cells[cell]
    tensor[0, cell, 2:4] = np.log(np.array(box[2:]) / strides[cell])
    tensor[0, cell, 4], tensor[0, cell, 5 + label] = objectness, 0.9
    return tensor


def test_an_image_without_objects_gives_no_detections(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, NAMES)
    assert len(OnnxDetector(options(model)).detect(frame())) == 0


@pytest.mark.parametrize(
    ("shapes", "layout"),
    [
        ([(1, CELLS, 85)], Yolox(80, SIZE, decoded=False)),
        ([(1, 84, CELLS)], Ultralytics(80)),
        ([(1, 116, CELLS), (1, 32, 16, 16)], Ultralytics(80)),
        ([(1, 300, 6)], EndToEnd()),
        ([(1, 300, 38), (1, 32, 16, 16)], EndToEnd()),
        ([(1, 1000)], None),
        ([(1, 7, 7, 30)], None),
        ([(2, 84, CELLS)], None),
        ([(1, 25200, 85)], None),
        ([], None),
    ],
)
def test_layouts_are_told_apart_by_their_shapes(shapes: list[tuple[int, ...]], layout: object) -> None:
    assert recognise_layout([np.zeros(shape, np.float32) for shape in shapes], SIZE) == layout


def test_yolox_boxes_are_decoded_and_the_letterbox_undone(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [yolox(20, (30, 16, 20, 10), 0.8, 1)], SIZE, NAMES)
    found = OnnxDetector(options(model)).detect(wide_frame())
    np.testing.assert_allclose(found.boxes_xyxy, [[40, 22, 80, 42]], atol=1e-3)
    assert found.labels == ("chair",)
    assert found.scores[0] == pytest.approx(0.72)


def test_yolox_that_decodes_itself_is_recognised(tmp_path: Path) -> None:
    cells, strides = grid(SIZE)
    tensor = np.zeros((1, CELLS, 8), np.float32)
    tensor[0, :, :2] = (cells + 0.5) * strides
    tensor[0, 20, :6] = (30, 16, 20, 10, 0.8, 0.9)
    model = write_constant_model(tmp_path / "m.onnx", [tensor], SIZE, NAMES)
    np.testing.assert_allclose(OnnxDetector(options(model)).detect(wide_frame()).boxes_xyxy, [[40, 22, 80, 42]])


def test_ultralytics_letterbox_is_centred(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics((30, 48, 20, 10, 0.1, 0, 0.7))], SIZE, NAMES)
    found = OnnxDetector(options(model)).detect(wide_frame())
    np.testing.assert_allclose(found.boxes_xyxy, [[40, 22, 80, 42]], atol=1e-3)
    assert found.labels == ("book",)


def test_end_to_end_models_give_corners(tmp_path: Path) -> None:
    tensor = np.zeros((1, 300, 6), np.float32)
    tensor[0, 0] = (20, 43, 40, 53, 0.6, 2)
    model = write_constant_model(tmp_path / "m.onnx", [tensor], SIZE, NAMES)
    found = OnnxDetector(options(model)).detect(wide_frame())
    np.testing.assert_allclose(found.boxes_xyxy, [[40, 22, 80, 42]], atol=1e-3)
    assert found.labels == ("book",)


def test_masks_are_decoded_inside_the_box(tmp_path: Path) -> None:
    prototypes = np.full((1, 1, 16, 16), -1.0, np.float32)
    prototypes[..., :8] = 1.0
    rows = ultralytics((64, 64, 64, 32, 0.9, 0, 0, 1.0), coefficients=1)
    model = write_constant_model(tmp_path / "m.onnx", [rows, prototypes], SIZE, NAMES)
    mask = OnnxDetector(options(model)).detect(wide_frame()).masks[0]
    assert mask is not None
    assert (mask.u0, mask.v0, mask.pixels.shape) == (64, 32, (64, 128))
    assert mask.pixels[:, :62].all()
    assert not mask.pixels[:, 66:].any()


def test_all_likely_labels_are_kept_as_hypotheses(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics((32, 32, 20, 20, 0.5, 0.05, 0.3))], SIZE, NAMES)
    (hypotheses,) = OnnxDetector(options(model)).detect(frame()).hypotheses
    assert [hypothesis.label for hypothesis in hypotheses] == ["cup", "book"]


def test_one_thing_found_under_two_names_is_one_detection(tmp_path: Path) -> None:
    rows = ultralytics((32, 32, 20, 20, 0.6, 0, 0), (32, 32, 20, 21, 0, 0, 0.5), (90, 80, 10, 10, 0.4, 0, 0))
    model = write_constant_model(tmp_path / "m.onnx", [rows], SIZE, NAMES)
    found = OnnxDetector(options(model)).detect(frame())
    assert found.labels == ("cup", "cup")
    assert [hypothesis.label for hypothesis in found.hypotheses[0]] == ["cup", "book"]


def test_eighty_nameless_classes_are_cocos(tmp_path: Path) -> None:
    tensor = np.zeros((1, 84, CELLS), np.float32)
    tensor[0, :4, 0], tensor[0, 4 + 41, 0] = (32, 32, 20, 20), 0.9
    model = write_constant_model(tmp_path / "m.onnx", [tensor], SIZE)
    assert OnnxDetector(options(model)).detect(frame()).labels == ("cup",)


def test_a_model_is_identified_by_its_weights_and_words(tmp_path: Path) -> None:
    labels = tmp_path / "labels.txt"
    labels.write_text("mug\nstool\nleaflet\n", encoding="utf-8")
    (tmp_path / "elsewhere").mkdir()
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, NAMES)
    copy = tmp_path / "elsewhere" / "m.onnx"
    copy.write_bytes(model.read_bytes())
    identity = OnnxDetector(options(model)).identity
    assert identity.startswith("m ")
    assert OnnxDetector(options(copy)).identity == identity
    assert OnnxDetector(options(model, labels=labels)).identity != identity


def test_a_labels_file_names_the_classes(tmp_path: Path) -> None:
    labels = tmp_path / "labels.txt"
    labels.write_text("mug\n\nstool\nleaflet\n", encoding="utf-8")
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics((32, 32, 20, 20, 0, 0.9, 0))], SIZE, NAMES)
    assert OnnxDetector(options(model, labels=labels)).detect(frame()).labels == ("stool",)


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({}, "does not name its 3 classes"),
        ({"names": "{0: 'cup'}"}, "1 class names for a model of 3 classes"),
        ({"names": "__import__('os').system('true')"}, "not understood"),
        ({"names": "[" * 100_000}, "not understood"),
        ({"names": "{0: 'cup', 2: 'book'}"}, "not understood"),
    ],
)
def test_missing_or_wrong_class_names_are_reported(tmp_path: Path, metadata: dict[str, str], message: str) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, metadata)
    with pytest.raises(DetectorError, match=message) as error:
        OnnxDetector(options(model))
    assert "onnx.labels=FILE" in str(error.value)


@pytest.mark.parametrize("text", ["{0: 'cup', 1: 'tv'}", "['cup', 'tv']", '["cup", "tv"]', '{"0": "cup", "1": "tv"}'])
def test_names_are_read_as_literals(text: str) -> None:
    assert parse_names(text, Path("m.onnx")) == ("cup", "tv")


def test_tensors_of_another_family_are_refused(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [np.zeros((1, 1000), np.float32)], SIZE)
    with pytest.raises(DetectorError, match=r"not understood: \[1, 1000\]"):
        OnnxDetector(options(model))


@pytest.mark.parametrize("content", [b"", b"not a model at all", bytes(range(256)) * 10])
def test_a_damaged_model_is_refused(tmp_path: Path, content: bytes) -> None:
    model = tmp_path / "m.onnx"
    model.write_bytes(content)
    with pytest.raises(DetectorError, match=r"m\.onnx"):
        OnnxDetector(options(model))


def test_missing_weights_say_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(DetectorError, match=r"supermap models pull yolox-nano.*onnx\.model=PATH"):
        find_model(None)
    with pytest.raises(DetectorError, match="no model file"):
        find_model(tmp_path / "absent.onnx")


def test_the_default_model_lies_in_the_users_data_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = tmp_path / "supermap" / "models"
    folder.mkdir(parents=True)
    (folder / "yolo.onnx").touch()
    assert find_model(None).name == "yolo.onnx"
    (folder / "other.onnx").touch()
    with pytest.raises(DetectorError, match="several models"):
        find_model(None)
    (folder / "detector.onnx").touch()
    assert find_model(None).name == "detector.onnx"


@pytest.mark.parametrize("name", ["yolox_nano.onnx", "yolo11n-seg.onnx"])
def test_a_real_model_finds_cup_chair_and_table(name: str) -> None:
    from mcap.reader import make_reader

    model, recording = shared_file(f"models/{name}"), shared_file("data/redkitchen.mcap")
    with recording.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/camera/color/image_raw/compressed"])
        data = next(messages)[2].data
    start = data.index(b"\xff\xd8\xff")
    rgb = cv2.cvtColor(cv2.imdecode(np.frombuffer(data[start:], np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    found = OnnxDetector(options(model)).detect(frame(rgb, camera=PinholeCamera(640, 480, 585, 585, 320, 240)))
    sure = {label for label, score in zip(found.labels, found.scores, strict=True) if score > 0.4}
    assert {"cup", "chair", "dining table"} <= sure
    assert (found.scores[:-1] >= found.scores[1:]).all()
    if "seg" in name:
        for box, mask in zip(found.boxes_xyxy, found.masks, strict=True):
            assert mask is None or (mask.u0 >= int(box[0]) and mask.v0 >= int(box[1]))


@pytest.mark.parametrize("task", ["pose", "obb", "classify"])
def test_models_for_other_tasks_are_named(tmp_path: Path, task: str) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, {**NAMES, "task": task})
    with pytest.raises(DetectorError, match=f"a model for the task '{task}'.*export a detection or segmentation model"):
        OnnxDetector(options(model))


@pytest.mark.parametrize(
    ("later", "message"),
    [
        (ultralytics()[:, :, :3], "changed shape: .* instead of .*export it with fixed output shapes"),
        (ultralytics()[0], "changed shape"),
        (ultralytics() * np.float32(np.nan), "NaN or infinity.*float32"),
        (ultralytics() + np.float32(np.inf), "NaN or infinity"),
    ],
)
def test_outputs_that_turn_into_something_else_are_named(tmp_path: Path, later: np.ndarray, message: str) -> None:
    detector = OnnxDetector(options(write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, NAMES)))
    detector._run = lambda _: [later]  # type: ignore[method-assign]
    with pytest.raises(DetectorError, match=message):
        detector.detect(frame())


@pytest.mark.parametrize("number", [np.nan, np.inf, 3e38])
def test_a_model_whose_first_outputs_are_no_numbers_is_named(tmp_path: Path, number: float) -> None:
    tensor = ultralytics()
    tensor[0, 2, 5] = number
    with pytest.raises(DetectorError, match=r"NaN or infinity.*m\.onnx"):
        OnnxDetector(options(write_constant_model(tmp_path / "m.onnx", [tensor], SIZE, NAMES)))


def test_metadata_that_is_no_text_is_a_damaged_model(tmp_path: Path) -> None:
    model = write_constant_model(tmp_path / "m.onnx", [ultralytics()], SIZE, NAMES)
    model.write_bytes(model.read_bytes().replace(b"'cup'", b"'\xff\xff\xff'"))
    with pytest.raises(DetectorError, match=r"the model cannot be loaded.*m\.onnx"):
        OnnxDetector(options(model))


def test_a_box_of_any_size_is_cut_to_the_image(tmp_path: Path) -> None:
    tensor = yolox(20, (30, 16, 20, 10), 0.8, 1)
    tensor[0, 20, 2:4] = 1000.0
    found = OnnxDetector(options(write_constant_model(tmp_path / "m.onnx", [tensor], SIZE, NAMES))).detect(wide_frame())
    np.testing.assert_allclose(found.boxes_xyxy, [[0, 0, 256, 128]])
