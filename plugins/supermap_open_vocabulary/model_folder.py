"""A model with the files that belong to it: tokenizer.json, config.json, preprocessor_config.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from supermap_cli.errors import DetectorError
from supermap_cli.inference.images import read_settings
from supermap_cli.weights.folder import models_folder

TOKENIZER = "tokenizer.json"
_NAMES = ("model.onnx", "onnx/model.onnx")
"""Where Hugging Face's exports have the model in their folder."""


@dataclass(frozen=True)
class ModelFolder:
    """`model` is the .onnx file, `folder` holds the files that describe it."""

    model: Path
    folder: Path

    def settings(self) -> Mapping[str, Any]:
        """What config.json says; empty where there is none."""
        return read_settings(self.folder / "config.json", DetectorError)

    def tokenizer(self) -> Any:
        """The tokenizer. Raises `DetectorError` where its package or its file is missing or damaged."""
        try:
            from tokenizers import Tokenizer  # noqa: PLC0415 - an extra
        except ImportError:
            raise DetectorError(
                "detectors of any words need the package tokenizers",
                cure="pip install 'supermap-cli[open-vocabulary]'",
            ) from None
        path = self.folder / TOKENIZER
        try:
            tokenizer = Tokenizer.from_file(str(path))
        except Exception as error:  # the package raises Exception itself
            raise DetectorError(
                f"the tokenizer cannot be read: {error}", where=str(path), cure="get the file anew"
            ) from error
        tokenizer.no_truncation()
        tokenizer.no_padding()
        return tokenizer


def find_model_folder(requested: Path | None, detector: str) -> ModelFolder:
    """The model that an option names, by its file or its folder, else the one in the user's data folder.

    Raises `DetectorError` that says where to put what is missing.
    """
    default = models_folder() / detector
    place = default if requested is None else requested.expanduser()
    model = _model_in(place, detector) if place.is_dir() else place
    if requested is None and not model.is_file():
        raise DetectorError(
            f"the detector {detector} has no weights, and SuperMap ships none",
            cure=f"`supermap models pull {detector}` gets some; or say --option {detector}.model=PATH, with its "
            f"{TOKENIZER} beside it",
        )
    folders = [folder for folder in (model.parent, model.parent.parent) if (folder / TOKENIZER).is_file()]
    if not folders and model.is_file():
        raise DetectorError(
            f"there is no {TOKENIZER} beside the model, nor in the folder above it",
            where=str(model),
            cure=f"get the {TOKENIZER} that was published with the model",
        )
    return ModelFolder(model, folders[0] if folders else model.parent)


def _model_in(folder: Path, detector: str) -> Path:
    """The model in a folder: by its usual name, else the only one."""
    for name in _NAMES:
        if (folder / name).is_file():
            return folder / name
    found = sorted(folder.glob("*.onnx"))
    if len(found) != 1:
        what = f"{len(found)} .onnx files to choose from" if found else "no .onnx file"
        raise DetectorError(what, where=str(folder), cure=f"name one with --option {detector}.model=PATH")
    return found[0]
