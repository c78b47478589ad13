"""What tells recordings apart."""

from __future__ import annotations

import shutil

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.fingerprint import recording_fingerprint, window_fingerprint
from support import bags


def test_it_is_the_same_wherever_the_recording_lies_and_another_for_another(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", frames=6)
    (tmp_path / "elsewhere").mkdir()
    copy = shutil.copy(path, tmp_path / "elsewhere" / "walk.mcap")
    other = bags.write_recording(tmp_path / "other.mcap", frames=7)
    assert recording_fingerprint(path) == recording_fingerprint(copy) != recording_fingerprint(other)


def test_a_stretch_of_a_recording_is_known_by_the_whole_one(tmp_path):
    path = bags.write_recording(tmp_path / "run.mcap", frames=60)
    whole = recording_fingerprint(path)
    for request in (RecordingRequest(), RecordingRequest(start_s=1.0), RecordingRequest(end_s=3.0)):
        stretch = open_bag_recording(path, request)
        assert stretch.fingerprint() == window_fingerprint(whole, stretch.start_ns, stretch.end_ns)
