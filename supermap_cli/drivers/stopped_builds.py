"""A build that was stopped before: whether another one can go on from it, and what to say where it cannot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.checkpoints import StoppedBuild, read_checkpoint
from supermap_cli.errors import ConfigError, MemoryStoreError
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import Checkpoint, StoredTraversal
from supermap_cli.parameters import stored_config
from supermap_cli.protocols import Recording
from supermap_cli.types.packing import PackingError

Unfinished = Literal["refuse", "resume", "restart"]
"""What becomes of a build that was stopped before."""


@dataclass(frozen=True)
class Continuation:
    """A build that was stopped, and what it goes on from."""

    traversal: StoredTraversal
    checkpoint: Checkpoint
    stopped: StoppedBuild


def find_stopped(store: MapStore, recording: Recording, unfinished: Unfinished) -> StoredTraversal | None:
    """The build that was stopped, if there is one. Raises `MemoryStoreError` where it is in the recording's way."""
    stopped, fingerprint = store.unfinished(), recording.fingerprint()
    if (
        stopped is not None
        and unfinished != "restart"
        and (unfinished == "refuse" or stopped.fingerprint != fingerprint)
    ):
        what, cure = describe_stopped(stopped, fingerprint)
        raise MemoryStoreError(what, where=str(recording.path), cure=cure)
    return stopped


def check_built_alike(stopped: StoredTraversal, now: Mapping[str, object], where: str) -> None:
    """Raise `ConfigError` where a stopped build was begun with other settings than it is to go on with `now`.

    An entry that the configuration did not have yet had its default. The window is the same: the fingerprint says so.
    """
    begun_with = {entry: value for entry, value in stopped.config.items() if entry != "placed"}
    before = {
        "build": _without_window(_completed(begun_with, stored_config(BuildConfig()))),
        "versions": dict(stopped.versions),
        "name": stopped.name,
    }
    build = now.get("build")
    if isinstance(build, Mapping):
        now = {**now, "build": _without_window(build)}
    difference = first_difference(before, now)
    if difference is not None:
        raise ConfigError(
            f"the build of {stopped.name!r} was begun otherwise: {difference}",
            where=where,
            cure="go on with the settings it was begun with, or begin anew with --restart",
        )


def _completed(stored: Mapping[str, object], defaults: Mapping[str, object]) -> dict[str, object]:
    """Stored entries with the defaults of those that are missing, section by section."""
    completed = dict(stored)
    for name, default in defaults.items():
        known = stored.get(name)
        if name not in stored:
            completed[name] = default
        elif isinstance(default, Mapping) and isinstance(known, Mapping):
            completed[name] = _completed(known, default)
    return completed


def _without_window(build: Mapping[str, object]) -> dict[str, object]:
    """A stored configuration without the part of the recording that is read."""
    recording = build.get("recording")
    if not isinstance(recording, Mapping):
        return dict(build)
    return {
        **build,
        "recording": {name: value for name, value in recording.items() if name not in {"start_s", "end_s"}},
    }


def load_continuation(store: MapStore, stopped: StoredTraversal) -> Continuation | None:
    """What a stopped build goes on from; `None` without a checkpoint. Raises `MemoryStoreError` for a damaged one."""
    checkpoint = store.checkpoint(stopped.id)
    if checkpoint is None:
        return None
    with damage_reported(store.where):
        return Continuation(stopped, checkpoint, read_checkpoint(checkpoint))


@contextmanager
def damage_reported(where: str) -> Iterator[None]:
    """A damaged checkpoint becomes a `MemoryStoreError`."""
    try:
        yield
    except (PackingError, KeyError, ValueError) as error:
        raise MemoryStoreError(
            f"the checkpoint of the stopped build is damaged: {error}", where=where, cure="begin anew with --restart"
        ) from error


def describe_stopped(stopped: StoredTraversal, fingerprint: str) -> tuple[str, str]:
    """What to say of a stopped build that is neither to go on nor to be taken out, and the cure."""
    done = 0.0 if stopped.mapped_ns is None else (stopped.mapped_ns - stopped.start_ns)
    share = f"{100 * done / max(stopped.end_ns - stopped.start_ns, 1):.0f} %"
    if stopped.fingerprint == fingerprint:
        return f"its build was stopped at {share}", "go on with --resume, or begin anew with --restart"
    end_it = f"let it end first, with the options it was begun with (supermap build {stopped.recording} --resume)"
    return f"the build of {stopped.name!r} was stopped at {share}", f"{end_it}, or take out what it wrote (--restart)"


def first_difference(before: Any, now: Any, path: str = "") -> str | None:
    """The first entry in which two configurations differ, with both values; `None` if they are the same."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for name in sorted(before.keys() | now.keys()):
            found = first_difference(before.get(name), now.get(name), f"{path}.{name}" if path else name)
            if found is not None:
                return found
        return None
    return None if before == now else f"{path} was {before!r}, now {now!r}"
