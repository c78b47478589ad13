"""What the documents promise: commands run, links lead somewhere, and every table is the code's."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer.main
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from supermap_cli import hookspecs
from supermap_cli.config import UserConfig
from supermap_cli.main import make_app
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.recordings.roles import ROLES
from supermap_schema.json_schemas import load_schema, schema_names
from supermap_schema.models import Base
from supermap_schema.views import VIEW_NAMES
from support import kitchen
from support import memories as m
from support.cli import supermap

CHECKOUT = Path(__file__).resolve().parents[1]
PAGES = tuple(sorted(path.relative_to(CHECKOUT).as_posix() for path in (CHECKOUT / "docs").glob("*.md")))
DOCUMENTS = (
    *("README.md", "ARCHITECTURE.md", "CHANGELOG.md"),
    *PAGES,
    *("examples/supermap-example-detector/README.md", "examples/simulated_office/README.md"),
    "examples/simulated_office/run.sh",
)
NAMING_FILES = ("ARCHITECTURE.md", *(page for page in PAGES if "internals" in page))
COMMANDS = re.compile(r"^(?:\$ |    )?supermap (.+)$", re.MULTILINE)
READING = {"show", "query", "history", "diff", "export", "plugins", "db info", "db check", "db sql", "db vacuum"}
"""Commands that need nothing but a map; they are run, all others are parsed."""


def text_of(document: str) -> str:
    return (CHECKOUT / document).read_text(encoding="utf-8")


def section_of(document: str, heading: str) -> str:
    """The text below a heading, up to the next one."""
    found = re.search(rf"^#+ {re.escape(heading)}\n(.+?)(?=^#+ |\Z)", text_of(document), re.DOTALL | re.MULTILINE)
    assert found is not None, f"{document} has no section {heading!r}"
    return found[1]


def first_column(table: str) -> list[str]:
    """The entries in backticks that begin the rows of a table."""
    return re.findall(r"^\| `([^`]+)`", table, re.MULTILINE)


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


def words_of(line: str) -> list[str]:
    """The arguments of a command as a shell passes them on."""
    words = shlex.split(line.partition(" > ")[0], comments=True)
    return words[: words.index("|")] if "|" in words else words


def invocations() -> list[tuple[str, str]]:
    """(document, what follows `supermap`) of every command in the documents."""
    return [(document, line) for document in DOCUMENTS for line in COMMANDS.findall(text_of(document))]


def reading_lines() -> list[str]:
    """Every command of the README and of the pages that a map alone can answer, once."""
    lines = [line for document, line in invocations() if document == "README.md" or document in PAGES]
    only_reading = (line for line in lines if any(line.startswith(f"{name} ") or line == name for name in READING))
    return sorted({line for line in only_reading if "postgresql" not in line})


# Sizes


@pytest.mark.parametrize(("document", "kilobytes"), [("README.md", 9), ("ARCHITECTURE.md", 21)])
def test_the_first_documents_stay_short(document: str, kilobytes: int) -> None:
    assert (CHECKOUT / document).stat().st_size <= kilobytes * 1024


def test_pictures_stay_small() -> None:
    pictures = [path for path in (CHECKOUT / "docs").iterdir() if path.suffix != ".md"]
    assert pictures
    assert [path.name for path in pictures if path.stat().st_size > 150_000] == []


# Tables


def test_the_configuration_table_is_that_of_the_code() -> None:
    rows = [line for line in text_of("docs/configuration.md").splitlines() if line.startswith("| `")]
    assert rows == [table_row(name, field) for name, field in entries(UserConfig)]


def test_the_example_configuration_is_valid() -> None:
    (example,) = re.findall(r"```toml\n(.+?)```", text_of("docs/configuration.md"), re.DOTALL)
    assert UserConfig.model_validate(tomllib.loads(example)) != UserConfig()


def test_every_hook_is_listed() -> None:
    hooks = {name for name, function in vars(hookspecs).items() if hasattr(function, "supermap_spec")}
    assert set(first_column(section_of("docs/plugins.md", "What a plugin can add"))) == hooks


def test_every_role_of_a_topic_is_named() -> None:
    topics = section_of("docs/recordings.md", "Topics, frames and cameras")
    assert {role for role in ROLES if f"`{role}`" not in topics} == set()


def test_every_verdict_of_a_diff_is_explained() -> None:
    rows = re.findall(r"^\| ([a-z ]+) \|", section_of("docs/changes.md", "The ten verdicts"), re.MULTILINE)
    kinds = set(re.findall(r"'enum': \[([^\]]+)\]", str(load_schema("diff"))))
    assert ", ".join(repr(kind) for kind in rows if kind != "verdict") in kinds


def test_every_table_and_view_of_the_database_is_described() -> None:
    tables = first_column(section_of("docs/internals-database.md", "Tables"))
    assert set(tables) == set(Base.metadata.tables)
    assert [view for view in VIEW_NAMES if f"`{view}`" not in text_of("docs/database.md")] == []


# Python


def example_in(page: str) -> dict[str, object]:
    """What a page's Python example defines."""
    (example,) = re.findall(r"```python\n(.+?)```", text_of(page), re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(example, page, "exec"), names)  # noqa: S102 - our own page
    return names


