"""What plugins add to the command line: commands, and functions for `supermap db sql`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from supermap_cli.commands.streams import BROKEN_PIPE, JSON_ERRORS, flags_first
from supermap_cli.errors import STUMBLES, PluginError, SupermapError, UsageError
from supermap_cli.printable import printable_line

if TYPE_CHECKING:
    import sqlite3

    from supermap_cli.plugin_manager import Plugin


_CLICK_ERROR: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")
"""Click's base of usage errors, or that of typer's copy of it."""


class CommandGroup(TyperGroup):
    """The built-in commands, and those of plugins: these are loaded only for help and for a name that is not built in.

    Contexts and commands are `Any`, because some versions of typer have Click's classes and others a copy of them.
    """

    _has_those_of_plugins = False

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Global flags may stand anywhere."""
        return list(super().parse_args(ctx, flags_first(args)))

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run the command line. A usage that is not understood is a `UsageError` where errors are asked for as JSON."""
        if JSON_ERRORS not in sys.argv or not extra.get("standalone_mode", True):
            return super().main(*args, **extra)
        try:
            code = super().main(*args, **{**extra, "standalone_mode": False})
        except _CLICK_ERROR as error:
            what = str(error.format_message()).strip().rstrip(".") or "a command is missing"
            raise UsageError(what, cure=f"see {_command_of(error)} --help") from error
        except typer.Abort as error:
            raise SupermapError("aborted", cure="answer the question, or give the option that does") from error
        sys.exit(code if isinstance(code, int) else 0)

    def invoke(self, ctx: Any) -> Any:
        """Run the command. What it stumbles over is the map's fault if the map breaks its own invariants, else ours."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise typer.Exit(BROKEN_PIPE) from None
        except Exception as error:
            if (explained := _failing_plugin(error) or _damaged_map(error)) is None:
                raise
            raise explained from error
        finally:
            if (opening := sys.modules.get("supermap_cli.memory.opening")) is not None:
                opening.OPENED.clear()

    def list_commands(self, ctx: Any) -> list[str]:
        """The names of all commands, the built-in ones first."""
        self._add_those_of_plugins()
        return super().list_commands(ctx)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of that name, or `None`."""
        if cmd_name not in self.commands:
            self._add_those_of_plugins()
        return super().get_command(ctx, cmd_name)

    def _add_those_of_plugins(self) -> None:
        if self._has_those_of_plugins:
            return
        self._has_those_of_plugins = True
        for plugin in _implementing("register_commands"):
            with _told_if_it_fails(plugin, "its commands are left out"):
                for name, command in _commands_of(plugin).items():
                    if name in self.commands:
                        _warn(plugin, f"its command {name!r} is left out: there is one of that name already")
                    else:
                        self.commands[name] = command


def _command_of(error: Any) -> str:
    """The command that a usage error is of: "supermap build"."""
    context = getattr(error, "ctx", None)
    return "supermap" if context is None else f"supermap {' '.join(context.command_path.split()[1:])}".strip()


def _damaged_map(error: Exception) -> SupermapError | None:
    """The error that a map is damaged, where code stumbled over what it holds."""
    opening = sys.modules.get("supermap_cli.memory.opening")
    if not isinstance(error, STUMBLES) or opening is None or not opening.OPENED:
        return None
    from supermap_cli.memory.blame import damage_of_opened_maps  # noqa: PLC0415 - keeps start-up light

    return damage_of_opened_maps()


def _failing_plugin(error: Exception) -> SupermapError | None:
    """The error that names a third party's plugin, where an exception that is no `SupermapError` came from its code."""
    if isinstance(error, SupermapError) or "supermap_cli.plugin_manager" not in sys.modules:
        return None
    from supermap_cli.plugin_manager import packages_of_plugins  # noqa: PLC0415 - keeps start-up light

    packages, blamed = packages_of_plugins(), None
    cause: BaseException | None = error
    while cause is not None:  # a StopIteration of a plugin comes as a RuntimeError of whose generator it ended
        at = cause.__traceback__
        while at is not None:
            package = str(at.tb_frame.f_globals.get("__name__", "")).partition(".")[0]
            blamed, at = packages.get(package, blamed), at.tb_next
        cause = cause.__cause__
    if blamed is None:
        return None
    return PluginError(
        f"the plugin {blamed} failed: {type(error).__name__}: {error}",
        cure="--debug shows where; tell its authors, or do without it (see `supermap plugins`)",
    )


def add_sql_functions(connection: sqlite3.Connection) -> None:
    """Let all plugins prepare a connection; those that fail are told on stderr."""
    for plugin in _implementing("prepare_connection"):
        with _told_if_it_fails(plugin, "not all its SQL functions are there"):
            plugin.hook.prepare_connection(connection=connection)


def _implementing(hook: str) -> Iterator[Plugin]:
    from supermap_cli.plugin_manager import load_plugins  # noqa: PLC0415 - keeps start-up light

    return (plugin for plugin in load_plugins().working if hook in plugin.hooks)


def _commands_of(plugin: Plugin) -> dict[str, Any]:
    """A plugin's commands by name, collected in an app of its own, so that a failure leaves no trace."""
    app = typer.Typer(rich_markup_mode="markdown")
    plugin.hook.register_commands(app=app)
    return dict(typer.main.get_group(app).commands)


@contextmanager
def _told_if_it_fails(plugin: Plugin, consequence: str) -> Iterator[None]:
    try:
        yield
    except (Exception, SystemExit) as error:  # whatever a plugin does wrong is its own affair
        _warn(plugin, f"{consequence}: {type(error).__name__}: {error}")


def _warn(plugin: Plugin, message: str) -> None:
    line = " ".join(f"warning: plugin {plugin.name} of {plugin.distribution}: {message}".split())
    typer.echo(printable_line(line), err=True)
