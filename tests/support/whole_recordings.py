"""Reads all there is in a recording, as fuzzers do."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from support.fuzzing import one_line


def read_everything(path: Path) -> None:
    """Inspect a recording and read all its streams."""
    one_line(lambda: _inspect(path))
    one_line(lambda: _read_streams(path))


def _inspect(path: Path) -> None:
    inspect_recording(path, RecordingRequest())


def _read_streams(path: Path) -> None:
    recording = open_bag_recording(path, RecordingRequest())
    recording.fingerprint()
    streams = [recording.frames, recording.sweeps, recording.imu]
    streams += [recording.poses] * ("poses" in recording.streams)
    streams += [recording.detection_stamps_ns, recording.detections] * ("detections" in recording.streams)
    for stream in streams:
        one_line(lambda stream=stream: list(islice(iter(stream()), 100)))
    assert all("\n" not in line for line in recording.warnings)
