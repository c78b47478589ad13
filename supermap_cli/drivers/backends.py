"""Which plugins are at work on one recording."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.odometry import run_odometry
from supermap_cli.errors import DetectorError, ModelError, PluginError
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.plugin_manager import Plugins, Registry
from supermap_cli.protocols import Detector, IdentifiedDetector, Odometry, Recording, Resumable, Segmenter, Tracker
from supermap_cli.stages.session_state import SessionBackends

T = TypeVar("T")


@dataclass(frozen=True)
class Backends:
    """The plugins at work on one recording, and what they are called.

    `trajectory` pulls the odometry's poses from the whole recording; every camera gets a tracker of its own.
    `detector_identity` is equal for detectors that err alike.
    """

    odometry: Odometry
    trajectory: Trajectory
    detector: Detector
    segmenter: Segmenter
    make_tracker: Callable[[], Tracker]
    resumable: bool
    names: dict[str, str]
    detector_identity: str


def session_backends(plugins: Plugins, config: BuildConfig | None = None) -> SessionBackends:
    """Odometry, tracker, segmenter and further relations for a session that is not fed from a recording.

    Tracker and segmenter are those the configuration names, else the most preferred ones. The odometry is the one it
    names; where it names none, the poses that are pushed are the motion.
    """
    chosen = (config or BuildConfig()).backends
    plugins.check_options(chosen.options)
    tracker = chosen.tracker or plugins.trackers.choose(())
    segmenter = chosen.segmenter or plugins.segmenters.choose({"color", "depth"})
    odometry = None
    if chosen.odometry is not None:
        odometry = _made(plugins.odometry, chosen.odometry, chosen.options.get(chosen.odometry), None)
    return SessionBackends(
        lambda: _made(plugins.trackers, tracker, chosen.options.get(tracker), None),
        _made(plugins.segmenters, segmenter, chosen.options.get(segmenter), None),
        odometry,
        plugins.spatial_predicates(),
    )


def choose_backends(recording: Recording, plugins: Plugins, config: BuildConfig) -> Backends:
    """Make the backends the user named, or the most preferred ones that this recording has streams for."""
    chosen = config.backends
    odometry_name = _odometry_name(recording, plugins, config)
    options = chosen.options
    names = {
        "odometry": odometry_name,
        "detector": chosen.detector or plugins.detectors.choose(recording.streams),
        "segmenter": chosen.segmenter or plugins.segmenters.choose(recording.streams),
        "tracker": chosen.tracker or plugins.trackers.choose(recording.streams),
    }
    odometry = _made(plugins.odometry, names["odometry"], options.get(names["odometry"]), recording)
    detector = _make_detector(plugins, names["detector"], config, recording)
    segmenter = _made(plugins.segmenters, names["segmenter"], options.get(names["segmenter"]), recording)

    def make_tracker() -> Tracker:
        return _made(plugins.trackers, names["tracker"], options.get(names["tracker"]), recording)

    return Backends(
        odometry,
        Trajectory(run_odometry(odometry, recording)),
        detector,
        segmenter,
        make_tracker,
        isinstance(make_tracker(), Resumable),
        names,
        _detector_identity(detector, names["detector"], options.get(names["detector"])),
    )


def choose_odometry(recording: Recording, plugins: Plugins, config: BuildConfig) -> tuple[str, Trajectory]:
    """The odometry the user named, or the most preferred one, and its poses; no other backend is made."""
    name = _odometry_name(recording, plugins, config)
    odometry = _made(plugins.odometry, name, config.backends.options.get(name), recording)
    return name, Trajectory(run_odometry(odometry, recording))


def _odometry_name(recording: Recording, plugins: Plugins, config: BuildConfig) -> str:
    plugins.check_options(config.backends.options)
    if config.backends.odometry is None and not recording.streams & {"poses", "lidar"}:
        next(iter(recording.poses()))  # says what is missing, and how to correct it
    return config.backends.odometry or plugins.odometry.choose(recording.streams)


REQUIRED = {
    "odometry": ("inputs", "warnings", "finish"),
    "detector": ("image_stamps_ns", "detect"),
    "segmenter": ("segment",),
    "tracker": ("update",),
}
"""Kind of backend -> what one must at least have (`protocols`)."""


def _made(registry: Registry[T], name: str, options: Mapping[str, object] | None, recording: Recording | None) -> T:
    """A backend. Raises `PluginError` where what the plugin made is none."""
    backend = registry.make(name, options, recording)
    if missing := [attribute for attribute in REQUIRED[registry.kind] if not hasattr(backend, attribute)]:
        what = f"what {registry.get(name).origin} made is no {registry.kind}: it has no {', '.join(missing)}"
        raise PluginError(what, cure="tell its authors, or use another one (see `supermap plugins`)")
    return backend


def _make_detector(plugins: Plugins, name: str, config: BuildConfig, recording: Recording) -> Detector:
    """The detector; where none was named and none can be made, the error names recorded detections left unread."""
    try:
        detector: Detector = _made(plugins.detectors, name, config.backends.options.get(name), recording)
    except (DetectorError, ModelError) as error:
        unread = next((line for line in recording.warnings if "detection" in line.lower()), None)
        if config.backends.detector is not None or unread is None:
            raise
        raise DetectorError(f"{unread}. Without them {error.what}", where=error.where, cure=error.cure) from error
    return detector


def _detector_identity(detector: Detector, name: str, options: Mapping[str, object] | None) -> str:
    """What the detector calls itself, else the plugin with its options."""
    if isinstance(detector, IdentifiedDetector):
        return detector.identity
    return f"{name} {json.dumps(options, sort_keys=True, default=str)}" if options else name
