"""The fixed joints of a robot description (URDF), for sensors whose mounting TF does not tell."""

from __future__ import annotations

import xml.etree.ElementTree as ET  # what it could be attacked with is refused before it is parsed
from pathlib import Path

from supermap_cli.errors import ConfigError

_MOST_BYTES = 32 << 20
"""Bytes of a description: large ones (humanoids) have 1 MB, meshes are files of their own. Chosen."""
_DECLARATIONS = ("<!DOCTYPE", "<!ENTITY")
"""Nothing that a URDF needs; entities could make a small file huge."""


def fixed_joints(path: Path) -> dict[str, str]:
    """Child link -> "parent x y z roll pitch yaw" (m, rad) of every fixed joint, as `--mount` has it.

    Raises `ConfigError` for what is no expanded URDF.
    """
    robot = _parsed(path)
    joints: dict[str, str] = {}
    for joint in robot.findall("joint"):
        if joint.get("type") != "fixed":
            continue
        parent, child = (_link(joint, which, path) for which in ("parent", "child"))
        origin = joint.find("origin")
        numbers = "0 0 0 0 0 0"
        if origin is not None:
            numbers = f"{origin.get('xyz', '0 0 0')} {origin.get('rpy', '0 0 0')}"
        joints[child] = f"{parent} {' '.join(numbers.split())}"
    if not joints:
        raise ConfigError(
            "this URDF has no fixed joint, so it says of no sensor where it sits",
            where=str(path),
            cure='name the whole robot\'s URDF, or say it with --mount camera="X Y Z ROLL PITCH YAW"',
        )
    return joints


def _parsed(path: Path) -> ET.Element:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ConfigError("too large for a URDF", where=str(path), cure="name the robot's URDF with --rig")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise ConfigError(f"the URDF cannot be read: {reason}", where=str(path), cure="name another file") from error
    if "xacro:" in text.replace("xmlns:xacro", "") or "${" in text:
        raise ConfigError(
            "a xacro file that is not expanded",
            where=str(path),
            cure="run `xacro FILE > robot.urdf`, and name robot.urdf with --rig",
        )
    if any(word in text for word in _DECLARATIONS):
        raise ConfigError("declares entities, as no URDF does", where=str(path), cure="take the declaration out")
    try:
        robot = ET.fromstring(text)  # noqa: S314 - without declarations there are no entities
    except (ET.ParseError, ValueError) as error:
        raise ConfigError(f"no XML: {error}", where=str(path), cure="name a URDF, or a TOML file") from error
    if robot.tag != "robot":
        raise ConfigError(f"no URDF: it begins with <{robot.tag}>", where=str(path), cure="name a robot's URDF")
    return robot


def _link(joint: ET.Element, which: str, path: Path) -> str:
    found = joint.find(which)
    name = "" if found is None else found.get("link", "")
    if not name or len(name.split()) != 1:
        raise ConfigError(
            f"the joint {joint.get('name', '?')!r} has no {which} link, or one whose name has spaces",
            where=str(path),
            cure="mend the URDF (`check_urdf` finds more)",
        )
    return name
