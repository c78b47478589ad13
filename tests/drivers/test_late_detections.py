"""A detector that takes its time, played by sensor time."""

from __future__ import annotations

import pytest

from supermap_cli.drivers.late_detections import DelayModel, LateDetections
from supermap_cli.types.detections import no_detections

SECOND_NS = 1_000_000_000


def sent(lateness: DelayModel, count: int) -> LateDetections:
    """The detections of images at 1 Hz."""
    late = LateDetections(lateness)
    for index in range(count):
        late.send(no_detections(index * SECOND_NS))
    return late


def test_without_delay_detections_are_there_with_their_image() -> None:
    late = sent(DelayModel(0.0, 0.0), 1)
    assert [detections.stamp_ns for detections in late.arrived(0)] == [0]
    assert late.next_arrival_ns is None


def test_all_that_are_not_dropped_arrive_in_the_order_of_their_arrival() -> None:
    late = sent(DelayModel(5.0, 0.25), 200)
    arrivals = []
    while (arrival_ns := late.next_arrival_ns) is not None:
        arrivals += [(arrival_ns, detections.stamp_ns) for detections in late.arrived(arrival_ns)]
    assert arrivals == sorted(arrivals)
    assert len(arrivals) == 200 - late.lost
    assert late.lost == pytest.approx(50, abs=15)
    assert all(0 <= arrival_ns - stamp_ns <= 5 * SECOND_NS for arrival_ns, stamp_ns in arrivals)


def test_how_late_a_result_comes_is_the_same_each_time() -> None:
    lateness = DelayModel(2.0, 0.2)
    arrivals = [lateness.arrival_ns(stamp_ns) for stamp_ns in range(0, 100 * SECOND_NS, SECOND_NS)]
    assert arrivals == [lateness.arrival_ns(stamp_ns) for stamp_ns in range(0, 100 * SECOND_NS, SECOND_NS)]
    late_ns = [arrival - i * SECOND_NS for i, arrival in enumerate(arrivals) if arrival is not None]
    assert 0 <= min(late_ns) < 0.2 * SECOND_NS < 1.8 * SECOND_NS < max(late_ns) <= 2 * SECOND_NS
