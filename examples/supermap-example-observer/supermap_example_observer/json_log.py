"""An observer that writes what it is told to a file, one JSON document a line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from supermap_cli.geometry.arrays import FloatArray
    from supermap_cli.types.detections import Detections, RegionMask, Tracks
    from supermap_cli.types.keyframe import Keyframe
    from supermap_cli.types.memory import KeyframeRecord, MapDelta
    from supermap_cli.types.sensing import CameraFrame, Sweep
    from supermap_cli.types.session import SessionContext, SessionSummary


class JsonLog:
    """Fulfils `supermap_cli.protocols.Observer`."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def started(self, context: SessionContext) -> None:
        """A traversal begins."""
        self._write("started", traversal=context.traversal, source=context.source, cameras=context.cameras)

    def frame(self, frame: CameraFrame, T_map_base: FloatArray, sweep: Sweep | None) -> None:
        """A frame has its place in the map."""
        returns = None if sweep is None else len(sweep.points_lidar)
        position = [round(float(value), 3) for value in T_map_base[:3, 3]]
        self._write(
            "frame", stamp_ns=frame.stamp_ns, camera=frame.camera_id, position_map=position, lidar_returns=returns
        )

    def perceived(
        self, keyframe: Keyframe, detections: Detections, masks: Sequence[RegionMask | None], tracks: Tracks
    ) -> None:
        """What was found in a keyframe."""
        self._write(
            "perceived",
            stamp_ns=keyframe.stamp_ns,
            camera=keyframe.camera_id,
            labels=detections.labels,
            masks=sum(mask is not None for mask in masks),
            tracks=tracks.track_ids.tolist(),
        )

    def mapped(self, keyframe: KeyframeRecord | None, delta: MapDelta) -> None:
        """What a keyframe changed, or, with `None`, the end of the traversal."""
        self._write("mapped", stamp_ns=None if keyframe is None else keyframe.stamp_ns, **_counts(delta))

    def committed(self, batch: MapDelta) -> None:
        """A batch stands in the database."""
        self._write("committed", **_counts(batch))

    def ended(self, summary: SessionSummary) -> None:
        """The traversal is complete, or stopped."""
        self._write("ended", complete=summary.complete, objects=summary.objects, warnings=summary.warnings)

    def _write(self, event: str, **values: object) -> None:
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"event": event, **values}) + "\n")


def _counts(delta: MapDelta) -> dict[str, object]:
    return {
        "keyframes": len(delta.keyframes),
        "observations": len(delta.observations),
        "instances": [instance.number for instance in delta.instances],
        "states": [[state.object_number, state.index] for state in delta.states],
        "temporal_edges": [edge.kind for edge in delta.temporal_edges],
    }
