"""`--rig FILE`: how a robot's recordings are read, from a TOML file or a URDF."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from supermap_cli.errors import ConfigError
from supermap_cli.input_files import check_readable

_KEYS = ("topics", "frames", "mounts", "clocks", "fixed_joints")
"""Entries that are tables; the file's are laid over those of the configuration."""
_OPTIONS = {"topic": "topics", "frame": "frames", "mount": "mounts", "clock": "clocks"}
"""What options are called, for the same entries."""


def with_rig(recording: dict[str, Any], path: Path) -> dict[str, Any]:
    """The entries of `[build.recording]` with those of a rig's file laid over them. Raises `ConfigError`."""
    check_readable(path, ConfigError, what="a rig's TOML file or URDF with --rig")
    found = read_rig(path)
    merged = recording | {name: value for name, value in found.items() if name not in _KEYS}
    for name in _KEYS:
        merged[name] = recording.get(name, {}) | found.get(name, {})
    return merged


def read_rig(path: Path) -> dict[str, Any]:
    """The entries of `[build.recording]` that a file holds; of a URDF its fixed joints."""
    from pydantic import ValidationError  # noqa: PLC0415 - keeps start-up light

    from supermap_cli.config import RecordingConfig  # noqa: PLC0415
    from supermap_cli.recordings.urdf import fixed_joints  # noqa: PLC0415
    from supermap_cli.wrong_entries import wrong_entry  # noqa: PLC0415

    if _is_xml(path):
        return {"fixed_joints": fixed_joints(path)}
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"not a TOML file, and no URDF: {error}", where=str(path), cure="name a rig's TOML file or URDF with --rig"
        ) from error
    if isinstance(build := document.get("build"), dict):  # a whole supermap.toml, as inspect --write-config writes it
        document = build.get("recording", {})
    if not isinstance(document, dict):
        raise ConfigError("build.recording is no table", where=str(path), cure="write frames, mounts, clocks in it")
    document = {_OPTIONS.get(name, name): value for name, value in document.items()}
    if isinstance(urdf := document.pop("urdf", None), str):
        document["fixed_joints"] = fixed_joints(path.parent / urdf) | document.get("fixed_joints", {})
    try:
        return RecordingConfig.model_validate(document).model_dump(exclude_unset=True)
    except ValidationError as error:
        entry, what = wrong_entry(error)
        known = "topics, frames, mounts, clocks, robot, camera, urdf"
        raise ConfigError(
            f"{'.'.join(entry)}: {what}", where=str(path), cure=f"a rig's entries are {known} (docs/recordings.md)"
        ) from error


def _is_xml(path: Path) -> bool:
    """By its name, or by its first letter: no TOML begins with "<"."""
    if path.suffix.lower() in {".urdf", ".xml", ".xacro"}:
        return True
    try:
        with path.open("rb") as file:
            return file.read(64).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")
    except OSError as error:
        raise ConfigError(
            f"the rig cannot be read: {error.strerror}", where=str(path), cure="name a rig's TOML file or URDF"
        ) from error
