"""`supermap models`: list, pull, path, verify, remove the weights of networks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from supermap_cli.commands.common import JsonOption, err, interrupt_on_sigterm, out, print_json
from supermap_cli.commands.tables import print_table
from supermap_cli.errors import ConfigError, ModelError

if TYPE_CHECKING:
    from supermap_cli.weights.catalogue import CatalogueFile, CatalogueModel
    from supermap_cli.weights.pulling import FileCheck, Watch

MIRROR_VARIABLE = "SUPERMAP_MODELS_MIRROR"
"""Environment variable: what --from says where it is not given."""

EXAMPLES = """
Examples:

    supermap models list

    supermap models pull yolox-nano

    supermap models pull grounding-dino --from /media/usb/models

    supermap build run.mcap --option onnx.model=$(supermap models path yolox-nano)
"""
EXAMPLE = "\nExample:\n\n    supermap models {}\n"

NameArgument = Annotated[str, typer.Argument(metavar="NAME", help="A model of `supermap models list`.")]
NamesArgument = Annotated[
    list[str] | None, typer.Argument(metavar="[NAME]...", help="Models of `supermap models list`. [default: all here]")
]


def register(app: typer.Typer) -> None:
    """Add the group to the app."""
    group = typer.Typer(no_args_is_help=True, help="Get the weights of networks; SuperMap ships none.", epilog=EXAMPLES)
    group.command("list", epilog=EXAMPLE.format("list --json"))(list_models)
    group.command(epilog=EXAMPLE.format("pull yolox-nano"))(pull)
    group.command(epilog=EXAMPLE.format("path yolox-nano"))(path)
    group.command(epilog=EXAMPLE.format("verify yolox-nano"))(verify)
    group.command(epilog=EXAMPLE.format("remove yolox-nano"))(remove)
    app.add_typer(group, name="models")


def list_models(json: JsonOption = False) -> None:
    """List the models of the catalogue: what they do, their licences, their sizes, and which are here."""
    from supermap_cli.weights.catalogue import load_catalogue  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.weights.folder import models_folder  # noqa: PLC0415
    from supermap_cli.weights.model_file import is_here  # noqa: PLC0415

    models = load_catalogue().model
    if json:
        print_json(
            {"folder": str(models_folder()), "models": [_as_json(model, here=is_here(model)) for model in models]}
        )
        return
    rows = [
        (
            model.name,
            "yes" if is_here(model) else "",
            model.task,
            model.licence + (" (--accept-license)" if model.accept else ""),
            _megabytes(model.about_bytes),
        )
        for model in models
    ]
    print_table(out(), f"models in {models_folder()}", ("name", "here", "task", "licence", "MB#"), rows)


def pull(
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Models of `supermap models list`.")],
    from_: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="DIR|URL",
            help="A folder, or a mirror's address, that has the files at NAME/FILE. [default: $SUPERMAP_MODELS_MIRROR, "
            "else the publishers]",
            show_default=False,
        ),
    ] = None,
    accept_license: Annotated[
        bool, typer.Option("--accept-license", help="You have read the licence that is shown, and accept it.")
    ] = False,
) -> None:
    """Download models into the user's data folder: resumed where it broke off, checked, put in place as a whole.

    Proxies are those of the environment (https_proxy, no_proxy).
    """
    from supermap_cli.weights.catalogue import load_catalogue  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.weights.pulling import pull as pull_model  # noqa: PLC0415

    if from_ is not None and not from_.strip():
        raise ConfigError("--from names nothing", cure="name a folder or an address, or leave it out")
    origin = from_ or os.environ.get(MIRROR_VARIABLE) or None
    catalogue = load_catalogue()
    models = [catalogue.get(name) for name in dict.fromkeys(names)]
    for model in models:
        _tell_licence(model, accepted=accept_license)
    interrupt_on_sigterm()
    for model in models:
        with _progress() as watch:
            pulled = pull_model(model, origin, watch)
        for file in pulled:
            if file.fetched and not file.checked:
                warning = f"warning: {file.path.name} of {model.name} could not be checked: the catalogue has no digest"
                err().print(warning, markup=False)
        how = "is here" if any(file.fetched for file in pulled) else "was here already"
        out().print(f"{model.name} {how}: {pulled[0].path.parent}", markup=False)


def path(
    name: NameArgument,
    file: Annotated[str | None, typer.Option(metavar="FILE", help="Another file of it, as tokenizer.json.")] = None,
) -> None:
    """Print where the network of a model lies."""
    from supermap_cli.weights.model_file import model_file  # noqa: PLC0415 - keeps start-up light

    typer.echo(model_file(name, file))


def verify(names: NamesArgument = None, json: JsonOption = False) -> None:
    """Compare models with the catalogue's sizes and digests; exit code 1 if any file is missing or another."""
    from supermap_cli.weights.pulling import verify as verify_model  # noqa: PLC0415 - keeps start-up light

    checks = {model.name: verify_model(model) for model in _chosen(names)}
    wrong = any(each.state in {"changed", "missing"} for found in checks.values() for each in found)
    if json:
        print_json({"models": [{"name": name, "files": _checks_json(found)} for name, found in checks.items()]})
    elif not checks:
        out().print("no model is here: see `supermap models list`", markup=False)
    else:
        rows = [(name, each.path.name, each.state, each.what) for name, found in checks.items() for each in found]
        print_table(out(), "", ("model", "file", "state", ""), rows)
    if wrong:
        raise typer.Exit(1)


