"""The catalogue of weights: what each model is, its licence, and its files with their addresses and digests."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, field_validator, model_validator

from supermap_cli.errors import ModelError
from supermap_cli.input_files import read_text
from supermap_cli.weights.folder import models_folder
from supermap_cli.wrong_entries import wrong_entry

OWN_CATALOGUE = "catalogue.toml"
"""The file in the models folder that adds a user's own models to the catalogue."""

_MEGABYTE = 1e6
"""Bytes, as publishers count them."""

_PATH = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
"""A plain file name: no folder, no hidden file."""

_REFUSED_SUFFIXES = (".pt", ".pth", ".pkl", ".pickle", ".bin", ".ckpt", ".joblib")
"""Formats that may run code when they are loaded (Python's pickle); they are never loaded, so never downloaded."""

ModelName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9._-]*$", max_length=64)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class CatalogueFile(_Strict):
    """One file of a model. `size` is exact, in bytes; `megabytes` is what the publisher says, where that is all there
    is. Without a `sha256` nobody can tell a wrong file from the right one.
    """

    path: str = Field(description="name of the file in the model's folder")
    url: str
    size: int | None = Field(default=None, gt=0)
    megabytes: float | None = Field(default=None, gt=0)
    sha256: str | None = Field(default=None, pattern=r"^[0-9a-f]{64}$")

    @field_validator("path")
    @classmethod
    def _plain_name(cls, path: str) -> str:
        if not _PATH.fullmatch(path):
            raise ValueError("no plain file name")
        if path.endswith(_REFUSED_SUFFIXES):
            raise ValueError("a format that may run code when it is loaded: use ONNX")
        return path

    @field_validator("url")
    @classmethod
    def _web_address(cls, url: str) -> str:
        parts = urlsplit(url)
        if parts.scheme not in {"http", "https"} or not parts.netloc:
            raise ValueError("no http or https address")
        return url

    @property
    def about_bytes(self) -> int | None:
        """Its size in bytes as far as it is known."""
        return self.size if self.size is not None or self.megabytes is None else round(self.megabytes * _MEGABYTE)


class CatalogueModel(_Strict):
    """One model; its first file is the network."""

    name: ModelName
    task: str
    backend: str | None = Field(default=None, description="the plugin's backend that runs it")
    summary: str = ""
    licence: str = Field(description="SPDX identifier, or the licence's name")
    licence_url: str = ""
    accept: bool = Field(default=False, description="only with --accept-license")
    source: str = Field(default="", description="the page that publishes it")
    citation: str = ""
    unchecked: str | None = Field(default=None, description="what was not checked when the entry was written")
    file: tuple[CatalogueFile, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _one_file_one_name(self) -> CatalogueModel:
        if len({each.path for each in self.file}) < len(self.file):
            raise ValueError("two files of one name")
        return self

    @property
    def about_bytes(self) -> int | None:
        """The size of all files whose size is known; `None` where none is."""
        known = [each.about_bytes for each in self.file if each.about_bytes is not None]
        return sum(known) if known else None


class Catalogue(_Strict):
    """All models; no two have one name."""

    model: tuple[CatalogueModel, ...] = ()

    @model_validator(mode="after")
    def _one_model_one_name(self) -> Catalogue:
        names = [model.name for model in self.model]
        if doubles := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two models of one name: {', '.join(doubles)}")
        return self

    def names(self) -> tuple[str, ...]:
        """All names, in the order of the file."""
        return tuple(model.name for model in self.model)

    def find(self, name: str) -> CatalogueModel | None:
        """The model of that name."""
        return next((model for model in self.model if model.name == name), None)

    def get(self, name: str) -> CatalogueModel:
        """The model of that name. Raises `ModelError` naming those that there are."""
        if (model := self.find(name)) is None:
            known = ", ".join(self.names())
            raise ModelError(f"no model is called {name!r}", cure=f"known: {known}; see `supermap models list`")
        return model

    def of_backend(self, backend: str) -> tuple[CatalogueModel, ...]:
        """The models that a backend runs, in the order of the file: the one to begin with comes first."""
        return tuple(model for model in self.model if model.backend == backend)


def load_catalogue() -> Catalogue:
    """The shipped catalogue with the user's own models (`catalogue.toml` in the models folder).

    Raises `ModelError` naming the file and the entry that is wrong.
    """
    shipped = shipped_catalogue()
    path = models_folder() / OWN_CATALOGUE
    if not path.exists():
        return shipped
    own = parse_catalogue(read_text(path, ModelError, what="a TOML file with models, or move it away"), str(path))
    if doubles := sorted(set(own.names()) & set(shipped.names())):
        raise ModelError(
            f"models that the catalogue has already: {', '.join(doubles)}", where=str(path), cure="call yours otherwise"
        )
    return Catalogue(model=shipped.model + own.model)


@cache
def shipped_catalogue() -> Catalogue:
    """The models that SuperMap knows of."""
    text = files("supermap_cli.weights").joinpath("catalogue.toml").read_text(encoding="utf-8")
    return parse_catalogue(text, "catalogue.toml")


def parse_catalogue(text: str, where: str) -> Catalogue:
    """A catalogue as TOML. Raises `ModelError` naming what is wrong."""
    try:
        return Catalogue.model_validate(tomllib.loads(text))
    except ValidationError as error:
        entry, what = wrong_entry(error)
        raise ModelError(f"{'.'.join(entry)}: {what}", where=where, cure="correct the entry") from error
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise ModelError(f"not a TOML file: {error}", where=where, cure="correct it, or move it away") from error
