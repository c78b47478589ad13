"""What the README promises: its configuration table, its commands, its examples and its links are those of the code."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from supermap_cli.config import UserConfig
from supermap_cli.main import make_app

CHECKOUT = Path(__file__).resolve().parents[1]
DOCUMENTS = (
    *("README.md", "ARCHITECTURE.md", "CHANGELOG.md"),
    *("examples/supermap-example-detector/README.md", "examples/simulated_office/README.md"),
    "examples/simulated_office/run.sh",
)
COMMANDS = re.compile(r"^(?:\$ |    )?supermap (.+)$", re.MULTILINE)


def text_of(document: str) -> str:
    return (CHECKOUT / document).read_text(encoding="utf-8")


def entries(section: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Every entry of a `supermap.toml` that is no section."""
    for name, field in section.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from entries(field.annotation, f"{prefix}{name}.")
        else:
            yield prefix + name, field


def table_row(name: str, field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    shown = str(default).lower() if isinstance(default, bool) else str(default)
    return f"| `{name}` | {f'`{shown}`' if default not in (None, {}, ()) else ''} | {field.description} |"


def invocations() -> list[tuple[str, str]]:
    """(document, what follows `supermap`) of every command in the documents."""
    return [(document, line) for document in DOCUMENTS for line in COMMANDS.findall(text_of(document))]


@pytest.mark.parametrize(
    ("name", "field"), list(entries(UserConfig)), ids=lambda each: each if isinstance(each, str) else ""
)
def test_every_entry_of_the_configuration_is_in_the_readme(name, field):
    assert table_row(name, field) in text_of("README.md").splitlines()


def test_the_example_configuration_is_valid():
    (example,) = re.findall(r"```toml\n(.+?)```", text_of("README.md"), re.DOTALL)
    assert UserConfig.model_validate(tomllib.loads(example)) != UserConfig()


@pytest.mark.parametrize(("document", "line"), invocations())
def test_commands_and_options_in_the_documents_exist(document, line):
    command = typer.main.get_command(make_app())
    words = line.split("#")[0].split()
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    if hasattr(command, "unless_named") and words[:1] != ["--help"]:
        command = command.commands[command.unless_named]
    known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
    assert {word for word in words if word.startswith("--")} <= known
    assert not getattr(command, "commands", {}) or words[0] in known


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document):
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", text_of(document))
    assert [link for link in links if not (CHECKOUT / document).parent.joinpath(link).exists()] == []


def test_architecture_names_modules_that_exist():
    named = set(re.findall(r"`((?:supermap_cli|plugins|schema|tests|examples)/[\w/.-]+)`", text_of("ARCHITECTURE.md")))
    assert named
    assert {path for path in named if not (CHECKOUT / path).exists()} == set()
