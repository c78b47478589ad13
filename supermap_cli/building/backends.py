"""Which plugins are at work on one recording."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.config import BuildConfig
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Detector, Recording, Segmenter, Tracker


@dataclass(frozen=True)
class Backends:
    """The plugins at work on one recording, and what they are called."""

    trajectory: Trajectory
    detector: Detector
    segmenter: Segmenter
    tracker: Tracker
    names: dict[str, str]


def choose_backends(recording: Recording, plugins: Plugins, config: BuildConfig) -> Backends:
    """Make the backends the user named, or the most preferred ones that this recording has streams for."""
    chosen = config.backends
    plugins.check_options(chosen.options)
    if chosen.odometry is None and not recording.streams & {"poses", "lidar"}:
        next(iter(recording.poses()))  # says what is missing, and how to mend it
    odometry = chosen.odometry or plugins.odometry.choose(recording.streams)
    detector = chosen.detector or plugins.detectors.choose(recording.streams)
    segmenter = chosen.segmenter or plugins.segmenters.choose(recording.streams)
    tracker = chosen.tracker or plugins.trackers.choose(recording.streams)
    options = chosen.options
    return Backends(
        Trajectory(plugins.odometry.make(odometry, options.get(odometry), recording).poses()),
        plugins.detectors.make(detector, options.get(detector), recording),
        plugins.segmenters.make(segmenter, options.get(segmenter), recording),
        plugins.trackers.make(tracker, options.get(tracker), recording),
        {"odometry": odometry, "detector": detector, "segmenter": segmenter, "tracker": tracker},
    )
