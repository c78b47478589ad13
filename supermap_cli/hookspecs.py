"""The hooks a plugin may implement. Registration happens once a run; per-frame work goes through `protocols`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pluggy
from pydantic import BaseModel, ConfigDict

from supermap_cli.protocols import (
    Detector,
    ImageEncoder,
    LanguageModel,
    Odometry,
    Recording,
    Segmenter,
    TextEncoder,
    Tracker,
)
from supermap_cli.types.limits import RecordingLimits

if TYPE_CHECKING:
    import sqlite3

    import typer

    from supermap_cli.protocols import Observer
    from supermap_cli.types.session import SessionContext

hookspec = pluggy.HookspecMarker("supermap")
hookimpl = pluggy.HookimplMarker("supermap")


class Options(BaseModel):
    """Base of every backend's options: unknown names and numbers that are not finite are errors, every field has a
    description.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RecordingRequest(BaseModel):
    """What `open_recording` gets besides the path: what the user named by hand, and the window of time.

    `topics` maps a role ("color", "depth", "camera_info", "depth_camera_info", "lidar", "imu", "odometry",
    "detections", "masks", and those of one camera as "color.front") to a topic; `frames` maps "base", "odom" or a
    sensor ("camera", "depth", "lidar", "imu") to a frame's name; `mounts` maps a sensor or a frame to "[parent] x y z
    roll pitch yaw" (m, rad), and `fixed_joints` a link to the same, where TF lacks it; `clocks` maps a topic to seconds
    that are added to its stamps; `robot` names one of several; `camera` may force a camera model ("equirectangular").
    `start_s` and `end_s` count from the recording's first message; `limits` bound what is read into memory.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    topics: Mapping[str, str] = {}
    frames: Mapping[str, str] = {}
    mounts: Mapping[str, str] = {}
    fixed_joints: Mapping[str, str] = {}
    clocks: Mapping[str, float] = {}
    robot: str | None = None
    camera: str | None = None
    start_s: float | None = None
    end_s: float | None = None
    sync_tolerance_s: float = 0.02
    detection_tolerance_s: float = 0.001
    fit_color: bool = True
    limits: RecordingLimits = RecordingLimits()


class Register(Protocol):
    """The callback a `register_*` hook gets: `register(name, factory, Options)`.

    `factory(options, recording)` makes the backend; it imports its heavy modules inside itself. Encoders and language
    models are made without a recording: `factory(options)`.
    """

    def __call__(
        self,
        name: str,
        factory: Callable[..., Any],
        options: type[Options] = Options,
        *,
        needs: Collection[str] = (),
        preference: int = 0,
    ) -> None:
        """Register one backend under a name that `--detector NAME` and the like can say.

        `needs` are the streams a recording must have for it (`Recording.streams`); among those that can work, the one
        of the greatest `preference` is the default.
        """
        ...


@hookspec
def register_odometry(register: Register) -> None:
    """Register sources of motion: `factory(options, recording) -> Odometry`; `recording` is `None` where sensors are
    pushed into a session.
    """


@hookspec
def register_detectors(register: Register) -> None:
    """Register detectors: `factory(options, recording) -> Detector`."""


@hookspec
def register_segmenters(register: Register) -> None:
    """Register segmenters, for boxes without masks: `factory(options, recording) -> Segmenter`."""


@hookspec
def register_trackers(register: Register) -> None:
    """Register trackers: `factory(options, recording) -> Tracker`."""


@hookspec
def register_encoders(register: Register) -> None:
    """Register text and image encoders: `factory(options) -> TextEncoder | ImageEncoder`."""


@hookspec
def register_language_models(register: Register) -> None:
    """Register language models: `factory(options) -> LanguageModel`."""


@hookspec(firstresult=True)
def open_recording(path: Path, request: RecordingRequest) -> Recording | None:
    """Open a recording of a further format; `None` leaves it to the next plugin and at last to the host."""


@hookspec
def spatial_predicates() -> Any:
    """Return further relations: a list of `supermap_cli.types.relations.SpatialPredicate`."""


@hookspec
def register_commands(app: typer.Typer) -> None:
    """Add commands to the command line.

    `app` is the plugin's own; its commands stand beside the built-in ones, whose names are taken. It is called only
    when help is asked for, or a command that is not built in.
    """


@hookspec
def prepare_connection(connection: sqlite3.Connection) -> None:
    """Add SQL functions to the read-only connection of `supermap db sql`."""


@hookspec
def observe_session(context: SessionContext) -> Observer | None:
    """Return an observer of the traversal that begins: for viewers, publishers, logs. `None` where it is not wanted."""


__all__ = [
    "Detector",
    "ImageEncoder",
    "LanguageModel",
    "Odometry",
    "Options",
    "RecordingRequest",
    "Register",
    "Segmenter",
    "TextEncoder",
    "Tracker",
    "hookimpl",
    "hookspec",
]
