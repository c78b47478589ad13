"""Loads the plugins (entry-point group `supermap`), leaves broken ones out, and makes backends by name."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar

import pluggy
from pydantic import ValidationError

from supermap_cli import hookspecs
from supermap_cli.errors import ConfigError, PluginError, SupermapError
from supermap_cli.hookspecs import Options, RecordingRequest
from supermap_cli.protocols import (
    Detector,
    ImageEncoder,
    LanguageModel,
    Observer,
    Odometry,
    Recording,
    Segmenter,
    TextEncoder,
    Tracker,
)
from supermap_cli.time_limit import time_limit
from supermap_cli.types.relations import SpatialPredicate
from supermap_cli.types.session import SessionContext
from supermap_cli.wrong_entries import wrong_entry

OWN = "supermap-cli"
"""The distribution of this program and its built-in plugins."""
GROUP = "supermap"
"""Entry-point group, and name of the pluggy project."""
KINDS = {
    "odometry": "register_odometry",
    "detector": "register_detectors",
    "segmenter": "register_segmenters",
    "tracker": "register_trackers",
    "encoder": "register_encoders",
    "language model": "register_language_models",
}
"""Kind of backend -> the hook that registers it."""

T = TypeVar("T")


@dataclass(frozen=True)
class Backend:
    """One registered backend: `kind` is a key of `KINDS`, `origin` says which distribution it came from.

    Where the user names none, the most preferred one is taken whose `needs` the recording's streams meet.
    """

    kind: str
    name: str
    factory: Callable[..., Any]
    options: type[Options]
    origin: str
    needs: frozenset[str] = frozenset()
    preference: int = 0


@dataclass(frozen=True)
class Plugin:
    """A working plugin: its name, where it came from, what it implements and registers.

    `hook` calls the hooks of this plugin alone, so that one that fails leaves the others working.
    """

    name: str
    distribution: str
    version: str
    hooks: tuple[str, ...]
    backends: tuple[Backend, ...]
    hook: pluggy.HookRelay = field(repr=False, compare=False)


@dataclass(frozen=True)
class BrokenPlugin:
    """A plugin that was left out, and why, in one line."""

    name: str
    distribution: str
    version: str
    error: str


class Registry(Generic[T]):
    """The backends of one kind."""

    def __init__(self, kind: str, backends: Iterable[Backend]) -> None:
        self.kind = kind
        self._by_name: dict[str, list[Backend]] = {}
        self._options_of_other_kinds: dict[str, set[str]] = {}
        for backend in backends:
            if backend.kind == kind:
                self._by_name.setdefault(backend.name, []).append(backend)
            else:
                self._options_of_other_kinds.setdefault(backend.name, set()).update(backend.options.model_fields)

    def names(self) -> tuple[str, ...]:
        """All registered names, sorted."""
        return tuple(sorted(self._by_name))

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def get(self, name: str) -> Backend:
        """The backend of that name. Raises `PluginError` for an unknown name and for one that two plugins claim."""
        claimants = self._by_name.get(name, [])
        if not claimants:
            known = ", ".join(self.names()) or "none is installed"
            raise PluginError(f"no {self.kind} is called {name!r}", cure=f"known: {known}; see `supermap plugins`")
        if len(claimants) > 1:
            raise PluginError(conflict_message(claimants), cure="uninstall one of them")
        return claimants[0]

    def choose(self, streams: Collection[str]) -> str:
        """The name of the most preferred backend that needs no more than these streams of a recording.

        Raises `PluginError` naming what the others would need.
        """
        usable = [b for claimants in self._by_name.values() for b in claimants if b.needs <= set(streams)]
        if not usable:
            missing = "; ".join(
                f"{b.name} needs {', '.join(sorted(b.needs))}" for c in self._by_name.values() for b in c
            )
            raise PluginError(
                f"no {self.kind} can work on this recording",
                where=missing,
                cure="see `supermap inspect` and `supermap plugins`",
            )
        return max(usable, key=lambda b: (b.preference, b.name)).name

    def make(self, name: str, options: Mapping[str, object] | None = None, *args: object) -> T:
        """Make the backend: `factory(checked options, *args)`.

        Where backends of several kinds share a name (`recorded`), options that only the others know are passed over.
        Raises `PluginError` as `get` does, and `ConfigError` for a wrong option, naming the valid ones.
        """
        backend = self.get(name)
        of_other_kinds = self._options_of_other_kinds.get(name, set()) - backend.options.model_fields.keys()
        own = {option: value for option, value in (options or {}).items() if option not in of_other_kinds}
        made: T = backend.factory(check_options(backend, own), *args)
        return made

    def conflicts(self) -> Iterator[tuple[Backend, ...]]:
        """Backends that share a name."""
        for name in self.names():
            if len(self._by_name[name]) > 1:
                yield tuple(self._by_name[name])


class Plugins:
    """All plugins of a run.

    `hook` calls the hooks that are no registration, e.g. `plugins.hook.observe_session(context=...)`.
    """

    def __init__(
        self, manager: pluggy.PluginManager, working: Sequence[Plugin], broken: Sequence[BrokenPlugin]
    ) -> None:
        self.hook = manager.hook
        self.working = tuple(working)
        self.broken = tuple(broken)
        backends = [backend for plugin in working for backend in plugin.backends]
        self.odometry: Registry[Odometry] = Registry("odometry", backends)
        self.detectors: Registry[Detector] = Registry("detector", backends)
        self.segmenters: Registry[Segmenter] = Registry("segmenter", backends)
        self.trackers: Registry[Tracker] = Registry("tracker", backends)
        self.encoders: Registry[TextEncoder | ImageEncoder] = Registry("encoder", backends)
        self.language_models: Registry[LanguageModel] = Registry("language model", backends)

    @property
    def registries(self) -> tuple[Registry[Any], ...]:
        """The registries of all kinds."""
        return (
            self.odometry,
            self.detectors,
            self.segmenters,
            self.trackers,
            self.encoders,
            self.language_models,
        )

    def open_recording(self, path: Path, request: RecordingRequest) -> Recording | None:
        """A recording opened by the first plugin that knows its format. Raises `PluginError` for what is none."""
        opened = self.hook.open_recording(path=path, request=request)
        if opened is not None and not isinstance(opened, Recording):
            what = f"a plugin opens it as {type(opened).__name__}, which is no recording"
            raise PluginError(what, where=str(path), cure="see `supermap plugins`, and tell its authors")
        return opened

    def spatial_predicates(self) -> tuple[SpatialPredicate, ...]:
        """The further relations of all plugins. Raises `PluginError` naming the one that gives something else."""
        found: list[SpatialPredicate] = []
        for plugin in self.working:
            if "spatial_predicates" in plugin.hooks:
                (given,) = plugin.hook.spatial_predicates() or ((),)
                if not isinstance(given, list | tuple) or not all(isinstance(each, SpatialPredicate) for each in given):
                    what = f"the plugin {plugin.name} of {plugin.distribution} gives relations that are none"
                    raise PluginError(what, cure="tell its authors, or do without it")
                found += given
        return tuple(found)

    def check_options(self, options: Mapping[str, Mapping[str, object]]) -> None:
        """Check the options of all backends (name -> option -> value), used or not; raises `ConfigError`."""
        for name, values in options.items():
            backends = [registry.get(name) for registry in self.registries if name in registry]
            if not backends:
                known = ", ".join(sorted({known for registry in self.registries for known in registry.names()}))
                raise ConfigError(f"options for {name!r}, which is no backend", cure=f"known: {known}")
            fields = {field for backend in backends for field in backend.options.model_fields}
            for option in values:
                if option not in fields:
                    raise _unknown_option(name, option, fields)


def make_observers(plugins: Plugins, context: SessionContext) -> tuple[list[tuple[str, Observer]], list[str]]:
    """The observers of the plugins that want to follow a session, each with its plugin's name; and why others could not
    be made, one line each.
    """
    observers: list[tuple[str, Observer]] = []
    warnings = []
    for plugin in plugins.working:
        if "observe_session" not in plugin.hooks:
            continue
        try:
            made = plugin.hook.observe_session(context=context)
        except Exception as error:  # an observer's fault must not cost the map
            warnings.append(f"plugin {plugin.name} was left out: {type(error).__name__}: {error}")
        else:
            observers += [(plugin.name, observer) for observer in made if observer is not None]
    return observers, warnings


def load_plugins(extra: Iterable[object] = ()) -> Plugins:
    """Load all installed plugins one by one, then the `extra` plugin objects; the broken ones are kept apart.

    Without `extra` the plugins are loaded once a process.
    """
    given = [_from_object(plugin_object) for plugin_object in extra]
    return _load([*_installed_candidates(), *given]) if given else _load_installed()


@cache
def _load_installed() -> Plugins:
    return _load(_installed_candidates())


LOADING_LIMIT_S = 15.0
"""Seconds; a plugin imports nothing heavy before it is used, see docs/plugins.md. Chosen."""


def _load(candidates: Iterable[_PluginCandidate]) -> Plugins:
    manager = _new_manager()
    working: list[Plugin] = []
    broken: list[BrokenPlugin] = []
    for candidate in candidates:
        try:
            too_long = f"it takes longer than {LOADING_LIMIT_S:g} s to load"
            with time_limit(LOADING_LIMIT_S, too_long), _prints_to_stderr():
                plugin_object = candidate.load()
                _check_is_new(plugin_object, manager)
                working.append(_validate(plugin_object, candidate))
        except (Exception, SystemExit) as error:  # whatever a plugin does wrong is its own affair
            message = " ".join(f"{type(error).__name__}: {error}".split())
            broken.append(BrokenPlugin(candidate.name, candidate.distribution, candidate.version, message))
        else:
            manager.register(plugin_object, f"{candidate.distribution}:{candidate.name}:{len(working)}")
    return Plugins(manager, working, broken)


@contextmanager
def _prints_to_stderr() -> Iterator[None]:
    """What a plugin prints while it is loaded must not mix with what a command prints."""
    with redirect_stdout(sys.stderr):
        yield


def check_options(backend: Backend, given: Mapping[str, object]) -> Options:
    """The options as the backend's model. Raises `ConfigError` naming the wrong option and the valid ones."""
    try:
        return backend.options.model_validate(dict(given))
    except ValidationError as error:
        entry, what = wrong_entry(error)
        option = ".".join(entry)
        if error.errors()[0]["type"] == "extra_forbidden":
            raise _unknown_option(backend.name, option, backend.options.model_fields) from error
        where = f"{backend.name}.{option}" if option else backend.name
        raise ConfigError(f"option {where}: {what}", cure=f"see {backend.name} in `supermap plugins`") from error


