"""What a command line says of a build: its options laid over the configuration, and what recordings are opened with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from supermap_cli.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

    from pydantic import ValidationError

    from supermap_cli.config import BuildConfig
    from supermap_cli.hookspecs import RecordingRequest

_OPTION_OF = {
    ("recording", "topics"): "--topic",
    ("recording", "frames"): "--frame",
    ("recording", "mounts"): "--mount",
    ("recording", "clocks"): "--clock",
    ("recording", "detection_tolerance_s"): "--detection-tolerance",
    ("recording", "camera"): "--camera",
    ("recording", "robot"): "--robot",
    ("keyframes", "rate_hz"): "--rate",
    ("perception", "rate_hz"): "--perception-rate",
    ("ablate", "0"): "--ablate",
    ("ablate",): "--ablate",
}
"""Entries of the configuration -> the options that set them."""


def override(
    config: BuildConfig,
    *,
    rig: Path | None = None,
    detector: str | None = None,
    odometry: str | None = None,
    segmenter: str | None = None,
    tracker: str | None = None,
    options: list[str] | None = None,
    topics: list[str] | None = None,
    frames: list[str] | None = None,
    mounts: list[str] | None = None,
    clocks: list[str] | None = None,
    robot: str | None = None,
    camera: str | None = None,
    detection_tolerance: float | None = None,
    limits: list[str] | None = None,
    rate: float | None = None,
    perception_rate: float | None = None,
    min_confidence: float | None = None,
    ablate: list[str] | None = None,
) -> BuildConfig:
    """The configuration with the command line's words laid over it. Raises `ConfigError` for what is not understood."""
    from pydantic import ValidationError  # noqa: PLC0415

    from supermap_cli.config import BuildConfig  # noqa: PLC0415
    from supermap_cli.plugin_manager import parse_option_arguments  # noqa: PLC0415

    values = config.model_dump()
    if rig is not None:
        from supermap_cli.commands.rig_file import with_rig  # noqa: PLC0415

        values["recording"] = with_rig(values["recording"], rig)
    named = {"detector": detector, "odometry": odometry, "segmenter": segmenter, "tracker": tracker}
    values["backends"].update({kind: given for kind, given in named.items() if given is not None})
    for backend, given in parse_option_arguments(options or []).items():
        values["backends"]["options"].setdefault(backend, {}).update(given)
    values["recording"]["topics"].update(pairs(topics, "--topic", "color=/camera/image"))
    values["recording"]["frames"].update(pairs(frames, "--frame", "base=base_link"))
    values["recording"]["mounts"].update(pairs(mounts, "--mount", 'camera="0.1 0 1.2 0 0.2 0"'))
    values["recording"]["clocks"].update(pairs(clocks, "--clock", "/lidar/points=-37"))
    if robot is not None:
        values["recording"]["robot"] = robot
    values["recording"]["limits"].update(pairs(limits, "--limit", "image_pixels=200000000"))
    if detection_tolerance is not None:
        values["recording"]["detection_tolerance_s"] = detection_tolerance
    if camera is not None:
        values["recording"]["camera"] = camera
    if rate is not None:
        values["keyframes"]["rate_hz"] = rate
    if perception_rate is not None:
        values["perception"]["rate_hz"] = perception_rate
    if min_confidence is not None:
        if not 0 < min_confidence < 1:
            raise ConfigError(
                f"--min-confidence {min_confidence:g} is not between 0 and 1", cure="it is a probability, such as 0.5"
            )
        values["parameters"].setdefault("lifecycle", {})["min_confidence"] = min_confidence
    if ablate:
        values["ablate"] = tuple(ablate)
    try:
        return BuildConfig.model_validate(values)
    except ValidationError as error:
        raise _wrong_option(error) from error


def _wrong_option(error: ValidationError) -> ConfigError:
    """What is wrong with the first wrong option, by the name that it has on the command line."""
    from supermap_cli.types.limits import RecordingLimits  # noqa: PLC0415
    from supermap_cli.wrong_entries import wrong_entry  # noqa: PLC0415

    entry, what = wrong_entry(error)
    if entry[:2] == ("recording", "limits"):
        known = ", ".join(RecordingLimits.model_fields)
        return ConfigError(
            f"--limit {'.'.join(entry[2:])}: {what}", cure=f"the limits are {known}; each takes a whole number from 1"
        )
    longest = next((entry[:length] for length in range(len(entry), 0, -1) if entry[:length] in _OPTION_OF), None)
    named = ".".join(entry) if longest is None else " ".join((_OPTION_OF[longest], *entry[len(longest) :]))
    return ConfigError(f"{named}: {what}", cure="see supermap build --help")


def pairs(given: list[str] | None, option: str, example: str) -> dict[str, str]:
    """`["a=b"]` -> `{"a": "b"}`."""
    result = {}
    for text in given or []:
        key, equals, value = text.partition("=")
        if not (key and equals and value):
            raise ConfigError(f"{option} {text!r} is not understood", cure=f"write {option} {example}")
        result[key.strip()] = value.strip()
    return result


def request(config: BuildConfig, start_s: float | None, end_s: float | None) -> RecordingRequest:
    """How to open a recording, from the configuration; a window that is given here counts before its."""
    of_config = config.recording
    from supermap_cli.hookspecs import RecordingRequest  # noqa: PLC0415

    return RecordingRequest(
        topics=of_config.topics,
        frames=of_config.frames,
        mounts=of_config.mounts,
        fixed_joints=of_config.fixed_joints,
        clocks=of_config.clocks,
        robot=of_config.robot,
        camera=of_config.camera,
        sync_tolerance_s=of_config.sync_tolerance_s,
        detection_tolerance_s=of_config.detection_tolerance_s,
        fit_color=of_config.fit_color,
        limits=of_config.limits,
        start_s=of_config.start_s if start_s is None else start_s,
        end_s=of_config.end_s if end_s is None else end_s,
    )
