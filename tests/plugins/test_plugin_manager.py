"""Plugins are found, checked, and kept out when they are broken."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
from pydantic import Field

from supermap_cli import hookimpl
from supermap_cli.errors import ConfigError, PluginError
from supermap_cli.hookspecs import Options, Register
from supermap_cli.plugin_manager import Plugins, load_plugins, parse_option_arguments
from supermap_cli.types.session import SessionContext
from support.broken_plugins import break_plugin


class SightOptions(Options):
    score: float = Field(default=0.5, ge=0, le=1, description="least score")


def plugin(**functions: Callable[..., object]) -> SimpleNamespace:
    """A plugin object with the given hook implementations."""
    return SimpleNamespace(**{name: hookimpl(function) for name, function in functions.items()})


def sight(name: str = "sight") -> SimpleNamespace:
    """A plugin with one detector that is nothing but its options and arguments."""

    def register_detectors(register: Register) -> None:
        register(name, lambda options, *args: (options, *args), SightOptions)

    return plugin(register_detectors=register_detectors)


def broken_error(given: object) -> str:
    """The error that the given plugin is reported with; the first-party plugins work all the same."""
    loaded = load_plugins([given])
    assert {"onnx", "recorded"} <= set(loaded.detectors.names())
    (broken,) = (plugin for plugin in loaded.broken if plugin.distribution == "given by the caller")
    return broken.error


def test_the_first_party_plugins_are_there() -> None:
    loaded = load_plugins()
    assert not loaded.broken
    assert {"recorded", "kiss-icp"} <= set(loaded.odometry.names())
    assert {"recorded", "onnx", "grounding-dino"} <= set(loaded.detectors.names())
    assert loaded.segmenters.names() == ("depth", "sam2")
    assert loaded.trackers.names() == ("bytetrack",)


def test_installed_plugins_are_loaded_once_a_process() -> None:
    assert load_plugins() is load_plugins()
    assert load_plugins([sight()]) is not load_plugins()
    assert "sight" not in load_plugins().detectors


def test_the_hooks_of_one_plugin_can_be_called_alone() -> None:
    loaded = load_plugins([plugin(spatial_predicates=lambda: ["a"]), plugin(spatial_predicates=lambda: ["b"])])
    assert [plugin.hook.spatial_predicates() for plugin in loaded.working[-2:]] == [[["a"]], [["b"]]]


def test_every_option_of_ours_is_described() -> None:
    for plugin in load_plugins().working:
        for backend in plugin.backends:
            for name, field in backend.options.model_fields.items():
                assert field.description, f"{backend.name}.{name}"


def test_a_backend_is_made_with_checked_options() -> None:
    loaded = load_plugins([sight()])
    assert loaded.detectors.make("sight", {"score": "0.3"}, "a recording") == (SightOptions(score=0.3), "a recording")
    assert loaded.detectors.make("sight") == (SightOptions(),)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scoer": 1}, "sight has no option 'scoer': valid options: score"),
        ({"score": "high"}, "option sight.score: 'high' is no number"),
        ({"score": 2}, "option sight.score: .*less than or equal to 1"),
    ],
)
def test_a_wrong_option_is_named_with_the_right_ones(options: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_plugins([sight()]).detectors.make("sight", options)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(PluginError, match="no detector is called 'yolo': known: grounding-dino, onnx, recorded"):
        load_plugins().detectors.make("yolo")


def test_two_plugins_of_one_name_are_an_error_that_names_both() -> None:
    loaded = load_plugins([sight("onnx"), sight("other")])
    with pytest.raises(PluginError, match=r"'onnx' is claimed by supermap-cli \(plugin onnx\) and given by the caller"):
        loaded.detectors.make("onnx")
    assert loaded.detectors.make("other") == (SightOptions(),)
    assert [len(claims) for claims in loaded.detectors.conflicts()] == [2]


def test_a_misspelt_hook_is_reported_with_the_known_ones() -> None:
    error = broken_error(plugin(register_detecters=lambda register: None))
    assert "unknown hook 'register_detecters'" in error
    assert "register_detectors" in error.split("known hooks:")[1]


def test_a_wrong_signature_is_reported() -> None:
    assert "recorder" in broken_error(plugin(register_detectors=lambda recorder: None))


def test_a_hook_that_raises_leaves_nothing_behind() -> None:
    def register_detectors(register: Register) -> None:
        register("half", object)
        raise RuntimeError("no licence")

    loaded = load_plugins([plugin(register_detectors=register_detectors)])
    assert "half" not in loaded.detectors
    assert loaded.broken[0].error == "RuntimeError: no licence"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a.b", object), "no name for a detector"),
        (("", object), "no name for a detector"),
        (("a", 3), "factory cannot be called"),
        (("a", object, dict), "no subclass of supermap_cli.Options"),
    ],
)
def test_a_wrong_registration_is_reported(arguments: tuple[object, ...], message: str) -> None:
    assert message in broken_error(plugin(register_detectors=lambda register: register(*arguments)))


def test_a_plugin_without_any_hook_is_reported() -> None:
    assert "implements no hook" in broken_error(SimpleNamespace(register_detectors=lambda register: None))


def test_one_plugin_under_two_names_is_loaded_once() -> None:
    twice = sight()
    loaded = load_plugins([twice, twice])
    assert loaded.detectors.make("sight") == (SightOptions(),)
    assert [plugin.error for plugin in loaded.broken] == ["PluginError: it is loaded already, under another name"]


@pytest.mark.parametrize("error", [ImportError("no module named torch"), RuntimeError("no GPU"), SystemExit(3)])
def test_a_plugin_that_fails_to_import_leaves_the_rest_working(
    monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    break_plugin(monkeypatch, "onnx", error)
    loaded = load_plugins([sight()])
    (broken,) = loaded.broken
    assert (broken.name, broken.distribution) == ("onnx", "supermap-cli")
    assert str(error) in broken.error
    assert "recorded" in loaded.detectors


def test_options_of_a_name_that_several_kinds_share_go_to_those_that_know_them() -> None:
    odometry = plugin(register_odometry=lambda register: register("sight", lambda options: options))
    loaded = load_plugins([sight(), odometry])
    loaded.check_options({"sight": {"score": 0.2}})
    assert loaded.odometry.make("sight", {"score": 0.2}) == Options()
    assert loaded.detectors.make("sight", {"score": 0.2}) == (SightOptions(score=0.2),)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sihgt": {}}, "'sihgt', which is no backend: known: .*sight"),
        ({"sight": {"scroe": 1}}, "valid options: score"),
    ],
)
def test_options_nobody_knows_are_refused(options: dict[str, dict[str, object]], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_plugins([sight()]).check_options(options)


def test_option_arguments_are_grouped_by_backend() -> None:
    assert parse_option_arguments([]) == {}
    assert parse_option_arguments(["onnx.model=a=b.onnx", "kiss-icp.voxel-m=0.5", "onnx.score_floor=0.3"]) == {
        "onnx": {"model": "a=b.onnx", "score_floor": "0.3"},
        "kiss-icp": {"voxel_m": "0.5"},
    }


@pytest.mark.parametrize("argument", ["", "onnx", "onnx.model", "model=3", ".model=3", "onnx.=3"])
def test_an_option_argument_of_another_form_is_refused(argument: str) -> None:
    with pytest.raises(ConfigError, match=r"BACKEND\.NAME=VALUE"):
        parse_option_arguments([argument])


def test_hooks_that_register_nothing_are_called_directly() -> None:
    seen: list[object] = []

    def observe_session(context: object) -> None:
        seen.append(context)

    loaded: Plugins = load_plugins([plugin(observe_session=observe_session)])
    context = SessionContext("run.bin", "map.db", "monday", (), {})
    loaded.hook.observe_session(context=context)
    assert seen == [context]
