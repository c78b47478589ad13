"""Runs the command line in this process."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from typer.testing import CliRunner, Result

from supermap_cli.main import make_app
from supermap_schema.json_schemas import load_schema


def supermap(*arguments: str | Path, stdin: str | None = None) -> Result:
    """What a command gives; errors that `main` would catch stay in `Result.exception`."""
    return CliRunner().invoke(make_app(), [str(each) for each in arguments], input=stdin)


def document(schema: str, *arguments: str | Path, exit_code: int = 0) -> Any:
    """What a command prints with --json, valid by its published schema."""
    result = supermap(*arguments, "--json")
    assert result.exit_code == exit_code, result.output
    printed = json.loads(result.stdout)
    Draft202012Validator(load_schema(schema)).validate(printed)
    return printed