def parse_option_arguments(arguments: Iterable[str]) -> dict[str, dict[str, object]]:
    """`["onnx.model=a.onnx", "onnx.score=0.3"]` -> `{"onnx": {"model": "a.onnx", "score": "0.3"}}`.

    Values stay text; the backend's option model turns them into what it needs. The last of two for one option counts.
    Raises `ConfigError` for what has not the form `backend.name=value`.
    """
    options: dict[str, dict[str, object]] = {}
    for argument in arguments:
        key, equals, value = argument.partition("=")
        backend, dot, name = key.strip().partition(".")
        if not (equals and dot and backend and name):
            raise ConfigError(
                f"option {argument!r} is not understood",
                cure="write --option BACKEND.NAME=VALUE, e.g. onnx.model=yolox.onnx",
            )
        options.setdefault(backend, {})[name.replace("-", "_")] = value
    return options


def conflict_message(claimants: Sequence[Backend]) -> str:
    """The error message for backends of one name."""
    origins = " and ".join(claim.origin for claim in claimants)
    return f"the {claimants[0].kind} {claimants[0].name!r} is claimed by {origins}"


@dataclass(frozen=True)
class _PluginCandidate:
    """A plugin that has not been loaded yet."""

    name: str
    distribution: str
    version: str
    load: Callable[[], object]

    @property
    def origin(self) -> str:
        """Its name in messages."""
        return f"{self.distribution} (plugin {self.name})"


