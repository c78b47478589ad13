"""Pushes everything that a source gives into a session, as it comes: a robot, or a recording played like one."""

from __future__ import annotations

from collections.abc import Iterator

from supermap_cli.protocols import SensorMessage, Source
from supermap_cli.session import MappingSession
from supermap_cli.types.detections import Detections
from supermap_cli.types.memory import MapDelta
from supermap_cli.types.sensing import ImuSample, StampedPose, Sweep


def push_source(session: MappingSession, source: Source) -> Iterator[MapDelta]:
    """Push all messages and close the session: what each keyframe changed. A source that never ends gives for ever.

    The source's own `warnings` are not the session's: `TraversalWriter.open_session(source=...)` stores both.
    """
    with_detections = "detections" in source.streams
    for message in source.messages():
        push(session, message, awaits_detections=with_detections)
        yield from session.step()
    yield from session.close()


def push(session: MappingSession, message: SensorMessage, *, awaits_detections: bool = True) -> None:
    """Push one message. Of a camera frame it is said whether its detections are to come."""
    match message:
        case ImuSample():
            session.add_imu(message)
        case StampedPose():
            session.add_pose(message)
        case Sweep():
            session.add_sweep(message)
        case Detections():
            session.add_detections(message)
        case _:
            session.add_frame(message, awaits_detections=awaits_detections)
