"""What several commands share: options, consoles, JSON output."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.config import load_user_config

if TYPE_CHECKING:
    from rich.console import Console

DEFAULT_DB = "supermap.db"

DbOption = Annotated[
    str | None,
    typer.Option(
        "--db",
        metavar="PATH_OR_URL",
        help=f"The map database: a SQLite file or a database URL. [default: $SUPERMAP_DB, else {DEFAULT_DB}]",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON by the published schema instead of a table.")]


def database_url(given: str | None) -> str:
    """The database to use: the option, else `SUPERMAP_DB`, else `supermap.toml`, else `supermap.db` here."""
    return given or os.environ.get("SUPERMAP_DB") or load_user_config(Path.cwd()).db or DEFAULT_DB


def out() -> Console:
    """The console for results (stdout)."""
    from rich.console import Console  # noqa: PLC0415 - keeps start-up light

    return Console(highlight=False, soft_wrap=not sys.stdout.isatty())


def err() -> Console:
    """The console for everything that is no result (stderr)."""
    from rich.console import Console  # noqa: PLC0415 - keeps start-up light

    return Console(stderr=True, highlight=False, soft_wrap=not sys.stderr.isatty())


def print_json(value: object) -> None:
    """Print a JSON document on stdout."""
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False))