def _installed_candidates() -> list[_PluginCandidate]:
    found = [_from_entry_point(entry) for entry in entry_points(group=GROUP)]
    return sorted(found, key=lambda candidate: (candidate.distribution, candidate.name))


def packages_of_plugins() -> dict[str, str]:
    """The package of every plugin of a third party -> the plugin's name with its distribution's."""
    found = {}
    for entry in entry_points(group=GROUP):
        if entry.dist is not None and entry.dist.name != OWN:
            found[entry.value.partition(":")[0].partition(".")[0]] = f"{entry.name} of {entry.dist.name}"
    return found


def _from_entry_point(entry: EntryPoint) -> _PluginCandidate:
    name, version = (entry.dist.name, entry.dist.version) if entry.dist else ("unknown", "unknown")
    return _PluginCandidate(entry.name, name, version, entry.load)


def _from_object(plugin_object: object) -> _PluginCandidate:
    name = str(getattr(plugin_object, "__name__", type(plugin_object).__name__))
    return _PluginCandidate(name, "given by the caller", "", lambda: plugin_object)


def _new_manager() -> pluggy.PluginManager:
    manager = pluggy.PluginManager(GROUP)
    manager.add_hookspecs(hookspecs)
    return manager


def _check_is_new(plugin_object: object, manager: pluggy.PluginManager) -> None:
    if manager.is_registered(plugin_object):
        raise PluginError("it is loaded already, under another name")


