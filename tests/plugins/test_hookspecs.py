"""Every hook is documented, and works: each is implemented here by the smallest plugin that shows it."""

from __future__ import annotations

import inspect
import sqlite3
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

from supermap_cli import hookimpl, hookspecs
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.plugin_manager import KINDS, load_plugins
from supermap_cli.types.session import SessionContext

HOOKS = {name: function for name, function in vars(hookspecs).items() if hasattr(function, "supermap_spec")}
REGISTRATIONS = set(KINDS.values())
CALLS: dict[str, tuple[Callable[..., object], dict[str, object]]] = {
    "open_recording": (
        lambda path, request: (path, request),
        {"path": Path("run.bin"), "request": RecordingRequest()},
    ),
    "spatial_predicates": (lambda: (), {}),
    "register_commands": (lambda app: (app,), {"app": typer.Typer()}),
    "prepare_connection": (lambda connection: (connection,), {"connection": sqlite3.connect(":memory:")}),
    "observe_session": (lambda context: (context,), {"context": SessionContext("run.bin", "map.db", "monday", (), {})}),
}
"""Hooks that register nothing: an implementation that answers with its arguments, and arguments."""


def test_there_is_a_test_for_every_hook() -> None:
    assert set(HOOKS) == REGISTRATIONS | set(CALLS)


@pytest.mark.parametrize("name", sorted(HOOKS))
def test_every_hook_has_a_docstring_and_typed_arguments(name: str) -> None:
    assert len(inspect.getdoc(HOOKS[name]) or "") > 20
    signature = inspect.signature(HOOKS[name])
    assert signature.return_annotation is not inspect.Signature.empty
    assert all(parameter.annotation is not inspect.Parameter.empty for parameter in signature.parameters.values())


@pytest.mark.parametrize("name", sorted(CALLS))
def test_a_plugin_implements_the_hook(name: str) -> None:
    implementation, arguments = CALLS[name]
    hook = getattr(load_plugins([SimpleNamespace(**{name: hookimpl(implementation)})]).hook, name)
    answer = hook(**arguments)
    assert (answer if name == "open_recording" else answer[0]) == tuple(arguments.values())


@pytest.mark.parametrize(("kind", "hook"), sorted(KINDS.items()))
def test_a_plugin_registers_a_backend_of_each_kind(kind: str, hook: str) -> None:
    plugin = SimpleNamespace(**{hook: hookimpl(lambda register: register("mine", lambda options, *args: args))})
    loaded = load_plugins([plugin])
    (registry,) = (candidate for candidate in loaded.registries if "mine" in candidate)
    assert registry.kind == kind
    assert registry.make("mine", {}, "an argument") == ("an argument",)


def test_the_first_plugin_that_opens_a_recording_wins() -> None:
    declines = SimpleNamespace(open_recording=hookimpl(lambda path: None))
    opens = SimpleNamespace(open_recording=hookimpl(lambda path: f"opened {path}"))
    hook = load_plugins([opens, declines]).hook
    assert hook.open_recording(path=Path("run.bin"), request=RecordingRequest()) == "opened run.bin"
