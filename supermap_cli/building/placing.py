"""Where a traversal's odometry stands in the map: levelled if it is the first, else aligned with what is there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.mapping.alignment import Alignment, align, placed_by_hand
from supermap_cli.mapping.levelling import Levelling, LowReturns, level, level_view
from supermap_cli.mapping.structure import CoarseDepth, coarse_depth, stored_depth
from supermap_cli.memory.store import MapStore
from supermap_cli.protocols import Recording
from supermap_cli.recordings.lidar_depth import SweepDepth

SAMPLED_FRAMES = 30
"""Images, spread over a recording, by which it is levelled and aligned."""


@dataclass(frozen=True)
class Placement:
    """`T_map_odom`, how it was found, in words, and what the user should know about it; `floor_z`: the floor's height,
    `None` if it was not seen.
    """

    T_map_odom: FloatArray
    method: str
    warnings: tuple[str, ...] = ()
    floor_z: float | None = None


def place_traversal(
    recording: Recording, trajectory: Trajectory, store: MapStore, wish: str, *, without: int | None = None
) -> Placement:
    """Find `T_map_odom`. `wish` is "auto", "none" (the levelled odom frame is the map's), or "x y z yaw_deg". The
    traversal `without` does not count as part of the map.

    Raises `AlignmentError` if a further traversal cannot be placed with confidence, or the wish is not understood.
    """
    low = LowReturns(trajectory)
    views = list(sample_views(recording, trajectory, low))
    level_views = [*map(level_view, views), *low.views()]
    levelling = level(level_views, recording.imu() if "imu" in recording.streams else (), trajectory)
    warnings = () if levelling.warning is None else (levelling.warning,)
    if wish not in {"auto", "none"}:
        return Placement(placed_by_hand(wish, levelling.T_map_odom), f"given: {wish}", warnings, levelling.floor_z)
    earlier = [each for each in store.traversals() if each.id != without]
    if wish == "none" or not earlier:
        return Placement(levelling.T_map_odom, describe_levelling(levelling), warnings, levelling.floor_z)
    map_views = [stored_depth(record) for record in store.keyframe_depths([each.id for each in earlier])]
    hypotheses = [each.T_map_odom for each in reversed(earlier)]
    aligned = align(map_views, views, levelling.T_map_odom, hypotheses)
    floor_z = None
    if levelling.floor_z is not None:
        floor_z = levelling.floor_z + float(aligned.T_map_odom[2, 3] - levelling.T_map_odom[2, 3])
    return Placement(aligned.T_map_odom, describe_alignment(aligned), warnings, floor_z)


def sample_views(recording: Recording, trajectory: Trajectory, low: LowReturns) -> Iterator[CoarseDepth]:
    """Coarse depth images in the odom frame, spread evenly over the recording; `low` sees all sweeps meanwhile."""
    stamps = recording.frame_stamps_ns()
    chosen = np.unique(np.linspace(0, len(stamps) - 1, min(SAMPLED_FRAMES, len(stamps))).astype(np.int64))
    wanted = frozenset(stamps[chosen].tolist())
    sweeps = None if "depth" in recording.streams else SweepDepth(low.watched(recording.sweeps()), trajectory.at_many)
    for frame in recording.frames(wanted.__contains__):
        T_odom_base = trajectory.at(frame.stamp_ns)
        if T_odom_base is None:
            continue
        seen = frame if sweeps is None else sweeps.complete(frame)
        view = coarse_depth(seen, T_odom_base)
        if view is not None:
            yield view


def describe_levelling(found: Levelling) -> str:
    """One line on how the map was levelled."""
    floor = "floor at z = 0" if found.floor_seen else "no floor seen"
    how = {"imu": "by gravity (IMU)", "structure": "by floors and table tops", "odom": "odometry kept as it is"}
    return f"levelled {how[found.method]}, {found.tilt_deg:.1f} degrees, {floor}"


def describe_alignment(found: Alignment) -> str:
    """One line on how the traversal was aligned."""
    how = {"continued": "odometry goes on from an earlier traversal", "refined": "odometry goes on, refined"}
    return f"{how.get(found.method, 'registered in the map')}, {100 * found.fitness:.0f} % of its surfaces fit"
