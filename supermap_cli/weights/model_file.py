"""Where the files of a model of the catalogue lie: what detectors, segmenters and encoders of plugins ask for."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.errors import ModelError
from supermap_cli.weights.catalogue import CatalogueModel, load_catalogue
from supermap_cli.weights.folder import models_folder


def model_file(name: str, file: str | None = None) -> Path:
    """The path of a model's network, or of another one of its files, as `supermap models pull` has put it there.

    `name` is the model's name in the catalogue. The files of a model lie in one folder, so that a tokenizer is found
    beside its network. Raises `ModelError` for an unknown name or file, and, where a file of the model is not there,
    one whose cure is the command that gets it.
    """
    model = load_catalogue().get(name)
    wanted = model.file[0].path if file is None else file
    if wanted not in {each.path for each in model.file}:
        known = ", ".join(each.path for each in model.file)
        raise ModelError(f"the model {name} has no file {wanted!r}", cure=f"its files are {known}")
    folder = models_folder() / name
    if missing := [each.path for each in model.file if not (folder / each.path).is_file()]:
        what = (
            f"the weights of {name} are not here" if len(missing) == len(model.file) else f"a part of {name} is missing"
        )
        raise ModelError(what, where=str(folder / missing[0]), cure=f"`{pull_command(model)}` gets them")
    return folder / wanted


def is_here(model: CatalogueModel) -> bool:
    """Whether all files of a model are there; whether they are right says `supermap models verify`."""
    return all((models_folder() / model.name / each.path).is_file() for each in model.file)


def pull_command(model: CatalogueModel) -> str:
    """The command that gets a model, complete with what its licence asks for."""
    return f"supermap models pull {model.name}" + (" --accept-license" if model.accept else "")
