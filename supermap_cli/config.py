"""The configuration: defaults, then `supermap.toml`, then the command line. What was used is stored with the
traversal.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from supermap_cli.errors import ConfigError
from supermap_cli.input_files import read_text
from supermap_cli.types.limits import FARTHEST_M, LARGEST_CLOCK_OFFSET_S, LATEST_S, RecordingLimits
from supermap_cli.wrong_entries import wrong_entry

ParameterValue = bool | int | float | list[int | float]
"""What a parameter of the method may be."""

ClockOffset = Annotated[float, Field(ge=-LARGEST_CLOCK_OFFSET_S, le=LARGEST_CLOCK_OFFSET_S)]
"""Seconds between two clocks."""

LARGEST_SIDE_PX = 1 << 14
"""Pixels of the side of an image; no camera has more (16,384)."""

Ablation = Literal["tracker", "semantic-fusion", "geometric-consistency"]


class Section(BaseModel):
    """Base of all sections: unknown names are errors, and so are numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RecordingConfig(Section):
    """How a recording is read."""

    topics: dict[str, str] = Field(default_factory=dict, description="role -> topic, e.g. color = '/cam/image'")
    frames: dict[str, str] = Field(default_factory=dict, description="'base', 'odom' or a sensor -> frame name")
    mounts: dict[str, str] = Field(
        default_factory=dict, description="sensor or frame -> '[parent] x y z roll pitch yaw' (m, rad)"
    )
    fixed_joints: dict[str, str] = Field(
        default_factory=dict,
        description="link -> 'parent x y z roll pitch yaw' (m, rad), where TF lacks it: a URDF's (`--rig`)",
    )
    clocks: dict[str, ClockOffset] = Field(default_factory=dict, description="topic -> seconds added to its stamps")
    robot: str | None = Field(default=None, description="which of several robots in a recording: its namespace")
    camera: str | None = Field(default=None, description="force a camera model: 'equirectangular'")
    sync_tolerance_s: float = Field(
        default=0.02, gt=0, le=60, description="greatest distance of colour and depth stamps"
    )
    detection_tolerance_s: float = Field(
        default=0.001, ge=0, le=60, description="greatest distance of recorded detections and their image's stamp"
    )
    fit_color: bool = Field(default=True, description="correct a colour calibration that does not fit the depth")
    start_s: float | None = Field(
        default=None, ge=0, le=LATEST_S, description="where to start, from the recording's first message; none: there"
    )
    end_s: float | None = Field(
        default=None,
        ge=0,
        le=LATEST_S,
        description="where to end, from the recording's first message; none: at its end",
    )
    limits: RecordingLimits = Field(default_factory=RecordingLimits)


class BackendConfig(Section):
    """Which plugin does what; `options` maps a backend's name to its options."""

    odometry: str | None = Field(default=None, description="none: the most preferred one the recording has streams for")
    detector: str | None = Field(default=None, description="none: the most preferred one the recording has streams for")
    segmenter: str | None = Field(default=None, description="for boxes without masks; none: the most preferred one")
    tracker: str | None = Field(default=None, description="none: the most preferred one")
    options: dict[str, dict[str, object]] = Field(
        default_factory=dict, description="backend -> option -> value, see `supermap plugins`"
    )


class KeyframeConfig(Section):
    """Which images are mapped."""

    rate_hz: float = Field(
        default=3.0,
        gt=0,
        le=100,
        description="images of each camera of a recording mapped each second; what is pushed is mapped as it comes",
    )
    total_rate_hz: float = Field(
        default=12.0, gt=0, le=600, description="images of all cameras of a rig mapped each second, at most"
    )
    placing_s: float = Field(
        default=3.0, ge=0, le=3600, description="a live traversal is placed in the map after so many seconds of it"
    )
    thumbnail_px: int = Field(
        default=160, ge=0, le=LARGEST_SIDE_PX, description="width of the stored thumbnails, 0 = none"
    )
    depth_step: int = Field(
        default=8, ge=1, le=LARGEST_SIDE_PX, description="pixels between the depths stored with a keyframe"
    )
    batch: int = Field(default=10, ge=1, le=1000, description="keyframes written in one transaction")
    checkpoint_s: float = Field(
        default=5.0, ge=0, le=86400, description="work, in seconds, that a killed build has to do again when it goes on"
    )


class PerceptionConfig(Section):
    """Of which of the mapped images the detector is asked, and how long an answer may take.

    A recording is built as fast as it can be, so an answer takes no time; `delay_s` and `dropped` show what a slow
    detector on a robot would give.
    """

    rate_hz: float | None = Field(
        default=None, gt=0, le=100, description="images perceived each second, the others give depth; none: all mapped"
    )
    wait_s: float = Field(
        default=3.0, ge=0, le=3600, description="how long an image waits for its detections, then it does without"
    )
    delay_s: float = Field(
        default=0.0, ge=0, le=3600, description="for studies: detections come up to so much late, out of order"
    )
    dropped: float = Field(
        default=0.0, ge=0, le=1, description="for studies: share of images whose detections never come"
    )


class MappingConfig(Section):
    """The mapping engine's parameters (SI units). Defaults hold for indoor rooms."""

    max_depth_m: float = Field(default=6.0, gt=0, le=FARTHEST_M, description="returns farther off are not used")
    max_range_m: float = Field(default=12.0, gt=0, le=FARTHEST_M, description="the same for a LiDAR")
    correct_drift: bool = Field(
        default=True, description="lay every keyframe's surfaces onto those seen before, where the odometry drifts"
    )
    crop_px: int = Field(
        default=128, ge=16, le=LARGEST_SIDE_PX, description="longest side of the crops kept as evidence"
    )


class BuildConfig(Section):
    """Everything that decides what a build gives.

    `parameters` are checked against those of the method when a build starts, and by `supermap config show`
    (`supermap_cli.parameters`): to know them, the whole method must be imported.
    """

    recording: RecordingConfig = Field(default_factory=RecordingConfig)
    backends: BackendConfig = Field(default_factory=BackendConfig)
    keyframes: KeyframeConfig = Field(default_factory=KeyframeConfig)
    perception: PerceptionConfig = Field(default_factory=PerceptionConfig)
    mapping: MappingConfig = Field(default_factory=MappingConfig)
    parameters: dict[str, dict[str, ParameterValue]] = Field(
        default_factory=dict, description="file of the method -> parameter -> value, see `supermap config show`"
    )
    ablate: tuple[Ablation, ...] = Field(default=(), description="components switched off, for comparisons")


class UserConfig(Section):
    """A `supermap.toml`: the build's sections and the default database."""

    db: str | None = Field(default=None, description="the database of all commands, unless `--db` or `SUPERMAP_DB` say")
    build: BuildConfig = Field(default_factory=BuildConfig)


def load_user_config(folder: Path) -> UserConfig:
    """Read `supermap.toml` in `folder` (or its defaults). Raises `ConfigError` naming the file and the entry."""
    path = folder / "supermap.toml"
    if not os.path.lexists(path):
        return UserConfig()
    text = read_text(path, ConfigError, what="a TOML file supermap.toml, or move this one away")
    try:
        return UserConfig.model_validate(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        if not isinstance(error, ValidationError):
            cure = "correct it, or move it away"
            raise ConfigError(f"not a TOML file: {error}", where=str(path), cure=cure) from error
        raise _wrong_entry(error, path) from error


def _wrong_entry(error: ValidationError, path: Path) -> ConfigError:
    entry, what = wrong_entry(error)
    cure = "the entries are listed in docs/configuration.md"
    return ConfigError(f"{'.'.join(entry)}: {what}", where=str(path), cure=cure)