def _validate(plugin_object: object, candidate: _PluginCandidate) -> Plugin:
    """Validate a plugin and collect its backends in a manager of its own, so that a failure leaves no trace."""
    manager = _new_manager()
    manager.register(plugin_object, candidate.name)
    callers = manager.get_hookcallers(plugin_object) or []
    hooks = tuple(sorted(caller.name for caller in callers))
    known_hooks = ", ".join(sorted(name for name in vars(hookspecs) if _is_hook(name)))
    if not hooks:
        raise PluginError("it implements no hook", cure=f"mark functions with @hookimpl; known hooks: {known_hooks}")
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        raise PluginError(str(error), cure=f"known hooks: {known_hooks}") from error
    backends: list[Backend] = []
    for kind, hook in KINDS.items():
        getattr(manager.hook, hook)(register=_collector(kind, candidate.origin, backends))
    return Plugin(candidate.name, candidate.distribution, candidate.version, hooks, tuple(backends), manager.hook)


def _is_hook(name: str) -> bool:
    return inspect.isfunction(getattr(hookspecs, name)) and hasattr(getattr(hookspecs, name), f"{GROUP}_spec")


def _collector(kind: str, origin: str, backends: list[Backend]) -> hookspecs.Register:
    def register(
        name: str,
        factory: Callable[..., Any],
        options: type[Options] = Options,
        *,
        needs: Collection[str] = (),
        preference: int = 0,
    ) -> None:
        if not (inspect.isclass(options) and issubclass(options, Options)):
            raise PluginError(f"{kind} {name!r}: its options are no subclass of supermap_cli.Options")
        if not callable(factory):
            raise PluginError(f"{kind} {name!r}: its factory cannot be called")
        if not name or "." in name or "=" in name:
            raise PluginError(f"{name!r} is no name for a {kind}", cure="use letters, digits, '-' and '_'")
        backends.append(Backend(kind, name, factory, options, origin, frozenset(needs), preference))

    return register


def _unknown_option(backend: str, option: str, fields: Iterable[str]) -> SupermapError:
    valid = ", ".join(sorted(fields)) or "it has none"
    return ConfigError(f"{backend} has no option {option!r}", cure=f"valid options: {valid}")