def test_the_example_plugin_registers_a_detector() -> None:
    loaded = load_plugins([SimpleNamespace(register_detectors=example_in("docs/plugins.md")["register_detectors"])])
    assert any("mine" in registry for registry in loaded.registries)


def test_the_schemas_that_the_example_names_exist() -> None:
    example_in("docs/programs.md")
    page = section_of("docs/programs.md", "JSON from every command")
    (named,) = re.findall(r"schema_names\(\)  # (.+), \.\.\.", page)
    assert set(re.findall(r"\w+", re.sub(r"\(.*?\)", "", named))) <= set(schema_names())


# Commands


@pytest.mark.parametrize(("document", "line"), invocations())
def test_every_command_in_the_documents_is_understood(document: str, line: str) -> None:
    """Its options exist, their values fit, and no argument is missing."""
    command = typer.main.get_command(make_app())
    words = words_of(line)
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    if hasattr(command, "default_command") and words[:1] != ["--help"]:
        command = command.commands[command.default_command]
    known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
    assert {word for word in words if word.startswith("--")} <= known
    if getattr(command, "commands", {}):
        assert words[0] in known
    elif "$" not in line and "--help" not in words:
        command.make_context(command.name, words)


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders with an office.db, by the name of its first traversal."""
    folders = {}
    for first, second in (("run", "next-day"), ("monday", "tuesday")):
        folder = tmp_path_factory.mktemp(first)
        visits = ((first, (0, 100), kitchen.monday), (second, (1000, 1100), kitchen.tuesday))
        m.make_memory(folder / "office.db", *visits)
        folders[first] = folder
    return folders


@pytest.mark.parametrize("line", reading_lines())
def test_commands_that_ask_a_map_answer(line: str, maps: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(maps["monday" if "monday" in line else "run"])
    monkeypatch.setenv("SUPERMAP_DB", "office.db")
    words = words_of(line)
    overwriting = ["--force"] if words[0] == "export" else []
    result = supermap(*words, *overwriting)
    assert (result.exit_code, result.exception) == (0, None), result.output
    assert result.stdout or words[0] == "export"


# Links and names


def anchors_of(document: Path) -> set[str]:
    """The anchors that GitHub makes of headings."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document: str) -> None:
    broken = []
    for link in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text_of(document)):
        name, _, anchor = link.partition("#")
        target = (CHECKOUT / document).parent / name if name else CHECKOUT / document
        if not target.exists() or (anchor and anchor not in anchors_of(target)):
            broken.append(link)
    assert broken == []


@pytest.mark.parametrize("page", PAGES)
def test_every_page_is_linked_from_the_first_documents(page: str) -> None:
    assert f"]({page}" in text_of("README.md") + text_of("ARCHITECTURE.md")


@pytest.mark.parametrize("document", NAMING_FILES)
def test_files_that_the_internals_name_exist(document: str) -> None:
    named = set(re.findall(r"`((?:supermap_cli|plugins|schema|tests|examples)/[\w/.-]+)`", text_of(document)))
    assert named
    assert {path for path in named if not (CHECKOUT / path).exists()} == set()


def test_the_layers_of_the_architecture_are_those_of_the_import_contract() -> None:
    (diagram,) = re.findall(r"^    main -> (?:.+\n)+", text_of("ARCHITECTURE.md"), re.MULTILINE)
    contract = tomllib.loads(text_of("pyproject.toml"))["tool"]["importlinter"]["contracts"][0]["layers"]
    assert " ".join(diagram.split()) == " -> ".join(layer.replace(" |", ",") for layer in contract)


def test_the_tree_of_the_architecture_names_modules_that_exist() -> None:
    """Indentation says in which folder a name of the tree lies."""
    lines = re.findall(
        r"^    ( *)([a-z_*]+(?:/[a-z_*]+)*(?:\.py|/)) ", section_of("ARCHITECTURE.md", "Code layout"), re.MULTILINE
    )
    folders: list[str] = []
    missing = []
    for indentation, name in lines:
        folders[len(indentation) // 2 :] = [name.rstrip("/")]
        if not list(CHECKOUT.glob("/".join(folders))):
            missing.append("/".join(folders))
    assert len(lines) > 20
    assert missing == []