def remove(names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Models that are here.")]) -> None:
    """Remove models from this machine."""
    from supermap_cli.weights.catalogue import load_catalogue  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.weights.pulling import remove as remove_model  # noqa: PLC0415

    catalogue = load_catalogue()
    for model in [catalogue.get(name) for name in dict.fromkeys(names)]:
        freed, folder = remove_model(model)
        out().print(f"{model.name} is removed from {folder}: {freed / 1e6:.1f} MB", markup=False)


def _chosen(names: list[str] | None) -> list[CatalogueModel]:
    """The models named, else all of which a file is here."""
    from supermap_cli.weights.catalogue import load_catalogue  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.weights.folder import models_folder  # noqa: PLC0415

    catalogue = load_catalogue()
    if names:
        return [catalogue.get(name) for name in dict.fromkeys(names)]
    folder = models_folder()
    return [model for model in catalogue.model if any((folder / model.name / f.path).is_file() for f in model.file)]


def _tell_licence(model: CatalogueModel, *, accepted: bool) -> None:
    """Show a model's licence; raise `ModelError` where it has to be accepted and is not."""
    shown = f"{model.licence}, {model.licence_url}" if model.licence_url else model.licence
    if model.accept and not accepted:
        raise ModelError(
            f"{model.name} is under the licence {shown}, which asks for more than to be named",
            cure="read it, and say --accept-license if you accept it",
        )
    console = err()
    console.print(f"{model.name}: {model.licence} ({model.licence_url or 'no page given'})", markup=False)
    if model.citation:
        console.print(f"  cite: {model.citation}", markup=False)
    if model.unchecked:
        console.print(f"  not checked: {model.unchecked}", markup=False)


@contextmanager
def _progress() -> Iterator[Watch]:
    """A bar for each file, with speed and time left, on stderr; in a pipe a line for each file."""
    from rich.progress import (  # noqa: PLC0415 - keeps start-up light
        BarColumn,
        DownloadColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )

    console = err()
    columns: tuple[Any, ...] = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:

        def watch(file: CatalogueFile) -> Callable[[int, int | None], None]:
            if not console.is_terminal:
                console.print(
                    f"getting {file.path} ({_megabytes(file.about_bytes) or 'unknown size'} MB)", markup=False
                )
            task = bar.add_task(file.path, total=file.about_bytes)

            def advance(done: int, total: int | None) -> None:
                bar.update(task, completed=done, total=total)

            return advance

        yield watch


def _megabytes(size: int | None) -> str:
    return "" if size is None else f"{size / 1e6:.1f}"


def _as_json(model: CatalogueModel, *, here: bool) -> dict[str, object]:
    fields = model.model_dump(mode="json")
    files = fields.pop("file")
    return {**fields, "files": files, "here": here}


def _checks_json(checks: tuple[FileCheck, ...]) -> list[dict[str, object]]:
    return [{"path": str(each.path), "state": each.state, "what": each.what} for each in checks]
