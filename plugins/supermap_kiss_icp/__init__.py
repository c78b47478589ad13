"""LiDAR odometry by KISS-ICP (Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP", RA-L 2023)."""

from __future__ import annotations

from pydantic import Field

from supermap_cli import Options, Register, hookimpl
from supermap_cli.protocols import Odometry, Recording


class KissIcpOptions(Options):
    """Options of the odometry `kiss-icp`."""

    voxel_m: float | None = Field(
        None,
        gt=0,
        le=10,
        description="edge of the local map's voxels; default: a fifteenth of the scan's extent, 0.2-1",
    )
    min_range_m: float = Field(0.4, ge=0, description="nearer points are left out: the robot itself")
    max_range_m: float = Field(100.0, gt=0, le=1000, description="farther points are left out")
    deskew: bool = Field(default=True, description="undo the motion within a scan, where points carry their own times")
    threads: int = Field(
        1, ge=0, description="threads of the registration, 0 = all cores; only 1 is repeatable bit by bit"
    )


@hookimpl
def register_odometry(register: Register) -> None:
    """Register `kiss-icp`."""
    register("kiss-icp", make_odometry, KissIcpOptions, needs=("lidar",))


def make_odometry(options: KissIcpOptions, recording: Recording | None) -> Odometry:
    """Make the odometry; its library is loaded here. Without a recording it works on the sweeps that are pushed."""
    from supermap_kiss_icp.odometry import KissIcpOdometry  # noqa: PLC0415 - heavy

    return KissIcpOdometry(recording, options)
