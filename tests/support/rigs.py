"""Recordings opened and inspected as one robot's, and the mounting of its camera."""

from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.recordings import open_bag_recording
from supermap_cli.recordings.inspection import inspect_recording
from support import bags

FRAME = "camera_optical_frame"


def open_(path, **request):
    return open_bag_recording(path, RecordingRequest(**request))


def problems_of(path, **request):
    return [
        f"{problem.what}: {problem.cure}" for problem in inspect_recording(path, RecordingRequest(**request)).problems
    ]


def mount(bag, frame=FRAME, base="base_link", namespace=""):
    bag.transform(bags.START_NS, base, frame, bags.T_BASE_OPTICAL, static=True, namespace=namespace)
