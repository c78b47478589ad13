"""`supermap config`: show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import JsonOption, out, print_json
from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from pydantic import BaseModel

    from supermap_cli.config import UserConfig

EXAMPLES = """
Examples:

    supermap config show

    supermap config show drift

    supermap config show --json
"""

_UNITS = {"hz": "Hz", "s": "s", "m": "m", "px": "px"}
"""What an entry's name ends with -> its unit."""


@dataclass(frozen=True)
class ConfigRow:
    """One entry of the configuration. `section` is its table in `supermap.toml`, "" the top; `source` says where a
    parameter's default comes from.
    """

    section: str
    name: str
    value: object
    default: object
    unit: str
    meaning: str
    source: str
    overridden: bool


def register(app: typer.Typer) -> None:
    """Add the group to the app."""
    group = typer.Typer(no_args_is_help=True, help="What decides what a build gives.", epilog=EXAMPLES)
    group.command(epilog=EXAMPLES)(show)
    group.callback()(_group)
    app.add_typer(group, name="config")


def _group() -> None:
    """What decides what a build gives."""


def show(
    section: Annotated[
        str | None, typer.Argument(help="Only this section, e.g. keyframes, or file of the method, e.g. drift.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Show all entries of the configuration and all parameters of the method, with the values of ./supermap.toml.

    `*` marks what the file changes. Parameters are set under `[build.parameters.FILE]`.
    """
    from supermap_cli.config import load_user_config  # noqa: PLC0415 - keeps start-up light

    rows = list(config_rows(load_user_config(Path.cwd())))
    if section is not None:
        rows = _of_section(rows, section)
    if json:
        print_json({"entries": [asdict(row) for row in rows]})
        return
    for name, group in _by_section(rows):
        parameters = name.startswith("build.parameters.")
        columns = ("name", "", "value#", "unit", "meaning", *(("source",) if parameters else ()))
        lines = [
            (
                row.name,
                "*" if row.overridden else "",
                _text(row.value),
                row.unit,
                row.meaning,
                *((row.source,) if parameters else ()),
            )
            for row in group
        ]
        print_table(out(), f"[{name}]" if name else "supermap.toml", columns, lines)


def config_rows(config: UserConfig) -> Iterator[ConfigRow]:
    """Every entry of a configuration, then every parameter of the method.

    Raises `ConfigError` for a parameter that is not known or has a wrong value.
    """
    from supermap_cli.parameters import MethodParameters  # noqa: PLC0415 - heavy

    yield from _section_rows("", config)
    for row in MethodParameters.from_overrides(config.build.parameters).describe():
        yield ConfigRow(
            f"build.parameters.{row.file}",
            row.name,
            _plain(row.value),
            _plain(row.default),
            row.unit,
            row.meaning,
            row.source,
            row.overridden,
        )


def _section_rows(section: str, values: BaseModel) -> Iterator[ConfigRow]:
    """The entries of a section, then those of the sections in it."""
    from pydantic import BaseModel  # noqa: PLC0415 - keeps start-up light

    dumped = values.model_dump(mode="json")
    inner = []
    for name, field in type(values).model_fields.items():
        value = getattr(values, name)
        if isinstance(value, BaseModel):
            inner.append((f"{section}.{name}".lstrip("."), value))
            continue
        if (section, name) == ("build", "parameters"):
            continue
        default = field.get_default(call_default_factory=True)
        yield ConfigRow(
            section,
            name,
            dumped[name],
            _plain(default),
            _UNITS.get(name.rpartition("_")[2], "") if "_" in name else "",
            field.description or "",
            "",
            value != default,
        )
    for inner_section, inner_values in inner:
        yield from _section_rows(inner_section, inner_values)


def _of_section(rows: list[ConfigRow], wanted: str) -> list[ConfigRow]:
    """The rows of one section, by the last part of its name. Raises `ConfigError` if there is none."""
    from difflib import get_close_matches  # noqa: PLC0415 - keeps start-up light

    from supermap_cli.errors import ConfigError  # noqa: PLC0415

    chosen = [row for row in rows if wanted in {row.section, row.section.rpartition(".")[2]}]
    if not chosen:
        known = dict.fromkeys(row.section.rpartition(".")[2] for row in rows if row.section)
        near = get_close_matches(wanted, known, n=3, cutoff=0.5)
        hint = f"; is it {' or '.join(near)}?" if near else ""
        raise ConfigError(f"there is no section {wanted}{hint}", cure=f"there are {', '.join(known)}")
    return chosen


def _by_section(rows: Iterable[ConfigRow]) -> Iterator[tuple[str, list[ConfigRow]]]:
    """Rows in groups of one section, in their order."""
    groups: dict[str, list[ConfigRow]] = {}
    for row in rows:
        groups.setdefault(row.section, []).append(row)
    yield from groups.items()


def _plain(value: object) -> object:
    """A value as JSON has it."""
    return list(value) if isinstance(value, tuple) else value


def _text(value: object) -> str:
    """A value as TOML has it, but for tables; nothing for none."""
    if value is None or value in ({}, []):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return f"[{', '.join(_text(part) for part in value)}]"
    if isinstance(value, dict):
        return ", ".join(f"{key} = {_text(part)}" for key, part in value.items())
    return str(value)
