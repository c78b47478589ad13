"""Finds the weights and the class names. Weights are never part of SuperMap."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from supermap_cli.errors import DetectorError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.inference.model_file import check_model_file
from supermap_cli.input_files import read_class_names
from supermap_cli.types.detections import Hypothesis
from supermap_cli.weights.catalogue import load_catalogue
from supermap_cli.weights.folder import models_folder
from supermap_cli.weights.model_file import is_here, model_file, pull_command

_MAX_HYPOTHESES = 3
"""Labels that a detection keeps at most. Chosen."""
_MIN_HYPOTHESIS_RATIO = 0.2
"""Least score of a hypothesis, relative to the best one's. Chosen."""

_MAX_NAMES_CHARS = 1_000_000
"""Characters of class names in a model's metadata; longer texts are refused, they are no names."""


def find_model(requested: Path | None) -> Path:
    """The model file: the one given, by its path or its name in the catalogue, else `detector.onnx` or the only .onnx
    in the models folder, else the first detector of the catalogue that is there.

    Raises `DetectorError` that says how to get one.
    """
    if requested is not None:
        return _requested(requested)
    folder = models_folder()
    preferred = folder / "detector.onnx"
    found = [preferred] if preferred.is_file() else sorted(folder.glob("*.onnx"))
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise DetectorError(
            f"several models to choose from: {names}",
            where=str(folder),
            cure="say --option onnx.model=PATH, or call one of them detector.onnx",
        )
    if found:
        return found[0]
    known = load_catalogue().of_backend("onnx")
    pulled = next((model for model in known if is_here(model)), None)
    if pulled is None:
        raise DetectorError(
            "the detector has no weights, and SuperMap ships none",
            cure=f"`{pull_command(known[0])}` gets some; or say --option onnx.model=PATH with an export of your own",
        )
    return model_file(pulled.name)


def _requested(requested: Path) -> Path:
    path = requested.expanduser()
    if not path.exists() and load_catalogue().find(str(requested)) is not None:
        return model_file(str(requested))
    check_model_file(path, DetectorError, option="onnx.model")
    return path


def class_names(labels: Path | None, metadata: Mapping[str, str], classes: int | None, model: Path) -> tuple[str, ...]:
    """The names of a model's classes: of the labels file, else of the model's metadata, else COCO's if there are 80.

    `classes` is `None` where the tensors do not tell how many there are.
    Raises `DetectorError` where there are none or their number is wrong.
    """
    if labels is not None:
        names, source = read_class_names(labels, DetectorError, option="onnx.labels"), str(labels)
    elif "names" in metadata:
        names, source = parse_names(metadata["names"], model), f"{model}, metadata 'names'"
    elif classes == len(_coco_names()):
        return _coco_names()
    else:
        raise DetectorError(
            f"the model does not name its {classes or ''} classes",
            where=str(model),
            cure="say --option onnx.labels=FILE with a name on each line",
        )
    if classes is not None and len(names) != classes:
        raise DetectorError(
            f"{len(names)} class names for a model of {classes} classes",
            where=source,
            cure="say --option onnx.labels=FILE with a name on each line",
        )
    return names


def parse_names(text: str, model: Path) -> tuple[str, ...]:
    """Class names as Ultralytics writes them, `{0: 'person', ...}` or `['person', ...]`. Nothing is evaluated."""
    try:
        return _names_of_literal(text)
    except (ValueError, TypeError, KeyError, SyntaxError, RecursionError, MemoryError) as error:
        raise DetectorError(
            "the class names in the model's metadata are not understood",
            where=str(model),
            cure="say --option onnx.labels=FILE with a name on each line",
        ) from error


def _names_of_literal(text: str) -> tuple[str, ...]:
    if len(text) > _MAX_NAMES_CHARS:
        raise ValueError("too long")
    value = ast.literal_eval(text)
    if isinstance(value, dict):
        by_index = {int(index): name for index, name in value.items()}
        value = [by_index[index] for index in range(len(by_index))]
    if not isinstance(value, list | tuple):
        raise TypeError("neither a list nor a mapping")
    names = tuple(str(name).strip() for name in value)
    if not all(names):
        raise ValueError("a class without a name")
    return names


def _coco_names() -> tuple[str, ...]:
    """The 80 classes of COCO (Lin et al. 2014), in the order in which detectors number them."""
    return tuple(files("supermap_onnx").joinpath("coco80.txt").read_text(encoding="utf-8").splitlines())


def likely_labels(class_scores: Float32Array, names: Sequence[str]) -> tuple[Hypothesis, ...]:
    """The likeliest labels of a detection, best first, from its (classes,) scores."""
    best = np.argsort(-class_scores, kind="stable")[:_MAX_HYPOTHESES]
    min_score = class_scores[best[0]] * _MIN_HYPOTHESIS_RATIO
    return tuple(
        Hypothesis(names[i], min(float(class_scores[i]), 1.0))
        for i in best
        if class_scores[i] >= min_score and names[i]
    )
