"""`supermap plugins`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from supermap_cli.commands.common import JsonOption, out, print_json

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from supermap_cli.hookspecs import Options
    from supermap_cli.plugin_manager import Plugins


EXAMPLES = """
Examples:

    supermap plugins

    supermap plugins --json
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("plugins", epilog=EXAMPLES)(plugins)


def plugins(json: JsonOption = False) -> None:
    """List the installed plugins, what they offer with which options, and those that are broken."""
    from supermap_cli.plugin_manager import load_plugins  # noqa: PLC0415 - keeps start-up light

    loaded = load_plugins()
    if json:
        print_json(as_json(loaded))
        return
    console = out()
    console.print(_plugin_table(loaded))
    _print_backends(console, loaded)
    for conflict in _conflicts(loaded):
        console.print(f"[yellow]doubly named[/]: {conflict}")
    for broken in loaded.broken:
        console.print(f"[red]broken[/]: {broken.name} of {broken.distribution} {broken.version}:", end=" ")
        console.print(broken.error, markup=False)


def as_json(loaded: Plugins) -> dict[str, object]:
    """The whole list as JSON values."""
    return {
        "plugins": [
            {
                "name": plugin.name,
                "distribution": plugin.distribution,
                "version": plugin.version,
                "hooks": list(plugin.hooks),
                "backends": [
                    {"kind": backend.kind, "name": backend.name, "options": _options(backend.options)}
                    for backend in plugin.backends
                ],
            }
            for plugin in loaded.working
        ],
        "broken": [
            {"name": plugin.name, "distribution": plugin.distribution, "version": plugin.version, "error": plugin.error}
            for plugin in loaded.broken
        ],
        "conflicts": _conflicts(loaded),
    }


def _conflicts(loaded: Plugins) -> list[str]:
    from supermap_cli.plugin_manager import conflict_message  # noqa: PLC0415 - keeps start-up light

    return [conflict_message(claims) for registry in loaded.registries for claims in registry.conflicts()]


def _options(model: type[Options]) -> list[dict[str, Any]]:
    """Each option's name, default and description; one without default is required."""
    return [
        {
            "name": name,
            "required": field.is_required(),
            "default": None if field.is_required() else _json_value(field.get_default(call_default_factory=True)),
            "description": field.description or "",
        }
        for name, field in model.model_fields.items()
    ]


def _json_value(value: object) -> object:
    """A default as a JSON value."""
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _plugin_table(loaded: Plugins) -> Table:
    from rich.table import Table  # noqa: PLC0415 - keeps start-up light

    table = Table("plugin", "distribution", "version", "hooks", box=None, padding=(0, 2, 0, 0))
    for plugin in loaded.working:
        table.add_row(plugin.name, plugin.distribution, plugin.version, ", ".join(plugin.hooks))
    return table


def _print_backends(console: Console, loaded: Plugins) -> None:
    """Each backend with its options as `--option` takes them."""
    from rich.table import Table  # noqa: PLC0415 - keeps start-up light

    backends = [(plugin, backend) for plugin in loaded.working for backend in plugin.backends]
    for plugin, backend in sorted(backends, key=lambda pair: (pair[1].kind, pair[1].name)):
        console.print(f"\n{backend.kind} [bold]{backend.name}[/] (plugin {plugin.name})")
        options = Table.grid(padding=(0, 2))
        for option in _options(backend.options):
            default = "" if option["default"] is None else option["default"]
            value = "... (required)" if option["required"] else default
            options.add_row("", f"{backend.name}.{option['name']}={value}", option["description"])
        if options.row_count:
            console.print(options)
