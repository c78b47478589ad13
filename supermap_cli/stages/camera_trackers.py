"""A tracker for each camera: its tracks live in the camera's own image."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from supermap_cli.protocols import Resumable, Tracker


class CameraTrackers:
    """Made when a camera's first detections come; `states` is what a stopped build's trackers were at."""

    def __init__(self, make_tracker: Callable[[], Tracker], states: Mapping[str, object]) -> None:
        self._make_tracker = make_tracker
        self._states = states
        self._trackers: dict[str, Tracker] = {}

    def of(self, camera_id: str) -> Tracker:
        """The camera's tracker."""
        if camera_id not in self._trackers:
            tracker = self._trackers[camera_id] = self._make_tracker()
            if camera_id in self._states and isinstance(tracker, Resumable):
                tracker.resume(self._states[camera_id])
        return self._trackers[camera_id]

    def state(self) -> dict[str, object]:
        """The state of every tracker that has one, by camera; of one that was not asked since, what it was at."""
        states = dict(self._states)
        for camera_id, tracker in self._trackers.items():
            if isinstance(tracker, Resumable):
                states[camera_id] = tracker.state()
        return states
