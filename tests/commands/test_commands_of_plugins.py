"""Plugins add commands, and none of them can break the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest
import typer

from supermap_cli import hookimpl, plugin_manager
from supermap_cli.errors import ConfigError
from supermap_cli.main import make_app
from support.cli import supermap


@pytest.fixture
def with_plugins(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Adds plugins that register commands by these functions."""

    def add(*registers: Callable[[typer.Typer], None]) -> None:
        loaded = plugin_manager.load_plugins(
            [SimpleNamespace(register_commands=hookimpl(register)) for register in registers]
        )
        monkeypatch.setattr(plugin_manager, "load_plugins", lambda: loaded)

    return add


def add_yodel(app: typer.Typer) -> None:
    @app.command()
    def yodel(song: str = "la") -> None:
        """Yodel a song."""
        typer.echo(song)


def add_group(app: typer.Typer) -> None:
    fleet = typer.Typer(help="Many robots.")
    app.add_typer(fleet, name="fleet")

    @fleet.command()
    def count() -> None:
        typer.echo("3")

    @fleet.command()
    def fail() -> None:
        raise ConfigError("too many robots")


def add_half(app: typer.Typer) -> None:
    add_yodel(app)
    raise RuntimeError("no\nlicence")


def add_unusable(app: typer.Typer) -> None:
    app.command()("no function")  # type: ignore[type-var]


def stop(app: typer.Typer) -> None:
    raise SystemExit(3)


def test_a_plugin_adds_a_command_and_a_group(with_plugins: Callable[..., None]) -> None:
    with_plugins(add_yodel, add_group)
    assert supermap("yodel", "--song", "do re mi").stdout == "do re mi\n"
    assert supermap("fleet", "count").stdout == "3\n"
    assert isinstance(supermap("fleet", "fail").exception, ConfigError)
    shown = supermap("--help").stdout
    for expected in ("build", "db", "yodel", "Yodel a song.", "fleet", "Many robots."):
        assert expected in shown


@pytest.mark.parametrize(
    ("register", "error"),
    [(add_half, "RuntimeError: no licence"), (add_unusable, "AttributeError: "), (stop, "SystemExit: 3")],
)
def test_a_plugin_that_fails_is_one_warning_and_left_out(
    with_plugins: Callable[..., None], register: Callable[[typer.Typer], None], error: str
) -> None:
    with_plugins(register, add_group)
    result = supermap("--help")
    assert result.exit_code == 0
    (warning,) = result.stderr.splitlines()
    assert warning.startswith("warning: plugin SimpleNamespace of given by the caller: its commands are left out: ")
    assert error in warning
    assert "yodel" not in result.stdout
    assert "fleet" in result.stdout


def test_the_names_of_other_commands_are_taken(with_plugins: Callable[..., None]) -> None:
    def add_show(app: typer.Typer) -> None:
        app.command("show")(lambda: typer.echo("mine"))
        add_yodel(app)

    with_plugins(add_show, add_yodel)
    assert "Show all current objects" in supermap("show", "--help").stdout
    result = supermap("yodel")
    assert result.stdout == "la\n"
    assert [line.partition(": its ")[2] for line in result.stderr.splitlines()] == [
        "command 'show' is left out: there is one of that name already",
        "command 'yodel' is left out: there is one of that name already",
    ]


def test_a_name_nobody_knows_is_wrong_usage_with_a_suggestion(with_plugins: Callable[..., None]) -> None:
    with_plugins(add_yodel)
    result = supermap("yodle")
    assert result.exit_code == 2
    assert "No such command 'yodle'. Did you mean 'yodel'?" in " ".join(result.stderr.split())


def test_built_in_commands_load_no_plugin(monkeypatch: pytest.MonkeyPatch) -> None:
    def load_plugins() -> None:
        raise AssertionError("plugins were loaded")

    monkeypatch.setattr(plugin_manager, "load_plugins", load_plugins)
    for arguments in (["--version"], ["build", "--help"], ["query", "--help"], ["db", "sql", "--help"]):
        assert supermap(*arguments).exit_code == 0


def commands(group: object, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], object]]:
    yield path, group
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


@pytest.mark.parametrize(
    ("path", "command"), list(commands(typer.main.get_command(make_app()))), ids=lambda value: repr(value)[:40]
)
def test_every_command_has_a_summary_of_one_sentence_and_an_example(path: tuple[str, ...], command: object) -> None:
    summary = (getattr(command, "help", None) or "").split("\n\n")[0]
    assert summary.endswith(".")
    assert f"    supermap {' '.join(path)}".rstrip() in (getattr(command, "epilog", None) or "")
